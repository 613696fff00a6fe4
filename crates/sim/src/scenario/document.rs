//! From text and overrides to a [`Scenario`], remembering where each value came from.

use super::schema_check::{self, Violation};
use super::{MAX_SCENARIO_BYTES, Scenario, json_schema};
use bikebot_dynamics::BikeParams;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;
use std::str::FromStr;
use std::sync::OnceLock;
use toml::de::{DeTable, DeValue};

/// `key.path=value` from the command line; the value has TOML syntax and falls back to a string.
#[derive(Debug, Clone, PartialEq)]
pub struct Override {
    /// Dotted key, e.g. `follow.max_speed_mps`; list entries by number from 0.
    pub key: String,
    /// The value as typed.
    pub value: String,
}

impl Override {
    /// An override whose value is already TOML.
    #[must_use]
    pub fn new(key: impl Into<String>, value: impl fmt::Display) -> Self {
        Self {
            key: key.into(),
            value: value.to_string(),
        }
    }

    fn parsed(&self) -> toml::Value {
        let text = format!("value = {}", self.value);
        match toml::from_str::<toml::Table>(&text) {
            Ok(mut table) if table.len() == 1 => table
                .remove("value")
                .unwrap_or_else(|| toml::Value::String(self.value.clone())),
            _ => toml::Value::String(self.value.clone()),
        }
    }
}

impl FromStr for Override {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wanted = "write it as key.path=value, for example follow.max_speed_mps=2.0";
        let (key, value) = text
            .split_once('=')
            .ok_or_else(|| format!("`{text}` has no `=`; {wanted}"))?;
        let (key, value) = (key.trim(), value.trim());
        if key.is_empty() || key.split('.').any(|part| part.trim().is_empty()) {
            return Err(format!("`{text}` has an empty key; {wanted}"));
        }
        if value.is_empty() {
            return Err(format!("`{text}` has no value; {wanted}"));
        }
        Ok(Self::new(key, value))
    }
}

impl fmt::Display for Override {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.key, self.value)
    }
}

/// Where a resolved value came from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// Written in the file, at this line (counted from 1).
    Line(usize),
    /// Given by `--set` or `--seed`.
    Override,
    /// A default of the program.
    Default,
    /// A value of this named parameter set.
    Preset(String),
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line}"),
            Self::Override => f.write_str("--set"),
            Self::Default => f.write_str("default"),
            Self::Preset(name) => write!(f, "preset {name}"),
        }
    }
}

/// One value of the resolved scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Explained {
    /// Dotted key.
    pub key: String,
    /// The value in TOML syntax.
    pub value: String,
    /// Where it came from.
    pub origin: Origin,
}

/// Why a scenario was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{message}")]
pub struct ScenarioError {
    /// What was found.
    pub message: String,
    /// Dotted key at fault, where there is one.
    pub key: Option<String>,
    /// Bytes of the file's text at fault, where it is the file.
    pub span: Option<Range<usize>>,
    /// The override at fault, where it is one.
    pub from_override: Option<String>,
    /// What would do.
    pub help: Option<String>,
}

impl ScenarioError {
    pub(crate) fn plain(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            key: None,
            span: None,
            from_override: None,
            help: Some(help.into()),
        }
    }
}

/// A scenario with the text it came from.
#[derive(Debug, Clone, PartialEq)]
pub struct ScenarioFile {
    /// The scenario, defaults filled.
    pub scenario: Scenario,
    text: String,
    /// What the file and the overrides say together, before defaults.
    written: toml::Table,
    overridden: Vec<String>,
}

impl ScenarioFile {
    /// Reads a scenario.
    ///
    /// # Errors
    ///
    /// The first thing that is wrong: syntax, unknown keys (with the nearest known one named), wrong
    /// types, numbers out of range or not finite, missing keys; with the place in the text or the
    /// override at fault.
    pub fn parse(text: &str, overrides: &[Override]) -> Result<Self, ScenarioError> {
        if text.len() > MAX_SCENARIO_BYTES {
            return Err(ScenarioError::plain(
                format!("the scenario has {} bytes", text.len()),
                format!(
                    "a scenario has at most {MAX_SCENARIO_BYTES} bytes; is this the right file?"
                ),
            ));
        }
        let mut written: toml::Table =
            toml::from_str(text).map_err(|error| not_toml(text, &error))?;
        let mut overridden = Vec::new();
        for change in overrides {
            set(&mut written, change)?;
            overridden.push(change.key.clone());
        }
        let mut file = Self {
            scenario: Scenario::placeholder(),
            text: text.to_owned(),
            written,
            overridden,
        };
        if let Some(violation) =
            schema_check::check(schema(), &toml::Value::Table(file.written.clone()))
        {
            return Err(file.locate(violation));
        }
        let mut resolved = file.written.clone();
        file.fill_preset(&mut resolved)?;
        file.scenario = Scenario::deserialize_table(resolved).map_err(|message| ScenarioError {
            message,
            key: None,
            span: None,
            from_override: None,
            help: None,
        })?;
        if !file.is_written("plant.step_s") {
            file.scenario.plant.step_s = file.scenario.plant.model.default_step();
        }
        Ok(file)
    }

    /// The text of the file, as given.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The scenario as TOML with the overrides applied: what a recording carries.
    #[must_use]
    pub fn text_after_overrides(&self) -> String {
        if self.overridden.is_empty() {
            self.text.clone()
        } else {
            // A table that was parsed from TOML (or built from parsed values) always serialises.
            toml::to_string_pretty(&self.written).unwrap_or_else(|_| self.text.clone())
        }
    }

    /// Keys given by overrides, in the order given.
    #[must_use]
    pub fn overridden(&self) -> &[String] {
        &self.overridden
    }

    /// Whether the file or an override says anything about this dotted key.
    #[must_use]
    pub fn is_written(&self, key: &str) -> bool {
        let mut parts = key.split('.');
        let first = parts.next().and_then(|part| self.written.get(part));
        parts
            .try_fold(first, |value, part| match value {
                Some(toml::Value::Table(table)) => Some(table.get(part)),
                _ => None,
            })
            .flatten()
            .is_some()
    }

    /// Every value of the resolved scenario with its origin, in the order of the file format.
    #[must_use]
    pub fn explain(&self) -> Vec<Explained> {
        let mut rows = Vec::new();
        if let Ok(table) = toml::Table::try_from(&self.scenario) {
            let places = self.places();
            flatten("", &toml::Value::Table(table), &mut |key, value| {
                rows.push(Explained {
                    key: key.to_owned(),
                    value: value.to_string(),
                    origin: self.origin(key, &places),
                });
            });
        }
        rows
    }

    /// A diagnostic for a value that is in range but makes no sense in its context.
    #[must_use]
    pub fn error_at(
        &self,
        key: &str,
        message: impl Into<String>,
        help: impl Into<String>,
    ) -> ScenarioError {
        let mut error = self.locate(Violation {
            path: key.split('.').map(str::to_owned).collect(),
            at_key: false,
            message: message.into(),
            help: Some(help.into()),
        });
        error.key = Some(key.to_owned());
        error
    }

    fn origin(&self, key: &str, places: &BTreeMap<String, Place>) -> Origin {
        let is_above = |prefix: &str| key == prefix || key.starts_with(&format!("{prefix}."));
        if self.overridden.iter().any(|prefix| is_above(prefix)) {
            return Origin::Override;
        }
        let mut part = key;
        loop {
            if let Some(place) = places.get(part) {
                if part == key || place.is_leaf {
                    return Origin::Line(line_of(&self.text, place.value.start));
                }
                break;
            }
            match part.rsplit_once('.') {
                Some((shorter, _)) => part = shorter,
                None => break,
            }
        }
        let is_bike_parameter = key.strip_prefix("bike.").is_some_and(|name| {
            name != "preset" && name != "mode" && !name.starts_with("mode_change")
        });
        if is_bike_parameter {
            Origin::Preset(self.scenario.bike.preset.clone())
        } else {
            Origin::Default
        }
    }

    /// Values of a named parameter set stand wherever `[bike]` says nothing itself.
    fn fill_preset(&self, resolved: &mut toml::Table) -> Result<(), ScenarioError> {
        let Some(bike) = resolved.get_mut("bike").and_then(toml::Value::as_table_mut) else {
            return Ok(());
        };
        let name = bike
            .get("preset")
            .and_then(toml::Value::as_str)
            .unwrap_or("default")
            .to_owned();
        let Some(preset) = BikeParams::preset(&name) else {
            let known = BikeParams::PRESETS
                .map(|name| format!("\"{name}\""))
                .join(", ");
            return Err(self.error_at(
                "bike.preset",
                format!("`bike.preset` is \"{name}\", which is no parameter set"),
                format!("it may be {known}"),
            ));
        };
        if let Ok(values) = toml::Table::try_from(preset) {
            for (key, value) in values {
                bike.entry(key).or_insert(value);
            }
        }
        Ok(())
    }

    fn locate(&self, violation: Violation) -> ScenarioError {
        let key = violation.path.join(".");
        let is_above = |prefix: &str| key == prefix || key.starts_with(&format!("{prefix}."));
        let from_override = self
            .overridden
            .iter()
            .rev()
            .find(|prefix| is_above(prefix))
            .map(|prefix| format!("--set {prefix}"));
        let span = if from_override.is_some() {
            None
        } else {
            let places = self.places();
            let mut part = key.as_str();
            loop {
                if let Some(place) = places.get(part) {
                    let exact = part == key;
                    break Some(if exact && !violation.at_key || place.key.is_empty() {
                        place.value.clone()
                    } else {
                        place.key.clone()
                    });
                }
                match part.rsplit_once('.') {
                    Some((shorter, _)) => part = shorter,
                    None => break None,
                }
            }
        };
        ScenarioError {
            message: violation.message,
            key: (!key.is_empty()).then_some(key),
            span,
            from_override,
            help: violation.help,
        }
    }

    fn places(&self) -> BTreeMap<String, Place> {
        let mut places = BTreeMap::new();
        if let Ok(table) = DeTable::parse(&self.text) {
            place_table("", table.get_ref(), &mut places);
        }
        places
    }
}

impl Scenario {
    /// Stands in the file structure only until the text has been checked.
    fn placeholder() -> Self {
        Self {
            format: 1,
            name: String::new(),
            map: None,
            start: Default::default(),
            goal: None,
            bike: Default::default(),
            planner: Default::default(),
            path: None,
            follow: Default::default(),
            balance: Default::default(),
            supervisor: Default::default(),
            laser: Default::default(),
            mapper: Default::default(),
            online: Default::default(),
            obstacle: Vec::new(),
            plant: Default::default(),
            noise: Default::default(),
            disturbance: Vec::new(),
            run: Default::default(),
            record: Default::default(),
            expect: None,
        }
    }

    fn deserialize_table(table: toml::Table) -> Result<Self, String> {
        toml::Value::Table(table)
            .try_into()
            .map_err(|error: toml::de::Error| error.message().to_owned())
    }
}

/// Where a key and its value stand in the text, bytes.
#[derive(Debug, Clone)]
struct Place {
    key: Range<usize>,
    value: Range<usize>,
    is_leaf: bool,
}

fn place_table(prefix: &str, table: &DeTable<'_>, places: &mut BTreeMap<String, Place>) {
    for (key, value) in table {
        let path = join(prefix, key.get_ref());
        place_value(path, key.span(), value, places);
    }
}

fn place_value(
    path: String,
    key: Range<usize>,
    value: &toml::Spanned<DeValue<'_>>,
    places: &mut BTreeMap<String, Place>,
) {
    let is_leaf = match value.get_ref() {
        DeValue::Table(table) => {
            place_table(&path, table, places);
            false
        }
        DeValue::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                place_value(join(&path, &index.to_string()), 0..0, item, places);
            }
            true
        }
        _ => true,
    };
    places.insert(
        path,
        Place {
            key,
            value: value.span(),
            is_leaf,
        },
    );
}

fn join(prefix: &str, key: &str) -> String {
    if prefix.is_empty() {
        key.to_owned()
    } else {
        format!("{prefix}.{key}")
    }
}

/// Line of a byte offset, counted from 1.
fn line_of(text: &str, offset: usize) -> usize {
    text.as_bytes()[..offset.min(text.len())]
        .iter()
        .filter(|byte| **byte == b'\n')
        .count()
        + 1
}

/// Visits the leaves of a value; lists of tables are entered, other lists are leaves.
fn flatten(prefix: &str, value: &toml::Value, visit: &mut impl FnMut(&str, &toml::Value)) {
    match value {
        toml::Value::Table(table) => {
            for (key, value) in table {
                flatten(&join(prefix, key), value, visit);
            }
        }
        toml::Value::Array(items) if items.iter().any(toml::Value::is_table) => {
            for (index, item) in items.iter().enumerate() {
                flatten(&join(prefix, &index.to_string()), item, visit);
            }
        }
        leaf => visit(prefix, leaf),
    }
}

/// Applies one override, creating the sections on its way.
fn set(root: &mut toml::Table, change: &Override) -> Result<(), ScenarioError> {
    let refuse = |message: String, help: &str| ScenarioError {
        message,
        key: Some(change.key.clone()),
        span: None,
        from_override: Some(format!("--set {change}")),
        help: Some(help.to_owned()),
    };
    let mut parts: Vec<&str> = change.key.split('.').map(str::trim).collect();
    let Some(last) = parts.pop() else {
        return Err(refuse(
            "the key is empty".into(),
            "write it as key.path=value",
        ));
    };
    let mut seen = String::new();
    let mut node: Node<'_> = Node::Table(root);
    for part in parts {
        seen = join(&seen, part);
        let next = match node {
            Node::Table(table) => table
                .entry(part)
                .or_insert_with(|| toml::Value::Table(toml::Table::new())),
            Node::Array(items) => {
                let length = items.len();
                part.parse::<usize>()
                    .ok()
                    .and_then(|index| items.get_mut(index))
                    .ok_or_else(|| {
                        refuse(
                            format!("`{seen}` is not an entry of the list"),
                            &format!("it has entries 0 to {}", length.saturating_sub(1)),
                        )
                    })?
            }
        };
        node = match next {
            toml::Value::Table(table) => Node::Table(table),
            toml::Value::Array(items) => Node::Array(items),
            _ => {
                return Err(refuse(
                    format!("`{seen}` is a single value and has no key below it"),
                    "name an existing section",
                ));
            }
        };
    }
    match node {
        Node::Table(table) => {
            table.insert(last.to_owned(), change.parsed());
        }
        Node::Array(items) => {
            let length = items.len();
            match last
                .parse::<usize>()
                .ok()
                .and_then(|index| items.get_mut(index))
            {
                Some(item) => *item = change.parsed(),
                None => {
                    return Err(refuse(
                        format!("`{}` is not an entry of the list", change.key),
                        &format!("it has entries 0 to {}", length.saturating_sub(1)),
                    ));
                }
            }
        }
    }
    Ok(())
}

enum Node<'t> {
    Table(&'t mut toml::Table),
    Array(&'t mut Vec<toml::Value>),
}

fn schema() -> &'static serde_json::Value {
    static SCHEMA: OnceLock<serde_json::Value> = OnceLock::new();
    SCHEMA.get_or_init(json_schema)
}

/// What the TOML reader found, in our words where they say more than its own.
fn not_toml(text: &str, error: &toml::de::Error) -> ScenarioError {
    let span = error.span();
    let marked = span
        .clone()
        .and_then(|span| text.get(span))
        .unwrap_or_default();
    let (message, help) = match error.message().trim_end() {
        "duplicate key" => (
            format!("`{marked}` is given twice"),
            "keep one of them; the keys of a section stand together under one header",
        ),
        message => (
            message.to_owned(),
            "a scenario is TOML: `key = value` under `[section]` headers",
        ),
    };
    ScenarioError {
        message,
        key: None,
        span,
        from_override: None,
        help: Some(help.to_owned()),
    }
}

/// Serialises a parameter set into a table; used where one set is laid over another.
pub(crate) fn to_table<T: Serialize>(value: &T) -> toml::Table {
    toml::Table::try_from(value).unwrap_or_default()
}
