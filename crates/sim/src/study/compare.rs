//! The model ladder: one scenario over several plants and controllers, and what changes from one to the next.
//!
//! A column is one run: the scenario with `plant.model`, `follow.controller` and `balance.controller` set. Which names
//! there are is read off the scenario's schema, so a plant or a law that the scenario knows can be compared. A plant that
//! stands still (`two_link`) gets the scenario without its way: the same bike, lean, laws, noise and duration.

use crate::outcome::Metrics;
use crate::scenario::{Override, ScenarioError, ScenarioFile, json_schema};
use crate::sweep::{self, Case, RowResult, SharedRead, SweepError};
use serde::Serialize;
use serde_json::{Map, Value};

/// Most columns of one comparison.
pub const MAX_COLUMNS: usize = 1000;
/// The plant that stands still.
const STANDING: &str = "two_link";

/// What is compared, in the order of the table.
pub const COMPARED: [Quantity; 12] = [
    Quantity::new("time_s", "time, s", 1.0),
    Quantity::new("roll_max_deg", "roll max, °", 1.0),
    Quantity::new("balancer_torque_max_nm", "torque max, N m", 1.0),
    Quantity::new("balancer_torque_rms_nm", "torque rms, N m", 1.0),
    Quantity::new("balancer_speed_max_radps", "balancer max, rad/s", 1.0),
    Quantity::new("lateral_error_max_m", "own error max, mm", 1e3),
    Quantity::new("lateral_error_rms_m", "own error rms, mm", 1e3),
    Quantity::new("rear_error_max_m", "rear error max, mm", 1e3),
    Quantity::new("end_position_error_m", "end error, mm", 1e3),
    Quantity::new("wheel_load_min_n", "wheel load min, N", 1.0),
    Quantity::new("drive_work_j", "drive work, J", 1.0),
    Quantity::new("balancer_work_j", "balancer work, J", 1.0),
];

/// One row of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// The metric.
    pub metric: &'static str,
    /// What it is called in the table, with the unit it is shown in.
    pub label: &'static str,
    /// Shown units per unit of the metric.
    pub factor: f64,
}

impl Quantity {
    const fn new(metric: &'static str, label: &'static str, factor: f64) -> Self {
        Self {
            metric,
            label,
            factor,
        }
    }

    /// Its value among `metrics`, in the unit of the metric.
    #[must_use]
    pub fn of(&self, metrics: &Metrics) -> Option<f64> {
        let mut found = metrics.iter().filter(|(name, _)| *name == self.metric);
        found.next().map(|(_, value)| value)
    }
}

/// Names a scenario knows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Known {
    /// `plant.model`.
    pub plants: Vec<String>,
    /// `follow.controller`.
    pub followers: Vec<String>,
    /// `balance.controller`.
    pub balance_laws: Vec<String>,
}

impl Known {
    /// Reads them off the scenario's schema.
    #[must_use]
    pub fn from_schema() -> Self {
        let schema = json_schema();
        let of = |section, key| choices(&schema, section, key);
        Self {
            plants: of("plant", "model"),
            followers: of("follow", "controller"),
            balance_laws: of("balance", "controller"),
        }
    }
}

/// The values a key of a section may take.
fn choices(schema: &Value, section: &str, key: &str) -> Vec<String> {
    let key = resolved(schema, schema)
        .pointer(&format!("/properties/{section}"))
        .map(|section| resolved(schema, section))
        .and_then(|section| section.pointer(&format!("/properties/{key}")))
        .map(|key| resolved(schema, key));
    let Some(key) = key else {
        return Vec::new();
    };
    let texts = |list: &Value| -> Vec<String> {
        let list = list.as_array().map(Vec::as_slice).unwrap_or_default();
        list.iter()
            .flat_map(|item| match item {
                Value::String(name) => vec![name.clone()],
                item => {
                    let many = item.get("enum").and_then(Value::as_array);
                    let names = many.into_iter().flatten().chain(item.get("const"));
                    names
                        .filter_map(|name| name.as_str().map(str::to_owned))
                        .collect()
                }
            })
            .collect()
    };
    ["enum", "oneOf", "anyOf"]
        .into_iter()
        .filter_map(|list| key.get(list))
        .flat_map(texts)
        .collect()
}

/// A node of the schema, its reference followed.
fn resolved<'s>(schema: &'s Value, node: &'s Value) -> &'s Value {
    let mut node = node;
    // A schema does not nest references deeper than this; a circle would.
    for _ in 0..16 {
        let target = node.get("$ref").and_then(Value::as_str).or_else(|| {
            // A documented field wraps its reference.
            let all = node.get("allOf")?.as_array()?;
            all.first()?.get("$ref")?.as_str()
        });
        let Some(target) = target.and_then(|name| schema.pointer(name.trim_start_matches('#')))
        else {
            break;
        };
        node = target;
    }
    node
}

/// The two laws of a column; `None`: as the scenario says.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Controllers {
    /// `follow.controller`.
    pub follow: Option<String>,
    /// `balance.controller`.
    pub balance: Option<String>,
}

/// What cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// A name nobody knows.
    #[error("`{name}` is no {what}; known are {}", known.join(", "))]
    Unknown {
        /// As given.
        name: String,
        /// What it should have been.
        what: &'static str,
        /// What would do.
        known: Vec<String>,
    },
    /// A name that is a path follower and a balance law at once.
    #[error("`{0}` is a path follower and a balance law")]
    Ambiguous(String),
    /// The same twice.
    #[error("`{0}` is named twice")]
    Twice(String),
    /// One column.
    #[error("one plant and one pair of controllers leave nothing to compare")]
    Alone,
    /// Too many columns.
    #[error("{0} combinations are more than {MAX_COLUMNS}")]
    TooMany(usize),
    /// A scenario that cannot be run.
    #[error(transparent)]
    Sweep(#[from] SweepError),
}

impl From<ScenarioError> for CompareError {
    fn from(error: ScenarioError) -> Self {
        Self::Sweep(error.into())
    }
}

impl Controllers {
    /// Reads `follower+law`, `follower+` or `+law`; a lone name stands for the one it is.
    ///
    /// # Errors
    ///
    /// [`CompareError::Unknown`] or [`CompareError::Ambiguous`].
    pub fn parse(text: &str, known: &Known) -> Result<Self, CompareError> {
        let unknown = |name: &str, what, known: &[String]| CompareError::Unknown {
            name: name.to_owned(),
            what,
            known: known.to_vec(),
        };
        let pick = |name: &str, what, of: &[String]| -> Result<Option<String>, CompareError> {
            match name.trim() {
                "" => Ok(None),
                name if of.iter().any(|other| other == name) => Ok(Some(name.to_owned())),
                name => Err(unknown(name, what, of)),
            }
        };
        if let Some((follow, balance)) = text.split_once('+') {
            return Ok(Self {
                follow: pick(follow, "path follower", &known.followers)?,
                balance: pick(balance, "balance law", &known.balance_laws)?,
            });
        }
        let name = text.trim().to_owned();
        let follows = known.followers.contains(&name);
        let balances = known.balance_laws.contains(&name);
        match (follows, balances) {
            (true, true) => Err(CompareError::Ambiguous(name)),
            (true, false) => Ok(Self {
                follow: Some(name),
                balance: None,
            }),
            (false, true) => Ok(Self {
                follow: None,
                balance: Some(name),
            }),
            (false, false) => {
                let all = [
                    format!("the followers {}", known.followers.join(", ")),
                    format!("the balance laws {}", known.balance_laws.join(", ")),
                ];
                Err(unknown(&name, "path follower or balance law", &all))
            }
        }
    }
}

/// One run of the comparison.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// `plant.model`.
    pub plant: String,
    /// `follow.controller`; `None` for a plant that stands still.
    pub follow: Option<String>,
    /// `balance.controller`; `None` for a plant that does not roll.
    pub balance: Option<String>,
    /// How it went; `Err` where the combination made no sense, with the message.
    pub result: Result<RowResult, String>,
}

/// All of them.
#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// The scenario's name.
    pub scenario: String,
    /// The seed of every run.
    pub seed: u64,
    /// In the order asked for: the controllers of the first plant, then those of the next.
    pub columns: Vec<Column>,
    /// Stopped before all were run; the columns are those before.
    pub interrupted: bool,
}

/// A comparison to be made.
pub struct CompareStudy<'a> {
    /// The scenario, with all changes.
    pub file: &'a ScenarioFile,
    /// The plants; none: the scenario's own.
    pub plants: &'a [String],
    /// The controllers; none: the scenario's own.
    pub controllers: &'a [Controllers],
    /// Reads what the scenario names.
    pub read: SharedRead<'a>,
    /// Threads, 0: one per core.
    pub jobs: usize,
    /// Asked often.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// One combination before it is run.
struct Planned {
    plant: String,
    controllers: Controllers,
}

impl CompareStudy<'_> {
    /// Number of runs.
    #[must_use]
    pub fn runs(&self) -> usize {
        self.plants.len().max(1) * self.controllers.len().max(1)
    }

    /// Runs every combination; `progress` is told of each that is done.
    ///
    /// # Errors
    ///
    /// [`CompareError`] where a name is unknown or given twice, where there is nothing to compare, or where the first
    /// combination of a kind cannot be run. Others that make no sense are columns with their message.
    pub fn measure(&self, progress: &mut dyn FnMut()) -> Result<Comparison, CompareError> {
        let planned = self.planned()?;
        let scenario = &self.file.scenario;
        let written = serde_json::to_value(scenario).unwrap_or_default();
        let own = |pointer: &str| {
            written
                .pointer(pointer)
                .and_then(Value::as_str)
                .map(str::to_owned)
        };
        let (own_follow, own_balance) = (own("/follow/controller"), own("/balance/controller"));
        let column = |number: usize, result: Result<RowResult, String>| {
            let Planned { plant, controllers } = &planned[number];
            let follow = controllers.follow.clone().or_else(|| own_follow.clone());
            let balance = controllers.balance.clone().or_else(|| own_balance.clone());
            Column {
                plant: plant.clone(),
                follow: follow.filter(|_| plant != STANDING),
                balance: balance.filter(|_| plant != "kinematic"),
                result,
            }
        };
        let mut columns: Vec<Option<Column>> = Vec::new();
        columns.resize_with(planned.len(), || None);
        let moving = self.file.text_after_overrides();
        let standing = without_its_way(&moving);
        for (text, stands) in [(&moving, false), (&standing, true)] {
            let numbers: Vec<usize> = (0..planned.len())
                .filter(|number| (planned[*number].plant == STANDING) == stands)
                .collect();
            let cases = numbers
                .iter()
                .enumerate()
                .map(|(index, number)| Case {
                    index,
                    varied: overrides(&planned[*number], scenario.plant.model.name()),
                    seed: scenario.run.seed,
                })
                .collect();
            if numbers.is_empty() {
                continue;
            }
            let ended = sweep::sweep(
                text,
                &[],
                cases,
                self.read,
                self.jobs,
                self.stop,
                &mut |row| {
                    progress();
                    let number = numbers[row.case.index];
                    columns[number] = Some(column(number, row.result));
                },
            );
            match ended {
                Ok(_) => {}
                // Where the first column of all stands, a plant of the other kind that cannot is a column too.
                Err(error @ (SweepError::Scenario(_) | SweepError::Setup(_))) if numbers[0] > 0 => {
                    for number in numbers {
                        progress();
                        columns[number] = Some(column(number, Err(error.to_string())));
                    }
                }
                Err(error) => return Err(error.into()),
            }
        }
        let total = columns.len();
        let columns: Vec<Column> = columns.into_iter().map_while(|column| column).collect();
        Ok(Comparison {
            scenario: scenario.name.clone(),
            seed: scenario.run.seed,
            interrupted: columns.len() < total,
            columns,
        })
    }

    fn planned(&self) -> Result<Vec<Planned>, CompareError> {
        let known = Known::from_schema();
        for (index, plant) in self.plants.iter().enumerate() {
            if !known.plants.contains(plant) {
                return Err(CompareError::Unknown {
                    name: plant.clone(),
                    what: "plant",
                    known: known.plants,
                });
            }
            if self.plants[..index].contains(plant) {
                return Err(CompareError::Twice(plant.clone()));
            }
        }
        for (index, pair) in self.controllers.iter().enumerate() {
            if self.controllers[..index].contains(pair) {
                let name = |law: &Option<String>| law.clone().unwrap_or_default();
                let twice = format!("{}+{}", name(&pair.follow), name(&pair.balance));
                return Err(CompareError::Twice(twice));
            }
        }
        let runs = self.runs();
        if runs < 2 {
            return Err(CompareError::Alone);
        }
        if runs > MAX_COLUMNS {
            return Err(CompareError::TooMany(runs));
        }
        let own_plant = [self.file.scenario.plant.model.name().to_owned()];
        let own_laws = [Controllers::default()];
        let plants = if self.plants.is_empty() {
            &own_plant
        } else {
            self.plants
        };
        let laws = if self.controllers.is_empty() {
            &own_laws
        } else {
            self.controllers
        };
        let each = |plant: &String| -> Vec<Planned> {
            let with = |controllers: &Controllers| Planned {
                plant: plant.clone(),
                controllers: controllers.clone(),
            };
            laws.iter().map(with).collect()
        };
        Ok(plants.iter().flat_map(each).collect())
    }
}

/// What a combination changes in the scenario; what it leaves as it is, is not touched.
fn overrides(planned: &Planned, own_plant: &str) -> Vec<Override> {
    let quoted = |name: &str| format!("\"{name}\"");
    let mut changes = Vec::new();
    if planned.plant != own_plant {
        changes.push(Override::new("plant.model", quoted(&planned.plant)));
    }
    let Controllers { follow, balance } = &planned.controllers;
    if let Some(follow) = follow {
        changes.push(Override::new("follow.controller", quoted(follow)));
    }
    if let Some(balance) = balance {
        changes.push(Override::new("balance.controller", quoted(balance)));
    }
    changes
}

/// The scenario for a plant that stands still: no field, no way, no speed; all else as it is.
fn without_its_way(text: &str) -> String {
    let Ok(mut scenario) = toml::from_str::<toml::Table>(text) else {
        return text.to_owned();
    };
    for section in ["map", "path", "goal", "laser", "obstacle"] {
        scenario.remove(section);
    }
    if let Some(toml::Value::Table(start)) = scenario.get_mut("start") {
        for key in ["x_m", "y_m", "heading_deg", "speed_mps", "steer_deg"] {
            start.remove(key);
        }
    }
    // Written from a table that was just read.
    toml::to_string_pretty(&scenario).unwrap_or_else(|_| text.to_owned())
}

impl Comparison {
    /// A metric's difference from the first column, in its own unit.
    #[must_use]
    pub fn difference(&self, column: usize, quantity: &Quantity) -> Option<f64> {
        let value = |column: usize| -> Option<f64> {
            let result = self.columns.get(column)?.result.as_ref().ok()?;
            quantity.of(&result.metrics)
        };
        (column > 0)
            .then(|| Some(value(column)? - value(0)?))
            .flatten()
    }

    /// As one object of JSON.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let columns: Vec<Value> = (0..self.columns.len())
            .map(|number| self.column_json(number))
            .collect();
        let mut object = Map::new();
        object.insert("scenario".into(), self.scenario.clone().into());
        object.insert("seed".into(), self.seed.into());
        object.insert("columns".into(), columns.into());
        object.insert("interrupted".into(), self.interrupted.into());
        object.insert("version".into(), crate::VERSION.into());
        Value::Object(object)
    }

    fn column_json(&self, number: usize) -> Value {
        #[derive(Serialize)]
        struct ColumnJson<'c> {
            plant: &'c str,
            #[serde(skip_serializing_if = "Option::is_none")]
            follow: Option<&'c str>,
            #[serde(skip_serializing_if = "Option::is_none")]
            balance: Option<&'c str>,
            outcome: &'c str,
            #[serde(skip_serializing_if = "Option::is_none")]
            reason: Option<&'c str>,
            #[serde(skip_serializing_if = "Option::is_none")]
            passed: Option<bool>,
            #[serde(skip_serializing_if = "Option::is_none")]
            metrics: Option<&'c Metrics>,
            difference: Map<String, Value>,
            #[serde(skip_serializing_if = "Option::is_none")]
            result_hash: Option<&'c str>,
            #[serde(skip_serializing_if = "Option::is_none")]
            error: Option<&'c str>,
        }
        let column = &self.columns[number];
        let result = column.result.as_ref().ok();
        let difference = COMPARED
            .iter()
            .filter_map(|quantity| {
                let value = self.difference(number, quantity)?;
                Some((quantity.metric.to_owned(), value.into()))
            })
            .collect();
        let json = ColumnJson {
            plant: &column.plant,
            follow: column.follow.as_deref(),
            balance: column.balance.as_deref(),
            outcome: result.map_or("invalid", |result| result.outcome.name()),
            reason: result.map(|result| result.reason.as_str()),
            passed: result.map(|result| result.passed),
            metrics: result.map(|result| &result.metrics),
            difference,
            result_hash: result.map(|result| result.result_hash.as_str()),
            error: column.result.as_ref().err().map(String::as_str),
        };
        serde_json::to_value(json).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known() -> Known {
        let list = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        Known {
            plants: list(&["bike3d", "two_link"]),
            followers: list(&["pvfc", "stanley", "lqr"]),
            balance_laws: list(&["output_zeroing", "lqr"]),
        }
    }

    fn standing(seconds: f64) -> ScenarioFile {
        let text = format!(
            "format = 1\nname = \"lean\"\n[start]\nroll_deg = 3\n[plant]\nmodel = \"two_link\"\n[run]\nduration_s = {seconds}\n"
        );
        ScenarioFile::parse(&text, &[]).unwrap()
    }

    fn riding() -> ScenarioFile {
        let text = "format = 1\nname = \"straight\"\n[start]\nspeed_mps = 0.5\n[path]\nwaypoints = [[0, 0, 0], [3, 0, 0]]\n\
                    tangent_per_chord = 1\n[plant]\ncontrol_s = 0.005\n[run]\nduration_s = 20\n";
        ScenarioFile::parse(text, &[]).unwrap()
    }

    fn measured(
        file: &ScenarioFile,
        plants: &[&str],
        jobs: usize,
    ) -> Result<Comparison, CompareError> {
        let plants: Vec<String> = plants.iter().map(|name| (*name).to_owned()).collect();
        let study = CompareStudy {
            file,
            plants: &plants,
            controllers: &[],
            read: &|name| Err(format!("{name}?")),
            jobs,
            stop: &|| false,
        };
        study.measure(&mut || {})
    }

    #[test]
    fn the_schema_knows_the_plants() {
        let known = Known::from_schema();
        for plant in ["bike3d", "two_link", "kinematic"] {
            assert!(known.plants.iter().any(|name| name == plant), "{known:?}");
        }
    }

    #[test]
    fn controllers_are_named_alone_or_in_pairs() {
        let parsed = |text: &str| {
            let pair = Controllers::parse(text, &known()).unwrap();
            [pair.follow, pair.balance].map(Option::unwrap_or_default)
        };
        assert_eq!(parsed("pvfc+lqr"), ["pvfc", "lqr"]);
        assert_eq!(parsed("stanley"), ["stanley", ""]);
        assert_eq!(parsed("output_zeroing"), ["", "output_zeroing"]);
        assert_eq!(parsed("lqr+"), ["lqr", ""]);
        assert_eq!(parsed("+lqr"), ["", "lqr"]);
        let refused = |text: &str| Controllers::parse(text, &known()).unwrap_err().to_string();
        assert!(refused("lqr").contains("a path follower and a balance law"));
        assert!(refused("pid").contains(
            "known are the followers pvfc, stanley, lqr, the balance laws output_zeroing, lqr"
        ));
        assert!(refused("output_zeroing+pvfc").contains("`output_zeroing` is no path follower"));
    }

    #[test]
    fn nonsense_is_refused_before_anything_runs() {
        let file = standing(1.0);
        for (plants, part) in [
            (
                &["bike4d", "two_link"][..],
                "`bike4d` is no plant; known are ",
            ),
            (&["two_link", "two_link"], "named twice"),
            (&["two_link"], "nothing to compare"),
            (&[], "nothing to compare"),
        ] {
            let text = measured(&file, plants, 1).unwrap_err().to_string();
            assert!(text.contains(part), "{text}");
        }
    }

    #[test]
    fn a_plant_that_stands_still_gets_the_ride_without_its_way() {
        let comparison = measured(&riding(), &["bike3d", "two_link", "kinematic"], 1).unwrap();
        let plants: Vec<&str> = comparison
            .columns
            .iter()
            .map(|column| column.plant.as_str())
            .collect();
        assert_eq!(plants, ["bike3d", "two_link", "kinematic"]);
        let outcomes: Vec<_> = comparison
            .columns
            .iter()
            .map(|column| column.result.as_ref().map(|result| result.outcome.name()))
            .collect();
        assert_eq!(outcomes, [Ok("arrived"); 3]);
        let [bike, still, kinematic] = &comparison.columns[..] else {
            panic!("three columns");
        };
        assert!(still.follow.is_none() && kinematic.balance.is_none());
        let metrics = |column: &Column| column.result.clone().unwrap().metrics;
        assert!(metrics(bike).distance_m.is_some() && metrics(still).distance_m.is_none());
        // The drive of either moving plant does work; nothing balances the kinematic one.
        assert!(
            metrics(bike).drive_work_j > Some(1.0) && metrics(kinematic).drive_work_j > Some(1.0)
        );
        assert!(metrics(kinematic).balancer_work_j.is_none());
        let json = comparison.to_json();
        assert_eq!(json["columns"][1]["plant"], "two_link");
        assert!(
            json["columns"][2]["difference"]["drive_work_j"].is_number(),
            "{json}"
        );
        assert!(
            json["columns"][0]["difference"]
                .as_object()
                .unwrap()
                .is_empty()
        );
    }

    #[test]
    fn a_combination_that_makes_no_sense_is_a_column_with_its_message() {
        // A bike that stands still feels no slope.
        let text = riding().text().to_owned() + "[[disturbance]]\nkind = \"slope\"\ngrade = 0.02\n";
        let file = ScenarioFile::parse(&text, &[]).unwrap();
        let comparison = measured(&file, &["bike3d", "two_link"], 1).unwrap();
        assert!(comparison.columns[0].result.is_ok());
        let message = comparison.columns[1].result.clone().unwrap_err();
        assert!(message.contains("slope"), "{message}");
        assert!(measured(&file, &["two_link", "bike3d"], 1).is_err());
    }

    #[test]
    fn the_columns_are_the_same_on_any_number_of_threads() {
        let file = riding();
        let plants = ["kinematic", "bike3d", "two_link"];
        let one = measured(&file, &plants, 1).unwrap();
        assert_eq!(one, measured(&file, &plants, 3).unwrap());
    }

    #[test]
    fn a_column_is_the_run_it_names() {
        let file = riding();
        let comparison = measured(&file, &["kinematic", "bike3d"], 2).unwrap();
        let setup = crate::Setup::resolve(&file, &mut |name| Err(name.to_owned())).unwrap();
        let control = crate::RunControl {
            stop: &|| false,
            progress: &mut |_| {},
            clock: None,
        };
        let alone = crate::run(&setup, &mut (), control).unwrap();
        let column = comparison.columns[1].result.as_ref().unwrap();
        assert_eq!(column.result_hash, alone.result_hash);
    }
}
