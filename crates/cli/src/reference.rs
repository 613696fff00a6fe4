//! The reference of scenario files as Markdown: every section, key, type, range, default and meaning, from the same
//! JSON Schema that files are checked against. `docs/scenario-reference.md` is this text.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use serde_json::{Map, Value};

const HEAD: &str = "\
# Scenario reference

<!-- Made by `bikebot schema --format markdown`; a test compares the two. -->

Every key of a scenario file (format 1), as the program itself knows it. What it is all about stands in
[Scenarios, recordings, exit codes](scenarios.md); `bikebot explain FILE` prints these keys with the values of one file.
Where no default is named a key may be left out, and its description says what then holds.
";

/// The whole page.
pub fn markdown(schema: &Value) -> String {
    let page = Page { schema };
    let mut text = HEAD.to_owned();
    let sections = properties(schema);
    let (plain, tables): (Vec<_>, Vec<_>) = sections
        .iter()
        .partition(|(_, value)| page.table(value).is_none());
    text.push_str("\n## At the top\n\n");
    let required = required(schema);
    page.keys(&mut text, plain.into_iter(), &required);
    let mut kinds = BTreeSet::new();
    for (name, value) in tables {
        page.section(&mut text, name, value, &mut kinds);
    }
    text
}

struct Page<'a> {
    schema: &'a Value,
}

impl<'a> Page<'a> {
    /// What a `$ref` names, else the value itself; `anyOf` with null is what may be left out.
    fn resolved(&self, value: &'a Value) -> &'a Value {
        if let Some(name) = value["$ref"].as_str() {
            let definition = &self.schema["$defs"][name.trim_start_matches("#/$defs/")];
            return self.resolved(definition);
        }
        match value["anyOf"].as_array() {
            Some(either) => either
                .iter()
                .find(|one| one["type"] != "null")
                .map_or(value, |one| self.resolved(one)),
            None => value,
        }
    }

    /// The table, or the entries of the list of tables, that a value is.
    fn table(&self, value: &'a Value) -> Option<&'a Value> {
        let value = self.resolved(value);
        let is_table = |value: &Value| {
            value["properties"].is_object()
                || value["oneOf"]
                    .as_array()
                    .is_some_and(|kinds| kinds.iter().all(|kind| kind["properties"].is_object()))
        };
        if is_table(value) {
            return Some(value);
        }
        let items = self.resolved(&value["items"]);
        is_table(items).then_some(items)
    }

    fn section(
        &self,
        text: &mut String,
        name: &str,
        value: &'a Value,
        told: &mut BTreeSet<String>,
    ) {
        let Some(table) = self.table(value) else {
            return;
        };
        let is_list = self.resolved(value)["items"].is_object();
        let title = if is_list {
            format!("[[{name}]]")
        } else {
            format!("[{name}]")
        };
        let _ = writeln!(text, "\n## `{title}`\n");
        let about = [value, table]
            .into_iter()
            .find_map(|it| it["description"].as_str());
        if let Some(about) = about {
            let _ = writeln!(text, "{}\n", one_line(about));
        }
        // Two sections of the same keys: the second says so.
        if let Some(twin) = self.name(value) {
            let twin_key = format!("{twin} in full");
            if !told.insert(twin_key) {
                let _ = writeln!(text, "Its keys are those of the other `{twin}`, above.");
                return;
            }
        }
        match table["oneOf"].as_array() {
            Some(kinds) => {
                for kind in kinds {
                    let tag = properties(kind)
                        .into_iter()
                        .find_map(|(key, value)| Some((key, value["const"].as_str()?)));
                    if let Some((key, tag)) = tag {
                        let _ = writeln!(text, "### `{key} = \"{tag}\"`\n");
                    }
                    if let Some(about) = kind["description"].as_str() {
                        let _ = writeln!(text, "{}\n", one_line(about));
                    }
                    let keys = properties(kind);
                    let keys = keys.iter().filter(|(_, value)| value["const"].is_null());
                    self.keys(text, keys, &required(kind));
                    text.push('\n');
                }
                text.truncate(text.trim_end().len());
                text.push('\n');
            }
            None => {
                let keys = properties(table);
                let (inner, plain): (Vec<_>, Vec<_>) = keys
                    .iter()
                    .partition(|(_, value)| self.table(value).is_some());
                if !plain.is_empty() {
                    self.keys(text, plain.into_iter(), &required(table));
                }
                for (key, value) in inner {
                    self.section(text, &format!("{name}.{key}"), value, told);
                }
            }
        }
    }

    /// The name of the type, where it is that of several sections.
    fn name(&self, value: &'a Value) -> Option<&'a str> {
        let name = value["$ref"].as_str()?.trim_start_matches("#/$defs/");
        match self.schema["$defs"][name]["$ref"].as_str() {
            Some(inner) => Some(inner.trim_start_matches("#/$defs/")),
            None => Some(name),
        }
    }

    fn keys<'k>(
        &self,
        text: &mut String,
        keys: impl Iterator<Item = &'k (&'a str, &'a Value)>,
        required: &BTreeSet<&str>,
    ) where
        'a: 'k,
    {
        for (key, value) in keys {
            let resolved = self.resolved(value);
            let default = match &value["default"] {
                Value::Null if required.contains(key) => ", required".to_owned(),
                Value::Null => String::new(),
                default => format!(", default `{}`", toml(default)),
            };
            let _ = writeln!(text, "* **`{key}`**: {}{default}", self.takes(value));
            let is = [*value, resolved]
                .into_iter()
                .find_map(|it| it["description"].as_str())
                .map(one_line);
            if let Some(is) = is {
                let _ = writeln!(text, "  <br>{is}");
            }
            let choices = resolved["oneOf"].as_array().into_iter().flatten();
            for choice in choices {
                let about = choice["description"].as_str().map(one_line);
                if let Some(name) = choice["const"].as_str() {
                    let about = about.map(|about| format!(": {about}")).unwrap_or_default();
                    let _ = writeln!(text, "  * `\"{name}\"`{about}");
                }
            }
        }
    }

    /// The type of a value and its range, in a few words.
    fn takes(&self, value: &'a Value) -> String {
        let value = self.resolved(value);
        if let Some(choices) = value["oneOf"].as_array().or(value["anyOf"].as_array()) {
            if choices.iter().all(|choice| choice["const"].is_string()) {
                return "one of these".into();
            }
            let of = choices.iter().map(|choice| match choice["const"].as_str() {
                Some(name) => format!("`\"{name}\"`"),
                None => self.takes(choice),
            });
            return of.collect::<Vec<_>>().join(", ");
        }
        if let Some(choices) = value["enum"].as_array() {
            let of = choices.iter().map(|choice| format!("`{}`", toml(choice)));
            return of.collect::<Vec<_>>().join(", ");
        }
        let name = match &value["type"] {
            Value::String(name) => name.as_str(),
            Value::Array(names) => names
                .iter()
                .filter_map(Value::as_str)
                .find(|name| *name != "null")
                .unwrap_or("anything"),
            _ => "anything",
        };
        match name {
            "number" | "integer"
                if value["minimum"].is_number() && value["minimum"] == value["maximum"] =>
            {
                number(&value["minimum"])
            }
            "number" | "integer" => {
                let kind = if name == "integer" {
                    "whole number"
                } else {
                    "number"
                };
                format!("{kind}{}", range(value))
            }
            "boolean" => "`true`, `false`".into(),
            "string" => "text".into(),
            "array" => {
                let least = value["minItems"].as_u64();
                let most = value["maxItems"].as_u64();
                let count = match (least, most) {
                    (Some(least), Some(most)) if least == most => format!(" of {least}"),
                    _ => String::new(),
                };
                let items = self.resolved(&value["items"]);
                let each = if items.is_object() {
                    format!(", each: {}", self.takes(items))
                } else {
                    String::new()
                };
                format!("list{count}{each}")
            }
            "object" => "table".into(),
            other => other.into(),
        }
    }
}

/// `, 0 to 10`, `, above 0 up to 5`.
fn range(value: &Value) -> String {
    let least = match (&value["minimum"], &value["exclusiveMinimum"]) {
        (_, above) if above.is_number() => format!("above {}", number(above)),
        (least, _) if least.is_number() => format!("from {}", number(least)),
        _ => String::new(),
    };
    let most = match (&value["maximum"], &value["exclusiveMaximum"]) {
        (_, below) if below.is_number() => format!("below {}", number(below)),
        (most, _) if most.is_number() => format!("to {}", number(most)),
        _ => String::new(),
    };
    match (least.is_empty(), most.is_empty()) {
        (true, true) => String::new(),
        (false, true) => format!(" {least}"),
        (true, false) => format!(" {most}"),
        (false, false) => format!(" {least} {most}"),
    }
}

/// A bound as people write it.
fn number(value: &Value) -> String {
    match value.as_f64() {
        Some(number) if number.abs() >= 1e7 => format!("{number:e}"),
        Some(number) => format!("{number}"),
        None => value.to_string(),
    }
}

/// A value as it stands in a scenario.
fn toml(value: &Value) -> String {
    match value {
        Value::Array(items) => {
            format!(
                "[{}]",
                items.iter().map(toml).collect::<Vec<_>>().join(", ")
            )
        }
        other => other.to_string(),
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn required(value: &Value) -> BTreeSet<&str> {
    let names = value["required"].as_array().into_iter().flatten();
    names.filter_map(Value::as_str).collect()
}

fn properties(value: &Value) -> Vec<(&str, &Value)> {
    let map: Option<&Map<String, Value>> = value["properties"].as_object();
    map.into_iter()
        .flatten()
        .map(|(key, value)| (key.as_str(), value))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_of_the_book_is_what_the_program_knows() {
        let now = markdown(&bikebot_sim::json_schema());
        let page = include_str!("../../../docs/scenario-reference.md");
        assert!(
            now == page,
            "docs/scenario-reference.md is stale: make it anew by `bikebot schema --format markdown > docs/scenario-reference.md`"
        );
    }

    #[test]
    fn every_key_of_the_template_is_on_the_page() {
        let page = markdown(&bikebot_sim::json_schema());
        let file =
            bikebot_sim::ScenarioFile::parse(include_str!("../templates/scenario.toml"), &[])
                .unwrap();
        let rows = file.explain();
        assert!(rows.len() > 100);
        for row in rows {
            let last = row.key.rsplit('.').next().unwrap();
            // Entries of a list are numbered.
            let is_number = last.parse::<usize>().is_ok();
            assert!(
                is_number || page.contains(&format!("* **`{last}`**: ")),
                "{} is not on the page",
                row.key
            );
        }
    }

    #[test]
    fn ranges_are_told() {
        let told = |text: &str| range(&serde_json::from_str(text).unwrap());
        assert_eq!(told(r#"{"minimum": 0, "maximum": 2.5}"#), " from 0 to 2.5");
        assert_eq!(told(r#"{"exclusiveMinimum": 0.0}"#), " above 0");
        assert_eq!(told("{}"), "");
    }
}
