//! The figure of a map alone.

use crate::axis::MapFrame;
use crate::drawing::{Area, Drawing, Label, Outline, Style};
use crate::label;
use crate::palette;
use crate::scenery::Ground;

/// A map with its axes, m.
#[must_use]
pub fn ground_figure(ground: Ground<'_>, title: impl Into<String>) -> Drawing {
    let title = title.into();
    let frame = MapFrame::fitting(ground.bounds, Area::new(62.0, 70.0, 714.0, 714.0));
    let width = frame.area.right().max(400.0) + 24.0;
    let mut drawing = Drawing::new(width, frame.area.bottom() + 52.0, title.clone());
    let sheet = Area::new(0.0, 0.0, drawing.width, drawing.height);
    drawing.shape(Outline::rectangle(sheet), Style::fill(palette::PAPER));
    let text = label::fitted(&title, 21.0, width - 86.0);
    drawing.label(Label::new(text, [62.0, 36.0], 21.0, palette::INK));
    let ticks = |pixels: f64| ((pixels / 90.0) as usize).clamp(2, 12);
    drawing.shape(Outline::rectangle(frame.area), Style::fill(palette::FIELD));
    let chart = frame.chart();
    chart.data(&mut drawing, ground.items(&frame));
    chart.frame(
        &mut drawing,
        ticks(frame.area.width),
        ticks(frame.area.height),
        "x, m",
    );
    let name_at = [frame.area.left, frame.area.top - 8.0];
    drawing.label(Label::new("y, m", name_at, 12.5, palette::INK));
    drawing
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::svg;
    use bikebot_geometry::Point2;
    use bikebot_world::{Bounds, Obstacle};

    #[test]
    fn a_map_is_drawn_with_each_of_its_shapes() {
        let draw = |obstacles: &[Obstacle]| {
            let ground = Ground {
                bounds: Bounds::new(0.0, 0.0, 10.0, 5.0),
                obstacles,
                grid: None,
            };
            svg::write(&ground_figure(ground, "yard"))
        };
        let disc = |x| Obstacle::Disc {
            center: Point2::new(x, 2.0),
            radius: 1.0,
        };
        let paths = |svg: &str| svg.matches("<path").count();
        let (none, two) = (draw(&[]), draw(&[disc(2.0), disc(6.0)]));
        assert!(two.starts_with("<svg") || two.starts_with("<?xml"));
        assert!(paths(&two) > paths(&none));
    }
}
