//! The letters of labels, as outlines: a picture shows the same text on any machine, with or without fonts.
//!
//! `glyphs.txt` holds one glyph a line: code point, advance, outline, at 1000 units to the em, y up. The
//! licence of the outlines stands beside it in `glyphs.LICENSE`.

use std::collections::BTreeMap;
use std::sync::OnceLock;

/// Units to the em.
pub(crate) const EM: f64 = 1000.0;
/// What is drawn for a character that is not in the table.
const SUBSTITUTE: char = '·';

/// One letter.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Glyph {
    /// From its origin to that of the next, units.
    pub(crate) advance: f64,
    /// Path data, y up; empty for a blank.
    pub(crate) outline: &'static str,
}

fn table() -> &'static BTreeMap<char, Glyph> {
    static TABLE: OnceLock<BTreeMap<char, Glyph>> = OnceLock::new();
    TABLE.get_or_init(|| {
        include_str!("glyphs.txt")
            .lines()
            .filter_map(|line| {
                let mut fields = line.splitn(3, ' ');
                let code = u32::from_str_radix(fields.next()?, 16).ok()?;
                let advance = fields.next()?.parse().ok()?;
                let outline = fields.next().unwrap_or_default();
                Some((char::from_u32(code)?, Glyph { advance, outline }))
            })
            .collect()
    })
}

/// The characters a text is drawn with: itself, where there is an outline for each.
pub(crate) fn drawn(text: &str) -> impl Iterator<Item = (char, Glyph)> {
    text.chars().filter_map(|wanted| {
        let found = table().get_key_value(&wanted);
        let (character, glyph) = found.or_else(|| table().get_key_value(&SUBSTITUTE))?;
        Some((*character, *glyph))
    })
}

/// Width of `text` at `size` px to the em, px.
#[must_use]
pub fn width(text: &str, size: f64) -> f64 {
    drawn(text).map(|(_, glyph)| glyph.advance).sum::<f64>() * size / EM
}

/// `text`, cut with an ellipsis where it would be wider than `most` px.
#[must_use]
pub fn fitted(text: &str, size: f64, most: f64) -> String {
    if width(text, size) <= most {
        return text.to_owned();
    }
    let mut cut: String = text.to_owned();
    while !cut.is_empty() && width(&cut, size) + width("…", size) > most {
        cut.pop();
    }
    cut.truncate(cut.trim_end().len());
    cut.push('…');
    cut
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_of_the_table_is_a_glyph() {
        assert_eq!(table().len(), include_str!("glyphs.txt").lines().count());
        for (character, glyph) in table() {
            assert!(
                glyph.advance > 0.0 && glyph.advance < 2.0 * EM,
                "{character}"
            );
            assert!(
                glyph
                    .outline
                    .chars()
                    .all(|c| "MLQZ- 0123456789".contains(c)),
                "{character}"
            );
        }
    }

    #[test]
    fn ascii_and_the_signs_of_our_labels_have_outlines() {
        for character in ('!'..='~').chain("κσ±°−–×…²³⁻¹µ·".chars()) {
            assert!(!table()[&character].outline.is_empty(), "{character}");
        }
    }

    #[test]
    fn a_text_is_as_wide_as_its_letters() {
        // Advances of the typeface: A 684, V 684, blank 318 thousandths of an em.
        assert!((width("A V", 10.0) - 16.86).abs() < 1e-9);
        assert_eq!(width("", 10.0), 0.0);
        // A letter without an outline takes the room of its substitute.
        assert_eq!(width("\u{4e2d}", 10.0), width("·", 10.0));
    }

    #[test]
    fn a_text_too_wide_is_cut() {
        assert_eq!(fitted("short", 10.0, 100.0), "short");
        let cut = fitted("a name that is much too long", 10.0, 60.0);
        assert!(cut.ends_with('…') && width(&cut, 10.0) <= 60.0, "{cut}");
        assert_eq!(fitted("abc", 10.0, 0.0), "…");
    }
}
