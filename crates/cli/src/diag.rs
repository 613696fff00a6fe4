//! Messages for people: file, line, column, the marked place, and what would
//! help. The only file that names the renderer.

use std::ops::Range;

use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{
    AnnotationKind, Group, Level, Origin, Renderer, Snippet, normalize_untrusted_str,
};

/// Source lines longer than this many columns are cut around the mark.
const WIDTH: usize = 120;

/// How grave it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Severity {
    Error,
    Warning,
}

/// One message, with the place it speaks of where there is one.
#[derive(Debug, Clone)]
pub struct Diagnostic {
    severity: Severity,
    message: String,
    place: Option<Place>,
    notes: Vec<String>,
    help: Option<String>,
}

/// A place in a file.
#[derive(Debug, Clone)]
enum Place {
    /// A marked span of bytes in a text that is at hand.
    Span {
        path: String,
        text: String,
        span: Range<usize>,
    },
    /// A file, or a line of it, whose text is not shown.
    Line { path: String, line: Option<usize> },
}

impl Diagnostic {
    /// An error saying `message` (one sentence, no full stop, lower case).
    pub fn error(message: impl Into<String>) -> Self {
        Self::new(Severity::Error, message.into())
    }

    /// A warning saying `message`.
    pub fn warning(message: impl Into<String>) -> Self {
        Self::new(Severity::Warning, message.into())
    }

    fn new(severity: Severity, message: String) -> Self {
        Self {
            severity,
            message,
            place: None,
            notes: Vec::new(),
            help: None,
        }
    }

    /// Marks the bytes `span` of `text`, the content of the file `path`. A span
    /// that does not fit the text is moved into it: a diagnostic never fails.
    pub fn at_span(mut self, path: &str, text: &str, span: Range<usize>) -> Self {
        let end = floor_boundary(text, span.end.min(text.len()));
        let start = floor_boundary(text, span.start.min(end));
        self.place = Some(Place::Span {
            path: path.into(),
            text: text.into(),
            span: start..end,
        });
        self
    }

    /// Names a file, and a line of it (from 1) where known.
    pub fn at_line(mut self, path: &str, line: Option<usize>) -> Self {
        self.place = Some(Place::Line {
            path: path.into(),
            line,
        });
        self
    }

    /// A further fact.
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.notes.push(note.into());
        self
    }

    /// What would do instead.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// As [`Diagnostic::help`], where there may be none.
    pub fn maybe_help(mut self, help: Option<String>) -> Self {
        self.help = help.or(self.help);
        self
    }

    /// The message alone, without place and help.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// The text to print, without a trailing line feed.
    pub fn render(&self, color: bool) -> String {
        let level = match self.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
        };
        let renderer = if color {
            Renderer::styled()
        } else {
            Renderer::plain()
        }
        .decor_style(DecorStyle::Ascii)
        .term_width(WIDTH);

        let mut group = level
            .primary_title(normalize_untrusted_str(&self.message))
            .elements(std::iter::empty::<annotate_snippets::Element<'_>>());
        match &self.place {
            Some(Place::Span { path, text, span }) => {
                let mark = AnnotationKind::Primary.span(span.clone());
                group = group.element(
                    Snippet::source(text.as_str())
                        .path(path.as_str())
                        .annotation(mark),
                );
            }
            Some(Place::Line { path, line }) => {
                let mut origin = Origin::path(path.as_str());
                if let Some(line) = line {
                    origin = origin.line(*line);
                }
                group = group.element(origin);
            }
            None => {}
        }
        // Beside a marked place notes hang on it; without one they stand alone.
        let marked = matches!(self.place, Some(Place::Span { .. }));
        let notes = self.notes.iter().map(|note| (Level::NOTE, note));
        let help = self.help.iter().map(|help| (Level::HELP, help));
        let mut alone = Vec::new();
        for (level, text) in notes.chain(help) {
            let text = normalize_untrusted_str(text);
            if marked {
                group = group.element(level.message(text));
            } else {
                alone.push(Group::with_title(level.secondary_title(text)));
            }
        }
        let mut rendered = renderer.render(&[group]);
        for group in alone {
            rendered.push('\n');
            rendered.push_str(&renderer.render(&[group]));
        }
        // The renderer pads some lines; trailing blanks only disturb.
        let mut text = String::with_capacity(rendered.len());
        for line in rendered.lines() {
            text.push_str(line.trim_end());
            text.push('\n');
        }
        text.truncate(text.trim_end().len());
        text
    }
}

/// The nearest character boundary at or before `index`.
fn floor_boundary(text: &str, mut index: usize) -> usize {
    while !text.is_char_boundary(index) {
        index -= 1;
    }
    index
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_is_shown_with_file_line_column_and_help() {
        let text = "[follow]\nmax_sped_mps = 1.5\n";
        let shown = Diagnostic::error("unknown key `max_sped_mps` in [follow]")
            .at_span("ride.toml", text, 9..21)
            .help("did you mean `max_speed_mps`?")
            .render(false);
        assert_eq!(
            shown,
            "\
error: unknown key `max_sped_mps` in [follow]
 --> ride.toml:2:1
  |
2 | max_sped_mps = 1.5
  | ^^^^^^^^^^^^
  |
  = help: did you mean `max_speed_mps`?"
        );
    }

    #[test]
    fn a_line_without_text_is_named() {
        let shown = Diagnostic::error("`resolution` must be a number, found `fine`")
            .at_line("maps/yard.yaml", Some(2))
            .render(false);
        assert_eq!(
            shown,
            "\
error: `resolution` must be a number, found `fine`
--> maps/yard.yaml:2"
        );
    }

    #[test]
    fn a_message_without_a_place_is_one_line_and_its_help() {
        let plain = Diagnostic::error("no seeds to run").render(false);
        assert_eq!(plain, "error: no seeds to run");
        let helped = Diagnostic::warning("x").help("y").note("z").render(false);
        assert_eq!(helped, "warning: x\nnote: z\nhelp: y");
    }

    #[test]
    fn colour_only_when_asked_for() {
        let diagnostic = Diagnostic::error("x");
        assert!(!diagnostic.render(false).contains('\u{1b}'));
        assert!(diagnostic.render(true).contains('\u{1b}'));
    }

    #[test]
    fn any_span_of_any_text_renders() {
        let texts = [
            "",
            "é",
            "a\nb",
            "\u{0}\u{7}\t\r\n",
            "[x]\ny = \"é\n\"\n",
            "\n\n\n",
        ];
        for text in texts {
            for start in 0..=text.len() + 2 {
                for end in 0..=text.len() + 2 {
                    let shown = Diagnostic::error("x")
                        .at_span("p", text, Range { start, end })
                        .render(false);
                    assert!(shown.starts_with("error: x"));
                }
            }
        }
    }
}
