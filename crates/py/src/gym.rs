//! `_Bikes`: the bikes behind `bikebot.gym`, stepped in Rust into arrays that the caller lends.

use std::sync::{Arc, Mutex, MutexGuard, TryLockError};

use bikebot_sim::episode::{Bikes, Buffers, Course, Ending, EpisodeError, Spread, Task};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::errors::{self, value};
use crate::scenario::PyScenario;
use crate::work;

/// Names and bounds of what is observed.
type Described = Vec<(&'static str, f64)>;

/// Bikes on one course.
#[pyclass(name = "_Bikes", module = "bikebot._bikebot", frozen)]
pub struct PyBikes {
    course: Arc<Course>,
    bikes: Mutex<Bikes>,
    count: usize,
}

fn told(py: Python<'_>, error: EpisodeError) -> PyErr {
    match error {
        EpisodeError::Run(error) => errors::run(py, &error),
        EpisodeError::Threads(_) => pyo3::exceptions::PyOSError::new_err(error.to_string()),
        EpisodeError::Scenario { .. } => value(format!("scenario: {error}")),
        EpisodeError::ActionNotFinite {
            bike,
            number,
            value: found,
        } => value(format!(
            "actions[{bike}, {number}] is {found}: an action takes finite numbers from -1 to 1"
        )),
        other => value(other.to_string()),
    }
}

impl PyBikes {
    /// The bikes, for one thread at a time.
    fn lock(&self, py: Python<'_>) -> PyResult<MutexGuard<'_, Bikes>> {
        match self.bikes.try_lock() {
            Ok(bikes) => Ok(bikes),
            Err(TryLockError::WouldBlock) => Err(errors::bikebot(
                py,
                "another thread is stepping this environment: give each thread its own",
            )),
            Err(TryLockError::Poisoned(_)) => Err(errors::bikebot(
                py,
                "this environment broke in an earlier step: make a new one",
            )),
        }
    }
}

/// An array that is read or written elsewhere, or may not be written.
fn lent(error: &numpy::BorrowError) -> PyErr {
    value(format!(
        "an array of this call cannot be used now: {error}; give each environment arrays of its own"
    ))
}

fn scattered(what: &str) -> PyErr {
    value(format!("{what} has to be contiguous: np.ascontiguousarray"))
}

#[pymethods]
impl PyBikes {
    #[new]
    #[pyo3(signature = (scenario, task, seeds, *, threads, spread))]
    fn new(
        py: Python<'_>,
        scenario: &Bound<'_, PyScenario>,
        task: &str,
        seeds: Vec<u64>,
        threads: usize,
        spread: [Option<f64>; 6],
    ) -> PyResult<Self> {
        let task = match task {
            "balance" => Task::Balance,
            "follow" => Task::Follow,
            "ride" => Task::Ride,
            other => return Err(value(format!("task is {other:?}"))),
        };
        let usual = Spread::of(task);
        let [roll, roll_rate, balancer, balancer_rate, lateral, heading] = spread;
        let spread = Spread {
            roll: roll.unwrap_or(usual.roll),
            roll_rate: roll_rate.unwrap_or(usual.roll_rate),
            balancer: balancer.unwrap_or(usual.balancer),
            balancer_rate: balancer_rate.unwrap_or(usual.balancer_rate),
            lateral: lateral.unwrap_or(usual.lateral),
            heading: heading.unwrap_or(usual.heading),
        };
        let setup = scenario.get().0.setup.clone();
        let count = seeds.len();
        let made = work::aside(py, None, |shared| {
            let course = Arc::new(Course::new(setup, task, spread, &|| shared.is_stopped())?);
            let bikes = Bikes::new(course.clone(), &seeds, threads)?;
            Ok::<_, EpisodeError>((course, bikes))
        })?;
        let (course, bikes) = made.map_err(|error| told(py, error))?;
        Ok(Self {
            course,
            bikes: Mutex::new(bikes),
            count,
        })
    }

    /// How many there are.
    #[getter]
    fn count(&self) -> usize {
        self.count
    }

    /// Names of the numbers of an action.
    #[getter]
    fn actions(&self) -> Vec<&'static str> {
        self.course.task().actions().to_vec()
    }

    /// Names of the numbers of an observation, and their bounds.
    #[getter]
    fn observations(&self) -> Described {
        self.course.task().observations().to_vec()
    }

    /// Names of the endings, by their numbers.
    #[getter]
    fn endings(&self) -> Vec<&'static str> {
        Ending::ALL.map(Ending::name).to_vec()
    }

    /// Control period and duration, s.
    #[getter]
    fn times(&self) -> (f64, f64) {
        let setup = self.course.setup();
        (setup.control.seconds(), setup.duration.seconds())
    }

    /// The true state of a bike: (x, y, heading, steer, roll, balancer, speed, roll rate, balancer rate).
    fn state<'py>(&self, py: Python<'py>, bike: usize) -> PyResult<Bound<'py, PyTuple>> {
        let bikes = self.lock(py)?;
        let Some(episode) = bikes.bikes().get(bike) else {
            return Err(value(format!(
                "bike is {bike}: there are {} of them",
                self.count
            )));
        };
        let s = episode.state();
        (
            s.pose.position.x,
            s.pose.position.y,
            s.pose.heading,
            s.steer,
            s.roll,
            s.balancer,
            s.speed,
            s.roll_rate,
            s.balancer_rate,
        )
            .into_pyobject(py)
    }

    /// Begins anew, with a seed or with the next episode of the last one, where `which` says so.
    fn reset(
        &self,
        py: Python<'_>,
        seeds: Vec<Option<u64>>,
        which: Option<&Bound<'_, PyArray1<bool>>>,
        observations: &Bound<'_, PyArray2<f32>>,
    ) -> PyResult<()> {
        let mut bikes = self.lock(py)?;
        let bikes = &mut *bikes;
        let which = which
            .map(|which| which.try_readonly())
            .transpose()
            .map_err(|error| lent(&error))?;
        let which = match &which {
            Some(which) => Some(which.as_slice().map_err(|_| scattered("reset_mask"))?),
            None => None,
        };
        let mut observations = observations.try_readwrite().map_err(|error| lent(&error))?;
        let observations = observations
            .as_slice_mut()
            .map_err(|_| scattered("observations"))?;
        work::here(py, |_| bikes.reset(&seeds, which, observations))?
            .map_err(|error| told(py, error))
    }

    /// One control period of every bike; everything is written into the arrays.
    #[allow(clippy::too_many_arguments, reason = "one array each")]
    fn step(
        &self,
        py: Python<'_>,
        actions: &Bound<'_, PyArray2<f32>>,
        observations: &Bound<'_, PyArray2<f32>>,
        rewards: &Bound<'_, PyArray1<f64>>,
        terminated: &Bound<'_, PyArray1<bool>>,
        truncated: &Bound<'_, PyArray1<bool>>,
        endings: &Bound<'_, PyArray1<u8>>,
    ) -> PyResult<()> {
        let mut bikes = self.lock(py)?;
        let bikes = &mut *bikes;
        let actions = actions.try_readonly().map_err(|error| lent(&error))?;
        let mut observations = observations.try_readwrite().map_err(|error| lent(&error))?;
        let mut rewards = rewards.try_readwrite().map_err(|error| lent(&error))?;
        let mut terminated = terminated.try_readwrite().map_err(|error| lent(&error))?;
        let mut truncated = truncated.try_readwrite().map_err(|error| lent(&error))?;
        let mut endings = endings.try_readwrite().map_err(|error| lent(&error))?;
        let actions = actions.as_slice().map_err(|_| scattered("actions"))?;
        let out = Buffers {
            observations: observations
                .as_slice_mut()
                .map_err(|_| scattered("observations"))?,
            rewards: rewards.as_slice_mut().map_err(|_| scattered("rewards"))?,
            terminated: terminated
                .as_slice_mut()
                .map_err(|_| scattered("terminated"))?,
            truncated: truncated
                .as_slice_mut()
                .map_err(|_| scattered("truncated"))?,
            endings: endings.as_slice_mut().map_err(|_| scattered("endings"))?,
        };
        work::here(py, |_| bikes.step(actions, out))?.map_err(|error| told(py, error))
    }

    /// The path of the rear contact at `count` places: (count, 2), m; None where there is none.
    fn path<'py>(
        &self,
        py: Python<'py>,
        count: usize,
    ) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let Some(path) = self.course.path() else {
            return Ok(None);
        };
        let count = count.clamp(2, 1_000_000);
        let rows: Vec<f64> = (0..count)
            .flat_map(|i| {
                let s = path.length() * i as f64 / (count - 1) as f64;
                let place = path.at(s).position;
                [place.x, place.y]
            })
            .collect();
        PyArray1::from_vec(py, rows).reshape([count, 2]).map(Some)
    }
}
