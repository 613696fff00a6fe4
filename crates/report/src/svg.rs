//! Drawings as SVG: the same bytes for the same drawing, no number longer than it needs to be.
//!
//! Coordinates are whole hundredths of a pixel, written as differences, so that rounding does not add up.
//! A window is a nested `svg`, which cuts off what lies outside without needing a name of its own.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use crate::drawing::{Drawing, Item, Label, Outline, Pixel, Step, Style};
use crate::label;

/// Hundredths of a pixel.
const GRAIN: f64 = 100.0;
/// Furthest from the sheet's corner that anything is drawn, hundredths of a pixel: far outside of any sheet.
const FURTHEST: f64 = 1e8;

/// A coordinate in hundredths of a pixel; what is not a number lies at 0, what is far off at the rim.
fn grain(value: f64) -> i64 {
    (value * GRAIN).clamp(-FURTHEST, FURTHEST).round() as i64
}

/// A whole number of hundredths, as short as it goes.
fn hundredths(value: i64) -> String {
    let sign = if value < 0 { "-" } else { "" };
    let (whole, part) = (value.abs() / 100, value.abs() % 100);
    match (whole, part) {
        (_, 0) => format!("{sign}{whole}"),
        (0, part) => format!("{sign}.{part:02}").trim_end_matches('0').to_owned(),
        _ => format!("{sign}{whole}.{part:02}")
            .trim_end_matches('0')
            .to_owned(),
    }
}

/// A number with at most two decimals.
fn number(value: f64) -> String {
    hundredths(grain(value))
}

/// Path data, one letter after the other.
#[derive(Default)]
struct PathData {
    text: String,
    /// The letter in force, which need not be repeated.
    letter: char,
    at: [i64; 2],
    start: [i64; 2],
}

impl PathData {
    fn write(&mut self, letter: char, numbers: &[i64]) {
        if self.letter != letter {
            self.text.push(letter);
        }
        let mut is_first = self.letter != letter;
        for value in numbers {
            let text = hundredths(*value);
            if !is_first && !text.starts_with('-') {
                self.text.push(' ');
            }
            self.text.push_str(&text);
            is_first = false;
        }
        self.letter = letter;
    }

    fn step(&mut self, step: &Step) {
        let whole = |p: Pixel| [grain(p[0]), grain(p[1])];
        let from = |p: [i64; 2], at: [i64; 2]| [p[0] - at[0], p[1] - at[1]];
        match *step {
            Step::Move(to) => {
                let to = whole(to);
                // Always with its letter: a second pair after `M` would be a line.
                self.letter = ' ';
                self.write('M', &to);
                (self.at, self.start) = (to, to);
            }
            Step::Line(to) => {
                let to = whole(to);
                match from(to, self.at) {
                    [0, 0] => return,
                    [dx, 0] => self.write('h', &[dx]),
                    [0, dy] => self.write('v', &[dy]),
                    both => self.write('l', &both),
                }
                self.at = to;
            }
            Step::Cubic(a, b, to) => {
                let points = [whole(a), whole(b), whole(to)];
                let [a, b, end] = points.map(|point| from(point, self.at));
                self.write('c', &[a[0], a[1], b[0], b[1], end[0], end[1]]);
                self.at = points[2];
            }
            Step::Close => {
                self.text.push('z');
                self.letter = 'z';
                self.at = self.start;
            }
        }
    }
}

/// The path data of an outline.
fn path_data(outline: &Outline) -> String {
    let mut data = PathData::default();
    for step in outline.steps() {
        data.step(step);
    }
    data.text
}

fn style_attributes(style: &Style) -> String {
    let mut text = String::new();
    match style.fill {
        Some(colour) => {
            let _ = write!(text, r#" fill="{}""#, colour.0);
        }
        None => text.push_str(r#" fill="none""#),
    }
    if let Some(colour) = style.stroke {
        let _ = write!(
            text,
            r#" stroke="{}" stroke-width="{}""#,
            colour.0,
            number(style.width)
        );
        if !style.dash.is_empty() {
            let dash: Vec<String> = style.dash.iter().map(|length| number(*length)).collect();
            let _ = write!(text, r#" stroke-dasharray="{}""#, dash.join(" "));
        }
    }
    if style.opacity < 1.0 {
        let _ = write!(text, r#" opacity="{}""#, number(style.opacity));
    }
    text
}

/// Text that can stand in an attribute or between tags.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            // XML has no way to write these.
            c if c.is_control() => out.push(' '),
            '\u{fffe}' | '\u{ffff}' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

fn write_label(label: &Label, out: &mut String) {
    let [x, y] = label.at;
    let scale = label.size / label::EM;
    let turn = if label.upright { " rotate(-90)" } else { "" };
    let _ = write!(
        out,
        r#"<g fill="{}" role="img" aria-label="{}" transform="translate({} {}){turn} scale({scale:.5} -{scale:.5})">"#,
        label.colour.0,
        escaped(&label.text),
        number(x),
        number(y),
    );
    let mut at = -label.lead() / scale;
    for (character, glyph) in label::drawn(&label.text) {
        if !glyph.outline.is_empty() {
            let _ = write!(
                out,
                r##"<use href="#{}" x="{}"/>"##,
                glyph_name(character),
                number(at)
            );
        }
        at += glyph.advance;
    }
    out.push_str("</g>\n");
}

fn glyph_name(character: char) -> String {
    format!("u{:x}", u32::from(character))
}

fn write_item(item: &Item, out: &mut String) {
    match item {
        Item::Shape(outline, style) => {
            let _ = writeln!(
                out,
                r#"<path d="{}"{}/>"#,
                path_data(outline),
                style_attributes(style)
            );
        }
        Item::Label(label) => write_label(label, out),
        Item::Window(area, items) => {
            let [x, y, width, height] = [area.left, area.top, area.width, area.height].map(number);
            let _ = writeln!(
                out,
                r#"<svg x="{x}" y="{y}" width="{width}" height="{height}" viewBox="{x} {y} {width} {height}" overflow="hidden">"#
            );
            for item in items {
                write_item(item, out);
            }
            out.push_str("</svg>\n");
        }
    }
}

fn collect_glyphs(items: &[Item], into: &mut BTreeMap<char, &'static str>) {
    for item in items {
        match item {
            Item::Label(label) => into.extend(
                label::drawn(&label.text)
                    .filter(|(_, glyph)| !glyph.outline.is_empty())
                    .map(|(character, glyph)| (character, glyph.outline)),
            ),
            Item::Window(_, items) => collect_glyphs(items, into),
            Item::Shape(..) => {}
        }
    }
}

/// The drawing as an SVG document.
#[must_use]
pub fn write(drawing: &Drawing) -> String {
    let (width, height) = (number(drawing.width), number(drawing.height));
    let title = escaped(&drawing.title);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" \
         fill-rule=\"evenodd\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n<title>{title}</title>\n"
    );
    let mut glyphs = BTreeMap::new();
    collect_glyphs(&drawing.items, &mut glyphs);
    if !glyphs.is_empty() {
        out.push_str("<defs>\n");
        for (character, outline) in glyphs {
            let _ = writeln!(
                out,
                r#"<path id="{}" fill-rule="nonzero" d="{outline}"/>"#,
                glyph_name(character)
            );
        }
        out.push_str("</defs>\n");
    }
    for item in &drawing.items {
        write_item(item, &mut out);
    }
    out.push_str("</svg>\n");
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::Area;
    use crate::palette;
    use proptest::prelude::*;

    #[test]
    fn numbers_are_as_short_as_they_go() {
        for (value, text) in [
            (0.0, "0"),
            (-0.001, "0"),
            (0.5, ".5"),
            (-0.25, "-.25"),
            (12.0, "12"),
            (12.345, "12.35"),
            (-100.10, "-100.1"),
            (f64::NAN, "0"),
            (f64::INFINITY, "1000000"),
        ] {
            assert_eq!(number(value), text, "{value}");
        }
    }

    #[test]
    fn legs_are_written_as_differences() {
        let mut outline = Outline::through([[1.0, 1.0], [3.0, 1.0], [3.0, 0.5], [4.0, 1.5]]);
        outline.close();
        outline.move_to([0.0, 0.0]);
        outline.cubic_to([1.0, 0.0], [2.0, 1.0], [2.0, 2.0]);
        outline.line_to([3.0, 3.0]);
        outline.line_to([4.0, 4.0]);
        assert_eq!(
            path_data(&outline),
            "M1 1h2v-.5l1 1zM0 0c1 0 2 1 2 2l1 1 1 1"
        );
    }

    #[test]
    fn text_of_any_kind_stays_text() {
        assert_eq!(escaped("a<b>&\"\u{0}"), "a&lt;b&gt;&amp;&quot; ");
    }

    /// Follows path data back to absolute points, in hundredths.
    fn ends(data: &str) -> Vec<[i64; 2]> {
        let mut points = Vec::new();
        let (mut at, mut start) = ([0_i64; 2], [0_i64; 2]);
        let mut rest = data;
        while let Some(letter) = rest.chars().next() {
            rest = &rest[1..];
            let end = rest
                .find(|c: char| c.is_ascii_alphabetic())
                .unwrap_or(rest.len());
            let numbers: Vec<i64> = rest[..end]
                .replace('-', " -")
                .split_whitespace()
                .map(|text| (text.parse::<f64>().unwrap() * 100.0).round() as i64)
                .collect();
            rest = &rest[end..];
            match letter {
                'M' => {
                    at = [numbers[0], numbers[1]];
                    start = at;
                    points.push(at);
                }
                'z' => at = start,
                'h' => {
                    for dx in numbers {
                        at[0] += dx;
                        points.push(at);
                    }
                }
                'v' => {
                    for dy in numbers {
                        at[1] += dy;
                        points.push(at);
                    }
                }
                _ => {
                    for step in numbers.chunks(if letter == 'c' { 6 } else { 2 }) {
                        let n = step.len();
                        at = [at[0] + step[n - 2], at[1] + step[n - 1]];
                        points.push(at);
                    }
                }
            }
        }
        points
    }

    proptest! {
        #[test]
        fn rounding_does_not_add_up(points in prop::collection::vec((-1e3..1e3, -1e3..1e3), 2..200)) {
            let outline = Outline::through(points.iter().map(|&(x, y)| [x, y]));
            let back = ends(&path_data(&outline));
            let last = points[points.len() - 1];
            prop_assert_eq!(back[back.len() - 1], [grain(last.0), grain(last.1)]);
        }

        #[test]
        fn whatever_is_drawn_every_number_is_finite(values in prop::collection::vec(any::<f64>(), 8)) {
            let mut drawing = Drawing::new(values[0], values[1], "x");
            let mut outline = Outline::through([[values[2], values[3]], [values[4], values[5]]]);
            outline.cubic_to([values[6], values[7]], [values[0], values[1]], [values[2], values[3]]);
            drawing.shape(outline, Style::line(palette::INK, values[4]));
            drawing.items.push(Item::Window(Area::new(values[0], values[1], values[2], values[3]), Vec::new()));
            let svg = write(&drawing);
            prop_assert!(!svg.contains("NaN") && !svg.contains("inf"), "{}", svg);
        }
    }
}
