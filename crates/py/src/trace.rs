//! `Trace`: every sample of a ride, as arrays.

use std::sync::Arc;

use bikebot_sim::record::event::{GoalSample, PathSample};
use bikebot_sim::record::trace::{FollowedTrace, LogLine, Notice, PlanTrace, ScanTrace};
use bikebot_sim::record::{
    ControlColumns, ControlSample, LogLevel, StateColumns, StateSample, Trace,
};
use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyIterator, PyList, PyTuple, PyType};

use crate::arguments::type_name;
use crate::arrays::{lend, lend_rows};
use crate::errors::{kind, value};

/// Every sample of a ride by the names of the recording: `trace["roll_rad"]`.
///
/// A mapping of names to read-only float64 arrays of shape (n,), SI units and radians, that lie in the trace's own memory. `time_s`
/// is the time of the samples; what does not apply to a plant or a controller is NaN.
#[pyclass(name = "Trace", module = "bikebot", frozen, mapping)]
pub struct PyTrace(pub Arc<Trace>);

/// A path as rows x, y, heading, curvature, s, speed.
fn rows(path: &[PathSample]) -> Vec<f64> {
    path.iter()
        .flat_map(|p| [p.x, p.y, p.heading, p.curvature, p.s, p.speed])
        .collect()
}

fn path(rows: &[f64]) -> Vec<PathSample> {
    rows.chunks_exact(6)
        .map(|row| PathSample {
            x: row[0],
            y: row[1],
            heading: row[2],
            curvature: row[3],
            s: row[4],
            speed: row[5],
        })
        .collect()
}

const LEVELS: [(LogLevel, &str); 4] = [
    (LogLevel::Debug, "debug"),
    (LogLevel::Info, "info"),
    (LogLevel::Warning, "warning"),
    (LogLevel::Error, "error"),
];

/// A name and its array.
type Item<'py> = (&'static str, Bound<'py, PyArray1<f64>>);
type Edge = [[f64; 2]; 2];
type Goal = ([f64; 2], Option<f64>, f64);
type PlanState = (
    f64,
    Vec<f64>,
    Vec<Edge>,
    Vec<[f64; 2]>,
    Vec<[f64; 2]>,
    Option<f64>,
    Option<Goal>,
);

impl PyTrace {
    /// What can be pickled.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let trace = &*self.0;
        let state = PyDict::new(py);
        let columns = |names: &[&'static str], of_control: bool| {
            let columns = PyDict::new(py);
            for name in std::iter::once(&"time_s").chain(names) {
                let values = if of_control {
                    trace.control.column(name)
                } else {
                    trace.state.column(name)
                };
                columns.set_item(name, PyArray1::from_slice(py, values.unwrap_or_default()))?;
            }
            PyResult::Ok(columns)
        };
        state.set_item("state", columns(StateSample::FIELDS, false)?)?;
        state.set_item("control", columns(ControlSample::FIELDS, true)?)?;
        let plans: Vec<PlanState> = trace
            .plans
            .iter()
            .map(|plan| {
                (
                    plan.time_s,
                    rows(&plan.path),
                    plan.tree.clone(),
                    plan.coarse.clone(),
                    plan.guide.clone(),
                    plan.corridor_half_width,
                    plan.goal
                        .map(|goal| (goal.position, goal.heading, goal.tolerance)),
                )
            })
            .collect();
        state.set_item("plans", plans)?;
        let followed: Vec<(f64, Vec<f64>)> = trace
            .followed
            .iter()
            .map(|it| (it.time_s, rows(&it.path)))
            .collect();
        state.set_item("followed", followed)?;
        state.set_item("notices", self.notices())?;
        let lines: Vec<(f64, usize, &str)> = trace
            .lines
            .iter()
            .map(|line| {
                let level = LEVELS.iter().position(|(level, _)| *level == line.level);
                (line.time_s, level.unwrap_or(1), line.text.as_str())
            })
            .collect();
        state.set_item("lines", lines)?;
        let scans: Vec<(f64, f64, f64, Vec<f64>)> = trace
            .scans
            .iter()
            .map(|it| (it.time_s, it.start_angle, it.angle_step, it.ranges.clone()))
            .collect();
        state.set_item("scans", scans)?;
        Ok(state)
    }

    fn notices(&self) -> Vec<(f64, String, String, f64)> {
        let notices = self.0.notices.iter();
        notices
            .map(|it| (it.time_s, it.kind.clone(), it.text.clone(), it.value))
            .collect()
    }

    /// `bikebot.Event` of every notice.
    pub fn events<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        let class = py.import("bikebot._results")?.getattr("Event")?;
        let events = PyList::empty(py);
        for notice in self.notices() {
            events.append(class.call1(notice)?)?;
        }
        Ok(events)
    }

    /// Time, level and text of every line for people.
    pub fn lines(&self) -> Vec<(f64, &'static str, String)> {
        let lines = self.0.lines.iter();
        lines
            .map(|line| {
                let level = LEVELS.iter().find(|(level, _)| *level == line.level);
                (
                    line.time_s,
                    level.map_or("info", |it| it.1),
                    line.text.clone(),
                )
            })
            .collect()
    }
}

fn columns(
    state: &Bound<'_, PyDict>,
    key: &str,
) -> PyResult<impl Fn(&str) -> Option<Vec<f64>> + use<>> {
    let missing = || value(format!("a pickled Trace without {key}"));
    let dict = state.get_item(key)?.ok_or_else(missing)?;
    let mut found = std::collections::BTreeMap::new();
    for (name, array) in dict.cast::<PyDict>().map_err(|_| missing())?.iter() {
        let array: PyReadonlyArray1<'_, f64> = array.extract()?;
        found.insert(name.extract::<String>()?, array.as_array().to_vec());
    }
    Ok(move |name: &str| found.get(name).cloned())
}

#[pymethods]
impl PyTrace {
    /// The names.
    fn keys(&self) -> Vec<&'static str> {
        Trace::names().collect()
    }

    /// The arrays, in the order of the names.
    fn values<'py>(slf: &Bound<'py, Self>) -> PyResult<Vec<Bound<'py, PyArray1<f64>>>> {
        let names = Trace::names();
        names.map(|name| Self::column(slf, name)).collect()
    }

    /// Names and arrays.
    fn items<'py>(slf: &Bound<'py, Self>) -> PyResult<Vec<Item<'py>>> {
        Trace::names()
            .map(|name| Ok((name, Self::column(slf, name)?)))
            .collect()
    }

    /// The array of that name, or `default`.
    #[pyo3(signature = (name, default=None))]
    fn get<'py>(
        slf: &Bound<'py, Self>,
        name: &Bound<'py, PyAny>,
        default: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let known = name
            .extract::<String>()
            .is_ok_and(|name| slf.get().0.column(&name).is_some());
        if known {
            Ok(Some(Self::__getitem__(slf, name)?.into_any()))
        } else {
            Ok(default)
        }
    }

    /// The times that go with the array of that name, s: of the true states, or of the controller's ticks.
    fn time<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        match slf.get().0.column(name) {
            Some((time, _)) => lend(slf, time),
            None => Err(unknown(name)),
        }
    }

    fn __getitem__<'py>(
        slf: &Bound<'py, Self>,
        name: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let name: String = name.extract().map_err(|_| {
            kind(format!(
                "a trace is asked by name, such as trace[\"roll_rad\"], not by {}",
                type_name(name)
            ))
        })?;
        Self::column(slf, &name)
    }

    fn __contains__(&self, name: &Bound<'_, PyAny>) -> bool {
        let name = name.extract::<String>();
        name.is_ok_and(|name| self.0.column(&name).is_some())
    }

    fn __len__(&self) -> usize {
        Trace::names().count()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        PyList::new(py, self.keys())?.try_iter()
    }

    fn __repr__(&self) -> String {
        let time = &self.0.state.time_s;
        format!(
            "Trace({} quantities, {} samples, {} s)",
            self.__len__(),
            time.len(),
            crate::world::tidy(time.last().copied().unwrap_or(0.0))
        )
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let restore = py.get_type::<Self>().getattr("_restore")?;
        Ok((restore, (self.state(py)?,).into_pyobject(py)?))
    }

    /// What pickling calls.
    #[classmethod]
    fn _restore(_class: &Bound<'_, PyType>, state: &Bound<'_, PyDict>) -> PyResult<Self> {
        let item = |key: &str| {
            state
                .get_item(key)?
                .ok_or_else(|| value(format!("a pickled Trace without {key}")))
        };
        let mut trace = Trace::with_scans();
        trace.state = StateColumns::from_columns(columns(state, "state")?);
        trace.control = ControlColumns::from_columns(columns(state, "control")?);
        let plans: Vec<PlanState> = item("plans")?.extract()?;
        trace.plans = plans
            .into_iter()
            .map(
                |(time_s, rows, tree, coarse, guide, corridor_half_width, goal)| PlanTrace {
                    time_s,
                    path: path(&rows),
                    tree,
                    coarse,
                    guide,
                    corridor_half_width,
                    goal: goal.map(|(position, heading, tolerance)| GoalSample {
                        position,
                        heading,
                        tolerance,
                    }),
                },
            )
            .collect();
        let followed: Vec<(f64, Vec<f64>)> = item("followed")?.extract()?;
        trace.followed = followed
            .into_iter()
            .map(|(time_s, rows)| FollowedTrace {
                time_s,
                path: path(&rows),
            })
            .collect();
        let notices: Vec<(f64, String, String, f64)> = item("notices")?.extract()?;
        trace.notices = notices
            .into_iter()
            .map(|(time_s, kind, text, value)| Notice {
                time_s,
                kind,
                text,
                value,
            })
            .collect();
        let lines: Vec<(f64, usize, String)> = item("lines")?.extract()?;
        trace.lines = lines
            .into_iter()
            .map(|(time_s, level, text)| LogLine {
                time_s,
                level: LEVELS.get(level).map_or(LogLevel::Info, |it| it.0),
                text,
            })
            .collect();
        let scans: Vec<(f64, f64, f64, Vec<f64>)> = item("scans")?.extract()?;
        trace.scans = scans
            .into_iter()
            .map(|(time_s, start_angle, angle_step, ranges)| ScanTrace {
                time_s,
                start_angle,
                angle_step,
                ranges,
            })
            .collect();
        Ok(Self(Arc::new(trace)))
    }
}

fn unknown(name: &str) -> PyErr {
    let nearest = Trace::names().filter(|known| {
        let stem = name.split('_').next().unwrap_or(name);
        !stem.is_empty() && known.contains(stem)
    });
    let nearest: Vec<&str> = nearest.take(5).collect();
    let hint = if nearest.is_empty() {
        "keys() tells the names".to_owned()
    } else {
        format!("there are {}", nearest.join(", "))
    };
    PyKeyError::new_err(format!("a trace has no {name:?}: {hint}"))
}

impl PyTrace {
    fn column<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        match slf.get().0.column(name) {
            Some((_, values)) => lend(slf, values),
            None => Err(unknown(name)),
        }
    }
}

/// A path as an array (n, 6): x, y, heading, curvature, s, speed.
#[pyclass(frozen)]
struct Rows(Vec<f64>);

/// Lends the rows of a path.
pub fn path_array<'py>(
    py: Python<'py>,
    path: &[PathSample],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let owner = Bound::new(py, Rows(rows(path)))?;
    lend_rows(&owner, &owner.get().0, 6)
}
