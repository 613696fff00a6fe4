//! Drawings as PNG: the SVG, rendered.

use resvg::{tiny_skia, usvg};

use crate::drawing::Drawing;
use crate::error::ReportError;
use crate::svg;

/// Widest and highest picture that is rendered, px.
pub const MAX_SIDE: f64 = 16_384.0;

/// The drawing as a PNG image, `zoom` of its pixels to one of the drawing's.
///
/// # Errors
///
/// [`ReportError::TooLarge`] beyond [`MAX_SIDE`], [`ReportError::Render`] where the renderer refuses.
pub fn write(drawing: &Drawing, zoom: f64) -> Result<Vec<u8>, ReportError> {
    let (width, height) = (drawing.width * zoom, drawing.height * zoom);
    let fits = |side: f64| (1.0..=MAX_SIDE).contains(&side);
    if !(fits(width) && fits(height)) {
        return Err(ReportError::TooLarge { width, height });
    }
    let refused = |what: String| ReportError::Render { what };
    let tree = usvg::Tree::from_str(&svg::write(drawing), &usvg::Options::default())
        .map_err(|error| refused(error.to_string()))?;
    let mut image = tiny_skia::Pixmap::new(width.ceil() as u32, height.ceil() as u32)
        .ok_or(ReportError::TooLarge { width, height })?;
    image.fill(tiny_skia::Color::WHITE);
    let scale = tiny_skia::Transform::from_scale(zoom as f32, zoom as f32);
    resvg::render(&tree, scale, &mut image.as_mut());
    image
        .encode_png()
        .map_err(|error| refused(error.to_string()))
}
