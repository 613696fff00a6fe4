//! `Scenario`: one ride, or one plan, with everything that decides its result.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bikebot_planner::EndPose;
use bikebot_sim::{Override, ScenarioFile, Setup, SetupError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple, PyType};

use crate::arguments::{self, type_name};
use crate::errors::{self, kind, value};
use crate::files;
use crate::json;
use crate::own::Own;
use crate::plan::PyPlan;
use crate::ride::{self, PyRide};
use crate::search::{self, Asked, Limits};
use crate::toml_value;
use crate::work;
use crate::world::{Field, PyWorld};

/// Files by the names that a scenario uses for them.
pub type Attached = BTreeMap<String, Vec<u8>>;

/// A scenario, resolved, with all it was made of.
pub struct Given {
    /// As written.
    pub text: String,
    /// Made to it.
    pub changes: Vec<Override>,
    /// Name of the file, for messages.
    pub file: Option<String>,
    /// Where the files lie that it names.
    pub folder: Option<PathBuf>,
    /// Those that were read: they stay as they were.
    pub attached: Attached,
    /// What it means.
    pub setup: Arc<Setup>,
}

impl Given {
    /// Reads and resolves.
    pub fn new(
        py: Python<'_>,
        text: String,
        changes: Vec<Override>,
        file: Option<String>,
        folder: Option<PathBuf>,
        attached: Attached,
    ) -> PyResult<Self> {
        let resolved = work::here(py, |_| {
            let parsed = ScenarioFile::parse(&text, &changes).map_err(SetupError::from)?;
            let seen = RefCell::new(Attached::new());
            let setup = Setup::resolve(&parsed, &mut |name| {
                let bytes = read_inner(name, &attached, folder.as_deref())?;
                seen.borrow_mut().insert(name.to_owned(), bytes.clone());
                Ok(bytes)
            })?;
            Ok((setup, seen.into_inner()))
        })?;
        let (setup, seen) = resolved
            .map_err(|error: SetupError| errors::setup(py, &error, file.as_deref(), &text))?;
        Ok(Self {
            text,
            changes,
            file,
            folder,
            attached: seen,
            setup: Arc::new(setup),
        })
    }

    /// Reads a file it names.
    pub fn read(&self, name: &str) -> Result<Vec<u8>, String> {
        read_inner(name, &self.attached, self.folder.as_deref())
    }

    /// The name of its map, as a user finds it.
    fn map_name(&self) -> Option<String> {
        let file = ScenarioFile::parse(&self.text, &self.changes).ok()?;
        let name = file.scenario.map?.file?;
        Some(match &self.folder {
            Some(folder) => folder.join(name).display().to_string(),
            None => name,
        })
    }

    /// Its world.
    pub fn field(&self) -> Option<Field> {
        let named = self.map_name().or_else(|| Some(self.setup.name.clone()));
        Field::of_scenario(&self.setup, named)
    }

    /// What its planner is asked.
    pub fn asked(&self) -> Option<(Asked, EndPose, EndPose)> {
        let setup = &self.setup;
        let goal = setup.goal?;
        let asked = Asked {
            field: Field::of_scenario(setup, self.map_name())?,
            footprint: setup.planning_footprint.clone(),
            params: Arc::new(setup.planner.clone()),
            tolerance: goal.tolerance,
        };
        Some((asked, setup.start_pose?, goal.end()))
    }
}

fn read_inner(name: &str, attached: &Attached, folder: Option<&Path>) -> Result<Vec<u8>, String> {
    match (attached.get(name), folder) {
        (Some(bytes), _) => Ok(bytes.clone()),
        (None, Some(folder)) => files::read_plain(&folder.join(name)),
        (None, None) => {
            Err("the scenario was made of text, and no folder or files were given with it".into())
        }
    }
}

/// A scenario: a map, a start, a goal, a bike and everything else that decides a ride.
///
/// Made by `Scenario.load` or `Scenario.from_text`; it is checked and resolved at once, holds the maps it names, never changes,
/// and pickles, so that it can be sent to other machines. `with_` gives a changed one.
///
/// >>> scenario = Scenario.from_text('''
/// ... format = 1
/// ... name = "stand"
/// ... [start]
/// ... roll_deg = 2.0
/// ... [plant]
/// ... model = "two_link"
/// ... [run]
/// ... duration_s = 2.0
/// ... ''')
/// >>> ride = scenario.with_(start={"roll_deg": 1.0}, run={"seed": 7}).run()
/// >>> ride.outcome, len(ride.trace["roll_rad"]) > 100
/// ('arrived', True)
#[pyclass(name = "Scenario", module = "bikebot", frozen)]
pub struct PyScenario(pub Arc<Given>);

fn attachments(object: Option<&Bound<'_, PyAny>>) -> PyResult<Attached> {
    let Some(object) = object else {
        return Ok(Attached::new());
    };
    object.extract().map_err(|_| {
        kind(format!(
            "files takes a dict of file names to bytes, not {}",
            type_name(object)
        ))
    })
}

#[pymethods]
impl PyScenario {
    /// Reads a scenario file (TOML) and the maps it names.
    ///
    /// Raises `ScenarioError` (with `.line`, `.column`, `.key`, `.help`) for what is wrong in it, `MapError` for its map, `OSError`
    /// where it cannot be read.
    #[staticmethod]
    fn load(py: Python<'_>, path: &Bound<'_, PyAny>) -> PyResult<Self> {
        let path = arguments::path("path", path)?;
        let bytes = files::read(&path)?;
        let file = path.display().to_string();
        let text = String::from_utf8(bytes).map_err(|_| {
            errors::bad_scenario(
                py,
                &format!("{file} is no scenario: a byte of it is not UTF-8"),
                "a scenario is a text file; maps are read by World.load, recordings by read_log",
            )
        })?;
        let folder = path.parent().map(Path::to_owned).unwrap_or_default();
        let given = Given::new(
            py,
            text,
            Vec::new(),
            Some(file),
            Some(folder),
            Attached::new(),
        )?;
        Ok(Self(Arc::new(given)))
    }

    /// A scenario out of its TOML text.
    ///
    /// The files it names are read from `folder`, or are given as `files`, a dict of names to bytes.
    #[staticmethod]
    #[pyo3(signature = (text, *, folder=None, files=None))]
    fn from_text(
        py: Python<'_>,
        text: String,
        folder: Option<&Bound<'_, PyAny>>,
        files: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let folder = folder.map(|it| arguments::path("folder", it)).transpose()?;
        let given = Given::new(py, text, Vec::new(), None, folder, attachments(files)?)?;
        Ok(Self(Arc::new(given)))
    }

    /// The same scenario with other values: `with_(follow={"max_speed_mps": 2.0}, run={"seed": 3})`, or with dotted keys
    /// `with_({"follow.max_speed_mps": 2.0})`, where entries of lists are counted from 0 (`"disturbance.0.impulse_ns"`).
    ///
    /// Values are bool, int, float, str, lists and numpy scalars and arrays of these. Raises `ScenarioError` for a key or a value
    /// that a scenario does not have.
    #[pyo3(signature = (changes=None, /, **sections))]
    fn with_(
        &self,
        py: Python<'_>,
        changes: Option<&Bound<'_, PyAny>>,
        sections: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let mut all = self.0.changes.clone();
        if let Some(changes) = changes {
            all.extend(toml_value::changes(changes)?);
        }
        if let Some(sections) = sections {
            all.extend(toml_value::changes(sections.as_any())?);
        }
        let given = &self.0;
        let changed = Given::new(
            py,
            given.text.clone(),
            all,
            given.file.clone(),
            given.folder.clone(),
            given.attached.clone(),
        )?;
        Ok(Self(Arc::new(changed)))
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        &self.0.setup.name
    }

    /// Its seed.
    #[getter]
    fn seed(&self) -> u64 {
        self.0.setup.seed
    }

    /// What is known to be in the way; None without a map.
    #[getter]
    fn world(&self) -> Option<PyWorld> {
        self.0.field().map(PyWorld::from)
    }

    /// What a user should know of the inputs; nothing that stops a run.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.0.setup.warnings.clone()
    }

    /// The files it names, as they were read: a dict of names to bytes.
    #[getter]
    fn files<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let files = PyDict::new(py);
        for (name, bytes) in &self.0.attached {
            files.set_item(name, pyo3::types::PyBytes::new(py, bytes))?;
        }
        Ok(files)
    }

    /// The changes made by `with_`, as a list of (key, value in TOML).
    #[getter]
    fn changes(&self) -> Vec<(String, String)> {
        let changes = self.0.changes.iter();
        changes
            .map(|change| (change.key.clone(), change.value.clone()))
            .collect()
    }

    /// The scenario as TOML, changes applied: what a recording carries.
    fn to_toml(&self) -> String {
        self.0.setup.scenario_text.clone()
    }

    /// Every value, defaults filled in, as a nested dict.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let given = &self.0;
        let file = ScenarioFile::parse(&given.text, &given.changes)
            .map_err(|error| errors::scenario(py, &error, given.file.as_deref(), &given.text))?;
        json::to_python(py, &file.scenario)
    }

    /// Plans its path and nothing else: see `plan`. The seed is the scenario's where none is given.
    ///
    /// Raises `PlanError` where start or goal make no sense, `ValueError` where there is nothing to plan.
    #[pyo3(signature = (*, seed=None, time_limit=None, iterations=None, target_cost=None, min_time=None, threads=None))]
    #[allow(clippy::too_many_arguments, reason = "keywords of Python")]
    fn plan(
        &self,
        py: Python<'_>,
        seed: Option<&Bound<'_, PyAny>>,
        time_limit: Option<&Bound<'_, PyAny>>,
        iterations: Option<&Bound<'_, PyAny>>,
        target_cost: Option<&Bound<'_, PyAny>>,
        min_time: Option<&Bound<'_, PyAny>>,
        threads: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<PyPlan> {
        let mut limits = Limits::new(seed, time_limit, iterations, target_cost, min_time, threads)?;
        if seed.is_none() {
            limits.seed = self.0.setup.seed;
        }
        let Some((asked, start, goal)) = self.0.asked() else {
            return Err(value(
                "there is nothing to plan: the scenario has no map with a start and a goal",
            ));
        };
        search::plan(py, asked, start, goal, &limits)
    }

    /// Plans, rides, and returns what happened.
    ///
    /// `progress` is True (a bar: tqdm where it is installed), a function of the share done from 0 to 1, or a tqdm bar. `record` is the
    /// path of a recording (.mcap) to write while riding. `scans` keeps the laser's sweeps in `ride.scans`.
    ///
    /// `follower` and `balancer` are controllers of your own, functions that are called once a control period on the calling thread:
    ///
    /// - `balancer(seen: BalancerView)` returns the torque of the frame on the balancer, N m, in place of [balance];
    /// - `follower(seen: FollowerView)` returns (acceleration of the rear contact in m/s², steering rate in rad/s), in place of
    ///   [follow] controller. It is not called while the bike is held at rest, and before the goal the bike brakes by itself. The lean
    ///   into coming turns is foreseen as if [follow] controller went on from here.
    ///
    /// The limits of the motors hold for both. What they raise ends the ride and is raised as it is. The same functions give the same
    /// `result_hash`; the scenario knows nothing of them, so a recording does not repeat such a ride.
    ///
    /// Raises `PlanError` where start or goal make no sense; `TypeError` or `ValueError` for what a controller returns that is no
    /// command. A fall or a search in vain is an outcome. Ctrl-C ends it within 50 ms.
    ///
    /// >>> stand = Scenario.from_text('''
    /// ... format = 1
    /// ... name = "stand"
    /// ... [start]
    /// ... roll_deg = 2.0
    /// ... [plant]
    /// ... model = "two_link"
    /// ... [run]
    /// ... duration_s = 2.0
    /// ... ''')
    /// >>> stand.run(balancer=lambda seen: 800 * seen.roll_rad + 220 * seen.roll_rate_radps + 4 * seen.balancer_rate_radps).outcome
    /// 'arrived'
    /// >>> stand.run(balancer=lambda seen: 0.0).outcome
    /// 'fell'
    #[pyo3(signature = (*, follower=None, balancer=None, progress=None, record=None, scans=false))]
    fn run(
        &self,
        py: Python<'_>,
        follower: Option<&Bound<'_, PyAny>>,
        balancer: Option<&Bound<'_, PyAny>>,
        progress: Option<&Bound<'_, PyAny>>,
        record: Option<&Bound<'_, PyAny>>,
        scans: bool,
    ) -> PyResult<PyRide> {
        let own = Own::new(follower, balancer)?;
        let record = record.map(|it| arguments::path("record", it)).transpose()?;
        ride::run(py, self.0.clone(), progress, record.as_deref(), scans, &own)
    }

    fn __repr__(&self) -> String {
        let setup = &self.0.setup;
        let mut text = format!(
            "Scenario({:?}, {}, {}, seed {}",
            setup.name,
            setup.plant.name(),
            setup.mode_name(),
            setup.seed
        );
        match self.0.changes.len() {
            0 => {}
            1 => text.push_str(", 1 change"),
            many => text.push_str(&format!(", {many} changes")),
        }
        text.push(')');
        text
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| {
            let (a, b) = (&self.0, &other.get().0);
            a.setup.scenario_text == b.setup.scenario_text && a.attached == b.attached
        })
    }

    fn __hash__(&self) -> u64 {
        use std::hash::{DefaultHasher, Hash, Hasher};
        let mut hasher = DefaultHasher::new();
        self.0.setup.scenario_text.hash(&mut hasher);
        hasher.finish()
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let given = &self.0;
        let folder = given.folder.as_ref().map(|it| it.display().to_string());
        let state = (
            PyString::new(py, &given.text),
            self.changes(),
            given.file.clone(),
            folder,
            self.files(py)?,
        );
        let restore = py.get_type::<Self>().getattr("_restore")?;
        Ok((restore, state.into_pyobject(py)?))
    }

    /// What pickling calls.
    #[classmethod]
    fn _restore(
        _class: &Bound<'_, PyType>,
        py: Python<'_>,
        text: String,
        changes: Vec<(String, String)>,
        file: Option<String>,
        folder: Option<PathBuf>,
        files: Attached,
    ) -> PyResult<Self> {
        let changes = changes
            .into_iter()
            .map(|(key, value)| Override::new(key, value))
            .collect();
        let given = Given::new(py, text, changes, file, folder, files)?;
        Ok(Self(Arc::new(given)))
    }
}
