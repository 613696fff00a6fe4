//! Holds a parsed TOML value against the generated JSON Schema.
//!
//! Only the part of JSON Schema that our types produce is read: `$ref`, `type`,
//! `properties`, `required`, `additionalProperties: false`, `items`, `prefixItems`,
//! `minItems`, `maxItems`, lengths, `enum`, `const`, `oneOf`/`anyOf` and numeric bounds.
//! On top of it, every number must be finite.

use serde_json::Value as Json;
use toml::Value as Toml;

/// One violation, with the path of the value at fault.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Violation {
    /// Keys and indices from the root, e.g. `["map", "disc", "0", "radius_m"]`.
    pub path: Vec<String>,
    /// The fault is in the key itself (unknown), not in its value.
    pub at_key: bool,
    /// What was found.
    pub message: String,
    /// What would do.
    pub help: Option<String>,
}

/// First violation of `value` against `schema`, in document order, or `None`.
pub(super) fn check(schema: &Json, value: &Toml) -> Option<Violation> {
    let mut walker = Walker {
        root: schema,
        path: Vec::new(),
    };
    walker.value(schema, value).err()
}

/// A number that has to be more than its limit exceeds it by this at least: nothing that has a mass weighs a
/// microgram, and numbers near the smallest there are divide into infinities.
const POSITIVE: f64 = 1e-9;

struct Walker<'a> {
    root: &'a Json,
    path: Vec<String>,
}

type Checked = Result<(), Violation>;

impl<'a> Walker<'a> {
    fn value(&mut self, schema: &'a Json, value: &Toml) -> Checked {
        let schema = self.resolve(schema);
        if let Some(choices) = schema.get("anyOf").or_else(|| schema.get("oneOf"))
            && let Some(choices) = choices.as_array()
        {
            return self.any_of(choices, value);
        }
        if let Some(names) = schema.get("enum").and_then(Json::as_array) {
            return self.one_of_names(names.iter().filter_map(Json::as_str).collect(), value);
        }
        self.type_of(schema, value)?;
        match value {
            Toml::Float(number) => self.number(schema, *number, &format!("{number:?}")),
            Toml::Integer(number) => self.number(schema, *number as f64, &number.to_string()),
            Toml::String(text) => self.length(
                schema,
                "minLength",
                "maxLength",
                text.chars().count(),
                "characters",
            ),
            Toml::Array(items) => self.array(schema, items),
            Toml::Table(table) => self.table(schema, table),
            _ => Ok(()),
        }
    }

    /// Follows `$ref` (also inside a one-element `allOf`) to the definition.
    fn resolve(&self, mut schema: &'a Json) -> &'a Json {
        // The chain is short; the bound only guards against a circular schema.
        for _ in 0..16 {
            let Some(reference) = schema.get("$ref").and_then(Json::as_str) else {
                return schema;
            };
            let pointer = reference.trim_start_matches('#');
            match self.root.pointer(pointer) {
                Some(target) => schema = target,
                None => return schema,
            }
        }
        schema
    }

    fn any_of(&mut self, choices: &'a [Json], value: &Toml) -> Checked {
        if let Some(tag) = self.tag_of(choices) {
            return self.tagged(&tag, choices, value);
        }
        // A string enumeration is a list of constants; name them all.
        let constants: Vec<&str> = choices
            .iter()
            .map(|choice| self.resolve(choice))
            .flat_map(|choice| {
                choice
                    .get("const")
                    .into_iter()
                    .chain(
                        choice
                            .get("enum")
                            .and_then(Json::as_array)
                            .into_iter()
                            .flatten(),
                    )
                    .filter_map(Json::as_str)
                    .collect::<Vec<_>>()
            })
            .collect();
        let others: Vec<&Json> = choices
            .iter()
            .map(|choice| self.resolve(choice))
            .filter(|choice| {
                choice.get("const").is_none()
                    && choice.get("enum").is_none()
                    && choice.get("type").and_then(Json::as_str) != Some("null")
            })
            .collect();
        if others.is_empty() {
            return self.one_of_names(constants, value);
        }
        // Of several kinds of value, what is wrong is told for the kind that was given.
        let depth = self.path.len();
        let (mut first, mut of_this_kind) = (None, None);
        for choice in others {
            let is_this_kind = self.type_of(choice, value).is_ok();
            match self.value(choice, value) {
                Ok(()) => return Ok(()),
                Err(violation) if is_this_kind => of_this_kind = of_this_kind.or(Some(violation)),
                Err(violation) => first = first.or(Some(violation)),
            }
            self.path.truncate(depth);
        }
        let first = of_this_kind.or(first);
        if value.as_str().is_some_and(|text| constants.contains(&text)) {
            return Ok(());
        }
        first.map_or(Ok(()), Err)
    }

    /// The key that tells the choices apart: a constant, and another one, in each of them.
    fn tag_of(&self, choices: &'a [Json]) -> Option<String> {
        let first = self.resolve(choices.first()?);
        let (tag, _) = first
            .get("properties")?
            .as_object()?
            .iter()
            .find(|(_, property)| property.get("const").is_some())?;
        choices
            .iter()
            .all(|choice| self.constant(choice, tag).is_some())
            .then(|| tag.clone())
    }

    /// The constant that this choice has at `tag`.
    fn constant(&self, choice: &'a Json, tag: &str) -> Option<&'a str> {
        self.resolve(choice)
            .get("properties")?
            .get(tag)?
            .get("const")?
            .as_str()
    }

    /// One of several kinds of table, told apart by `tag`: what is wrong is told for the kind that was named.
    fn tagged(&mut self, tag: &str, choices: &'a [Json], value: &Toml) -> Checked {
        let names: Vec<&str> = choices
            .iter()
            .filter_map(|choice| self.constant(choice, tag))
            .collect();
        let Some(table) = value.as_table() else {
            return self.fail(
                format!("{} is {}", self.key(), describe(value)),
                format!("it takes a table with the key `{tag}`"),
            );
        };
        let Some(named) = table.get(tag) else {
            return self.fail(
                format!("{} has no `{tag}`", self.section()),
                format!("add `{tag} = …`: it may be {}", quoted_list(&names)),
            );
        };
        self.path.push(tag.to_owned());
        self.one_of_names(names, named)?;
        self.path.pop();
        let chosen = choices
            .iter()
            .find(|choice| self.constant(choice, tag) == named.as_str());
        let Some(chosen) = chosen else {
            return Ok(());
        };
        let checked = self.table(self.resolve(chosen), table);
        checked.map_err(|violation| self.known_elsewhere(violation, tag, choices))
    }

    /// An unknown key that another kind knows is told so.
    fn known_elsewhere(&self, violation: Violation, tag: &str, choices: &'a [Json]) -> Violation {
        let (true, Some(key)) = (violation.at_key, violation.path.last()) else {
            return violation;
        };
        let kinds: Vec<&str> = choices
            .iter()
            .filter(|choice| {
                self.resolve(choice)
                    .get("properties")
                    .is_some_and(|known| known.get(key).is_some())
            })
            .filter_map(|choice| self.constant(choice, tag))
            .collect();
        if kinds.is_empty() {
            return violation;
        }
        let help = format!("`{key}` belongs to {tag} = {}", quoted_list(&kinds));
        Violation {
            help: Some(help),
            ..violation
        }
    }

    fn one_of_names(&self, names: Vec<&str>, value: &Toml) -> Checked {
        let list = || quoted_list(&names);
        match value.as_str() {
            Some(text) if names.contains(&text) => Ok(()),
            Some(text) => {
                let help = match nearest(text, names.iter().copied()) {
                    Some(name) => format!("did you mean \"{name}\"? It may be {}", list()),
                    None => format!("it may be {}", list()),
                };
                self.fail(format!("{} is \"{text}\"", self.key()), help)
            }
            None => self.fail(
                format!("{} is {}", self.key(), describe(value)),
                format!("it may be {}", list()),
            ),
        }
    }

    fn type_of(&self, schema: &Json, value: &Toml) -> Checked {
        let allowed: Vec<&str> = match schema.get("type") {
            Some(Json::String(name)) => vec![name.as_str()],
            Some(Json::Array(names)) => names.iter().filter_map(Json::as_str).collect(),
            _ => return Ok(()),
        };
        let fits = allowed.iter().any(|name| match *name {
            "number" => matches!(value, Toml::Float(_) | Toml::Integer(_)),
            "integer" => matches!(value, Toml::Integer(_)),
            "string" => matches!(value, Toml::String(_)),
            "boolean" => matches!(value, Toml::Boolean(_)),
            "array" => matches!(value, Toml::Array(_)),
            "object" => matches!(value, Toml::Table(_)),
            _ => false,
        });
        if fits {
            return Ok(());
        }
        let wanted = allowed
            .iter()
            .find(|name| **name != "null")
            .copied()
            .unwrap_or("another type");
        let wanted = match wanted {
            "number" => "a number",
            "integer" => "a whole number",
            "string" => "a string in quotes",
            "boolean" => "true or false",
            "array" => "a list in [ ]",
            "object" => "a section of its own",
            other => other,
        };
        let unit = unit_of(self.path.last().map_or("", String::as_str));
        self.fail(
            format!("{} is {}", self.key(), describe(value)),
            format!("it takes {wanted}{unit}"),
        )
    }

    fn number(&self, schema: &Json, number: f64, shown: &str) -> Checked {
        let bound = |key: &str| schema.get(key).and_then(Json::as_f64);
        let (min, max) = (bound("minimum"), bound("maximum"));
        let (above, below) = (bound("exclusiveMinimum"), bound("exclusiveMaximum"));
        let inside = number.is_finite()
            && min.is_none_or(|limit| number >= limit)
            && max.is_none_or(|limit| number <= limit)
            && above.is_none_or(|limit| number >= limit + POSITIVE)
            && below.is_none_or(|limit| number < limit);
        if inside {
            return Ok(());
        }
        let unit = unit_of(
            self.path
                .iter()
                .rev()
                .find(|part| part.parse::<usize>().is_err())
                .map_or("", String::as_str),
        );
        let range = match (min.filter(|_| above.is_none()), above, below, max) {
            (Some(only), _, None, Some(most)) if only == most => format!("it takes {only}"),
            (Some(least), _, None, Some(most)) => {
                format!("it takes a number from {least} to {most}{unit}")
            }
            (least, above, below, most) => {
                let lower = above
                    .map(|limit| format!("above {limit}"))
                    .or(least.map(|limit| format!("of at least {limit}")));
                let upper = below
                    .map(|limit| format!("below {limit}"))
                    .or(most.map(|limit| format!("at most {limit}")));
                let both = [lower, upper].into_iter().flatten().collect::<Vec<_>>();
                match both.is_empty() {
                    true => format!("it takes a finite number{unit}"),
                    false => format!("it takes a number {}{unit}", both.join(" and ")),
                }
            }
        };
        let problem = if above.is_some_and(|limit| number > limit && number < limit + POSITIVE) {
            "too small to count"
        } else if number.is_finite() {
            "out of range"
        } else {
            "not a finite number"
        };
        self.fail(format!("{} is {shown}, {problem}", self.key()), range)
    }

    fn length(&self, schema: &Json, min: &str, max: &str, found: usize, what: &str) -> Checked {
        let bound = |key: &str| {
            schema
                .get(key)
                .and_then(Json::as_u64)
                .map(|limit| limit as usize)
        };
        let (least, most) = (bound(min), bound(max));
        if least.is_none_or(|limit| found >= limit) && most.is_none_or(|limit| found <= limit) {
            return Ok(());
        }
        let range = match (least, most) {
            (Some(least), Some(most)) if least == most => format!("exactly {least}"),
            (Some(least), Some(most)) => format!("{least} to {most}"),
            (Some(least), None) => format!("at least {least}"),
            (None, Some(most)) => format!("at most {most}"),
            (None, None) => return Ok(()),
        };
        self.fail(
            format!("{} has {found} {what}", self.key()),
            format!("it takes {range} {what}"),
        )
    }

    fn array(&mut self, schema: &'a Json, items: &[Toml]) -> Checked {
        self.length(schema, "minItems", "maxItems", items.len(), "entries")?;
        let prefix = schema.get("prefixItems").and_then(Json::as_array);
        for (index, item) in items.iter().enumerate() {
            let Some(item_schema) = prefix
                .and_then(|list| list.get(index))
                .or_else(|| schema.get("items"))
            else {
                continue;
            };
            self.path.push(index.to_string());
            self.value(item_schema, item)?;
            self.path.pop();
        }
        Ok(())
    }

    fn table(&mut self, schema: &'a Json, table: &toml::Table) -> Checked {
        let properties = schema.get("properties").and_then(Json::as_object);
        for (key, value) in table {
            self.path.push(key.clone());
            match properties.and_then(|known| known.get(key)) {
                Some(property) => self.value(property, value)?,
                None => return Err(self.unknown(key, properties)),
            }
            self.path.pop();
        }
        for required in schema
            .get("required")
            .and_then(Json::as_array)
            .into_iter()
            .flatten()
        {
            let Some(name) = required.as_str() else {
                continue;
            };
            if !table.contains_key(name) {
                let place = if self.path.is_empty() {
                    "the scenario".to_owned()
                } else {
                    self.section()
                };
                let what = properties
                    .and_then(|known| known.get(name))
                    .and_then(|property| property.get("description"))
                    .and_then(Json::as_str)
                    .and_then(|text| text.lines().next())
                    .unwrap_or_default();
                return self.fail(
                    format!("{place} has no `{name}`"),
                    format!("add `{name} = …`: {what}"),
                );
            }
        }
        Ok(())
    }

    fn unknown(&self, key: &str, properties: Option<&serde_json::Map<String, Json>>) -> Violation {
        let names: Vec<&str> = properties
            .into_iter()
            .flatten()
            .map(|(name, _)| name.as_str())
            .collect();
        let place = if self.path.len() <= 1 {
            "at the top of the scenario".to_owned()
        } else {
            let parent = Self {
                root: self.root,
                path: self.path[..self.path.len() - 1].to_vec(),
            };
            format!("in {}", parent.section())
        };
        let known = || {
            let mut names = names.clone();
            names.sort_unstable();
            names.join(", ")
        };
        let help = match nearest(key, names.iter().copied()) {
            Some(name) => format!("did you mean `{name}`?"),
            None => format!("known keys: {}", known()),
        };
        Violation {
            path: self.path.clone(),
            at_key: true,
            message: format!("unknown key `{key}` {place}"),
            help: Some(help),
        }
    }

    fn fail(&self, message: String, help: String) -> Checked {
        Err(Violation {
            path: self.path.clone(),
            at_key: false,
            message,
            help: Some(help),
        })
    }

    fn key(&self) -> String {
        format!("`{}`", self.path.join("."))
    }

    /// `[section]`, or `[[section]]` entry by number, as it stands in the file.
    fn section(&self) -> String {
        match self.path.split_last() {
            Some((last, rest)) if last.parse::<usize>().is_ok() => {
                let number = last.parse::<usize>().map_or(0, |index| index + 1);
                format!("[[{}]] number {number}", rest.join("."))
            }
            _ => format!("[{}]", self.path.join(".")),
        }
    }
}

/// The unit a key's ending promises, for messages.
fn unit_of(key: &str) -> &'static str {
    const UNITS: [(&str, &str); 15] = [
        ("_per_m", " (1/m)"),
        ("_kgm2", " (kg m²)"),
        ("_mps2", " (m/s²)"),
        ("_radps", " (rad/s)"),
        ("_mps", " (m/s)"),
        ("_deg", " (degrees)"),
        ("_rad", " (radians)"),
        ("_nm", " (N m)"),
        ("_ns", " (N s)"),
        ("_hz", " (Hz)"),
        ("_per_s", " (1/s)"),
        ("_kg", " (kg)"),
        ("_m", " (m)"),
        ("_s", " (s)"),
        ("_n", " (N)"),
    ];
    UNITS
        .iter()
        .find(|(ending, _)| key.ends_with(ending))
        .map_or("", |(_, unit)| unit)
}

fn describe(value: &Toml) -> String {
    match value {
        Toml::String(text) if text.chars().count() <= 40 => format!("the string \"{text}\""),
        Toml::String(_) => "a string".into(),
        Toml::Integer(number) => format!("the whole number {number}"),
        Toml::Float(number) => format!("the number {number:?}"),
        Toml::Boolean(truth) => format!("{truth}"),
        Toml::Datetime(_) => "a date".into(),
        Toml::Array(_) => "a list".into(),
        Toml::Table(_) => "a table".into(),
    }
}

fn quoted_list(names: &[&str]) -> String {
    names
        .iter()
        .map(|name| format!("\"{name}\""))
        .collect::<Vec<_>>()
        .join(", ")
}

/// `max_speed` for `max_speed_mps`: right, but for the unit that belongs to the name.
fn lacks_only_its_unit(typed: &str, name: &str) -> bool {
    name.strip_prefix(typed).is_some_and(|rest| {
        rest.starts_with('_') && !unit_of(rest).is_empty() && !rest[1..].contains("max")
    })
}

/// The known name a typing slip most likely meant: least edit distance, at most a third of its length.
pub(super) fn nearest<'n>(typed: &str, names: impl Iterator<Item = &'n str>) -> Option<&'n str> {
    let typed_lower = typed.to_lowercase();
    names
        .map(|name| (strsim::damerau_levenshtein(&typed_lower, name), name))
        .filter(|(distance, name)| {
            *distance <= 2.max(name.len() / 3)
                || (typed.len() >= 4 && name.starts_with(typed_lower.as_str()))
                || lacks_only_its_unit(&typed_lower, name)
        })
        .min_by_key(|(distance, name)| (!lacks_only_its_unit(&typed_lower, name), *distance, *name))
        .map(|(_, name)| name)
}
