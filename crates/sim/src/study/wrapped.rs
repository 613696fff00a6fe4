//! Paragraphs under a table.

use std::fmt::Write as _;

/// A paragraph in lines of at most `columns`, the second and further ones indented.
pub(super) fn wrapped(text: &str, columns: usize) -> String {
    let mut lines = String::new();
    let mut line = String::from("*");
    for word in text.split_whitespace() {
        if line.chars().count() + 1 + word.chars().count() > columns {
            let _ = writeln!(lines, "{line}");
            line = String::from(" ");
        }
        line.push(' ');
        line.push_str(word);
    }
    let _ = writeln!(lines, "{line}");
    lines
}
