//! Drawings as the bytes of a picture file.

use std::path::Path;

use bikebot_report::{drawing::Drawing, png, svg};
use clap::ValueEnum;

use crate::diag::Diagnostic;
use crate::exit::Failure;

/// Formats of pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Scalable, for documents and browsers.
    Svg,
    /// Pixels.
    Png,
}

impl Format {
    /// The format that the name of a file asks for.
    pub fn of(path: &Path) -> Option<Self> {
        let ending = path.extension()?.to_str()?.to_ascii_lowercase();
        [Self::Svg, Self::Png]
            .into_iter()
            .find(|format| format.ending() == ending)
    }

    /// How its files' names end.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Png => "png",
        }
    }

    /// The file's content; `zoom` are pixels of a PNG to one of the drawing. Where it
    /// would be too large, `help` says what gives a smaller one.
    pub fn write(self, drawing: &Drawing, zoom: f64, help: &str) -> Result<Vec<u8>, Failure> {
        match self {
            Self::Svg => Ok(svg::write(drawing).into_bytes()),
            Self::Png => png::write(drawing, zoom)
                .map_err(|error| Failure::usage(Diagnostic::error(error.to_string()).help(help))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_file_asks_for_its_format() {
        for (name, format) in [
            ("a.svg", Some(Format::Svg)),
            ("a/b.c.PNG", Some(Format::Png)),
            ("svg", None),
            ("a.gif", None),
        ] {
            assert_eq!(Format::of(Path::new(name)), format, "{name}");
        }
    }
}
