//! The flat part of YAML that map_server files are written in.
//!
//! One mapping of plain keys to scalars or lists of scalars; comments, both kinds of quotes,
//! lists in brackets or as `- ` lines, `---` and `...`. Anchors, aliases, tags, nesting, block
//! scalars and repeated keys are refused by name: a map description needs none of them, and
//! each has been used to attack a reader.

use std::collections::BTreeMap;

use super::error::{MapError, MapProblem, quoted, shorten};

/// Most bytes such a file may have.
const MAX_BYTES: usize = 64 * 1024;

/// One value and the line its key stands in.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Entry {
    pub(crate) line: usize,
    pub(crate) value: Value,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Value {
    Scalar(String),
    List(Vec<String>),
}

impl Value {
    pub(crate) fn describe(&self) -> String {
        match self {
            Self::Scalar(s) if s.is_empty() => "nothing".into(),
            Self::Scalar(s) => quoted(s),
            Self::List(items) => format!("a list of {}", items.len()),
        }
    }
}

/// The mapping in key order.
pub(crate) fn parse(name: &str, bytes: &[u8]) -> Result<BTreeMap<String, Entry>, MapError> {
    if bytes.len() > MAX_BYTES {
        return Err(MapError::new(
            name,
            MapProblem::TooManyBytes {
                found: bytes.len(),
                limit: MAX_BYTES,
            },
        ));
    }
    let text = super::text_of(name, bytes)?;
    let mut entries: BTreeMap<String, Entry> = BTreeMap::new();
    // The key whose value may still follow as `- ` lines.
    let mut open: Option<String> = None;
    for (index, raw) in text.lines().enumerate() {
        let line = index + 1;
        let at = Place { name, line };
        let content = raw.trim_start_matches([' ', '\t']);
        if content.is_empty() || content.starts_with('#') || content == "\r" {
            continue;
        }
        let indented = content.len() < raw.len();
        let content = content.trim_end();
        if !indented && (content == "---" || content.starts_with("--- ")) {
            if entries.is_empty() && content == "---" {
                continue;
            }
            return Err(at.unsupported("more than one YAML document", "keep one mapping per file"));
        }
        if !indented && content == "..." {
            break;
        }
        if let Some(item) = content
            .strip_prefix("- ")
            .or((content == "-").then_some(""))
        {
            let Some(key) = &open else {
                return Err(at.unsupported(
                    "a list here",
                    "write one `key: value` per line, lists as [x, y, yaw]",
                ));
            };
            let (item, rest) = scalar(at, item, &[])?;
            at.only_comment(rest)?;
            if let Some(Entry {
                value: Value::List(items),
                ..
            }) = entries.get_mut(key)
            {
                items.push(item);
            } else if let Some(entry) = entries.get_mut(key) {
                entry.value = Value::List(vec![item]);
            }
            continue;
        }
        if indented {
            return Err(at.unsupported(
                &format!("the indented line {}", quoted(content)),
                "nesting has no place here: write `key: value` from the first column",
            ));
        }
        let (key, value) = key_and_value(at, content)?;
        if let Some(earlier) = entries.get(&key) {
            let first = earlier.line;
            return Err(MapError::at_key(
                name,
                line,
                &key,
                MapProblem::Duplicate { first },
            ));
        }
        open = (value == Value::Scalar(String::new())).then(|| key.clone());
        entries.insert(key, Entry { line, value });
    }
    Ok(entries)
}

/// Where in which file.
#[derive(Clone, Copy)]
struct Place<'a> {
    name: &'a str,
    line: usize,
}

impl Place<'_> {
    fn unsupported(self, found: &str, instead: &'static str) -> MapError {
        MapError::at_line(
            self.name,
            self.line,
            MapProblem::Unsupported {
                found: found.to_owned(),
                instead,
            },
        )
    }

    fn malformed(self, found: String, expected: &str) -> MapError {
        MapError::at_line(
            self.name,
            self.line,
            MapProblem::Malformed {
                found,
                expected: expected.to_owned(),
            },
        )
    }

    /// After a value only a comment may follow.
    fn only_comment(self, rest: &str) -> Result<(), MapError> {
        let rest = rest.trim();
        if rest.is_empty() || rest.starts_with('#') {
            Ok(())
        } else {
            Err(self.malformed(
                format!("{} after the value", quoted(rest)),
                "the end of the line or a # comment",
            ))
        }
    }
}

fn key_and_value(at: Place<'_>, content: &str) -> Result<(String, Value), MapError> {
    if content.starts_with(['?', '%', '{', '[', '&', '*', '!', '|', '>', '@', '`', '\t']) {
        return Err(at.unsupported(
            &format!("the YAML construct {}", quoted(content)),
            "write one `key: value` per line",
        ));
    }
    let (key, rest) = if content.starts_with(['"', '\'']) {
        let (key, rest) = scalar(at, content, &[])?;
        let rest = rest.trim_start();
        let rest = rest
            .strip_prefix(':')
            .ok_or_else(|| at.malformed(quoted(content), "`key: value`"))?;
        (key, rest)
    } else {
        let colon = content
            .match_indices(':')
            .map(|(i, _)| i)
            .find(|&i| matches!(content.as_bytes().get(i + 1), None | Some(b' ' | b'\t')));
        let Some(colon) = colon else {
            return Err(at.malformed(
                quoted(content),
                "`key: value`, with a space after the colon",
            ));
        };
        (
            content[..colon].trim_end().to_owned(),
            &content[colon + 1..],
        )
    };
    if key.is_empty() || key.contains('#') {
        return Err(at.malformed(quoted(&key), "a key before the colon"));
    }
    let value = rest.trim_start();
    if value.is_empty() || value.starts_with('#') {
        return Ok((key, Value::Scalar(String::new())));
    }
    if let Some(list) = value.strip_prefix('[') {
        let (items, rest) = flow_list(at, list)?;
        at.only_comment(rest)?;
        return Ok((key, Value::List(items)));
    }
    let (scalar, rest) = scalar(at, value, &[])?;
    at.only_comment(rest)?;
    Ok((key, Value::Scalar(scalar)))
}

/// The items of `a, b, c]`, and what follows the bracket.
fn flow_list<'a>(at: Place<'_>, text: &'a str) -> Result<(Vec<String>, &'a str), MapError> {
    let mut items = Vec::new();
    let mut rest = text.trim_start();
    loop {
        if let Some(after) = rest.strip_prefix(']') {
            return Ok((items, after));
        }
        if rest.starts_with('[') {
            return Err(at.unsupported("a list within a list", "write [x, y, yaw]"));
        }
        if rest.is_empty() || rest.starts_with('#') {
            return Err(at.malformed(
                "a list without its closing bracket".into(),
                "the whole list on one line, as [x, y, yaw]",
            ));
        }
        let (item, after) = scalar(at, rest, &[',', ']'])?;
        items.push(item);
        rest = after.trim_start();
        if let Some(after) = rest.strip_prefix(',') {
            rest = after.trim_start();
        } else if !rest.starts_with(']') {
            return Err(at.malformed(
                if rest.is_empty() {
                    "a list without its closing bracket".into()
                } else {
                    format!("{} in a list", quoted(rest))
                },
                "items separated by commas, then ]",
            ));
        }
    }
}

/// One scalar, plain (ended by one of `stops`, a comment or the line) or quoted; and the rest.
fn scalar<'a>(at: Place<'_>, text: &'a str, stops: &[char]) -> Result<(String, &'a str), MapError> {
    match text.chars().next() {
        Some('\'') => single_quoted(at, &text[1..]),
        Some('"') => double_quoted(at, &text[1..]),
        Some('&' | '*') => Err(at.unsupported("a YAML anchor or alias", "write the value itself")),
        Some('!') => Err(at.unsupported("a YAML tag", "write the value without it")),
        Some('|' | '>') => {
            Err(at.unsupported("a block scalar", "write the value on the line of its key"))
        }
        Some('{') => Err(at.unsupported("a nested mapping", "write one `key: value` per line")),
        Some(c @ ('%' | '@' | '`')) => Err(at.malformed(
            format!("a value that begins with {c}"),
            "a value, in quotes if it needs that character",
        )),
        _ => {
            let mut end = text.len();
            let mut before = ' ';
            for (i, c) in text.char_indices() {
                let comment = c == '#' && before.is_whitespace();
                if stops.contains(&c) || comment {
                    end = i;
                    break;
                }
                before = c;
            }
            let plain = text[..end].trim_end();
            if plain.ends_with(':') || plain.contains(": ") {
                return Err(at.unsupported(
                    &format!("a mapping within the value {}", quoted(plain)),
                    "write one `key: value` per line",
                ));
            }
            Ok((plain.to_owned(), &text[end..]))
        }
    }
}

fn single_quoted<'a>(at: Place<'_>, text: &'a str) -> Result<(String, &'a str), MapError> {
    let mut value = String::new();
    let mut rest = text;
    loop {
        let Some(end) = rest.find('\'') else {
            return Err(unclosed(at, text));
        };
        value.push_str(&rest[..end]);
        rest = &rest[end + 1..];
        // Two quotes stand for one.
        match rest.strip_prefix('\'') {
            Some(after) => {
                value.push('\'');
                rest = after;
            }
            None => return Ok((value, rest)),
        }
    }
}

fn double_quoted<'a>(at: Place<'_>, text: &'a str) -> Result<(String, &'a str), MapError> {
    let mut value = String::new();
    let mut characters = text.char_indices();
    while let Some((i, c)) = characters.next() {
        match c {
            '"' => return Ok((value, &text[i + 1..])),
            '\\' => match characters.next() {
                Some((_, escaped @ ('"' | '\\' | '/'))) => value.push(escaped),
                Some((_, 't')) => value.push('\t'),
                Some((_, other)) => {
                    return Err(at.unsupported(
                        &format!("the escape \\{}", shorten(&other.to_string())),
                        "use single quotes to keep backslashes as they are",
                    ));
                }
                None => break,
            },
            other => value.push(other),
        }
    }
    Err(unclosed(at, text))
}

fn unclosed(at: Place<'_>, text: &str) -> MapError {
    at.malformed(
        format!("{} without its closing quote", quoted(text)),
        "the quote closed on the same line",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Value {
        let entries = parse("m.yaml", text.as_bytes()).expect(text);
        entries.get("k").expect(text).value.clone()
    }

    fn scalar_of(text: &str) -> String {
        match value(text) {
            Value::Scalar(s) => s,
            list => panic!("{text}: {list:?}"),
        }
    }

    #[test]
    fn comments_quotes_and_spaces_are_read_as_yaml_does() {
        assert_eq!(scalar_of("k: a b  # c"), "a b");
        assert_eq!(
            scalar_of("# first\n---\nk:   x#y\n...\nanything : ["),
            "x#y"
        );
        assert_eq!(scalar_of("k: 'it''s # not' # c"), "it's # not");
        assert_eq!(scalar_of("\"k\": \"a \\\"b\\\" \\\\\""), "a \"b\" \\");
        assert_eq!(scalar_of("k: C:\\maps\\x.pgm"), "C:\\maps\\x.pgm");
        assert_eq!(scalar_of("\u{feff}k: 1\r\n"), "1");
        assert_eq!(scalar_of("k:"), "");
    }

    #[test]
    fn lists_come_in_brackets_or_as_lines() {
        let three = Value::List(vec!["1".into(), "-2.5".into(), "0".into()]);
        for text in [
            "k: [1, -2.5, 0]",
            "k: [ 1,-2.5 ,0, ] # c",
            "k: [1, '-2.5', \"0\"]",
            "k:\n- 1\n- -2.5 # c\n- 0\n",
            "k:\n  - 1\n\n  - -2.5\n  # c\n  - 0\nj: 1",
        ] {
            assert_eq!(value(text), three, "{text}");
        }
        assert_eq!(value("k: []"), Value::List(Vec::new()));
    }

    #[test]
    fn what_a_map_does_not_need_is_refused_with_its_line() {
        for text in [
            "a: 1\nk: &x 1",
            "a: 1\nk: *x",
            "a: 1\nk: !!float 1",
            "a: 1\nk: |",
            "a: 1\nk: {x: 1}",
            "a: 1\nk: [[1]]",
            "a: 1\nk: [1",
            "a: 1\nk: [1 # ]",
            "a: 1\n  k: 1",
            "a: 1\n- k",
            "a: 1\n---",
            "a: 1\n? k",
            "a: 1\n%YAML 1.2",
            "a: 1\nk:1",
            "a: 1\nk",
            "a: 1\nk: 'x",
            "a: 1\nk: \"x\\",
            "a: 1\nk: \"\\x41\"",
            "a: 1\nk: 'x' y",
            "a: 1\nk: b: c",
            "a: 1\na: 2",
            "a: 1\n: 2",
            "a: 1\nk: \0",
        ] {
            let error = parse("m.yaml", text.as_bytes()).expect_err(text);
            assert_eq!(error.line, Some(2), "{text}: {error}");
        }
        assert!(parse("m.yaml", b"\xff\xfek\0:\0").is_err());
        assert!(parse("m.yaml", b"k: \xff").is_err());
        assert!(parse("m.yaml", &vec![b'#'; MAX_BYTES + 1]).is_err());
    }
}
