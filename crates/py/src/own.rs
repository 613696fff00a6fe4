//! Controllers of the caller's own: Python callables as follower and as balance law.

use std::cell::RefCell;
use std::sync::Arc;

use bikebot_sim::external::{
    BalancerView, Declined, External, ExternalBalancer, ExternalFollower, FollowerCommand,
    FollowerView,
};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyString};

use crate::arguments::type_name;
use crate::arrays::lend;
use crate::errors::{kind, value};

/// Spacing of the rows of the followed curve, m: as in a ride.
const SPACING: f64 = 0.05;

/// The callables of a ride.
#[derive(Default)]
pub struct Own {
    pub follower: Option<Py<PyAny>>,
    pub balancer: Option<Py<PyAny>>,
}

impl Own {
    /// Out of the arguments of those names.
    pub fn new(
        follower: Option<&Bound<'_, PyAny>>,
        balancer: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let callable = |name: &str, takes: &str, object: Option<&Bound<'_, PyAny>>| match object {
            Some(object) if !object.is_callable() => Err(kind(format!(
                "{name} takes a function of {takes}, not {}",
                type_name(object)
            ))),
            object => Ok(object.map(|object| object.clone().unbind())),
        };
        Ok(Self {
            follower: callable(
                "follower",
                "a FollowerView that returns (acceleration in m/s², steering rate in rad/s)",
                follower,
            )?,
            balancer: callable(
                "balancer",
                "a BalancerView that returns a torque in N m",
                balancer,
            )?,
        })
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.follower.is_none() && self.balancer.is_none()
    }

    /// Does `work` with them; what one of them raises comes back as it is.
    pub fn lend<T>(&self, work: impl FnOnce(External<'_>) -> T) -> Result<T, PyErr> {
        let raised = RefCell::new(None);
        let mut follower = self.follower.as_ref().map(|call| Follower {
            call,
            raised: &raised,
            curve: None,
        });
        let mut balancer = self.balancer.as_ref().map(|call| Balancer {
            call,
            raised: &raised,
        });
        let result = work(External {
            time: 0.0,
            follower: follower.as_mut().map(|it| it as &mut dyn ExternalFollower),
            balancer: balancer.as_mut().map(|it| it as &mut dyn ExternalBalancer),
        });
        match raised.take() {
            Some(error) => Err(error),
            None => Ok(result),
        }
    }
}

/// Calls with the interpreter attached, and keeps what is raised.
fn asked<T>(
    raised: &RefCell<Option<PyErr>>,
    ask: impl FnOnce(Python<'_>) -> PyResult<T>,
) -> Result<T, Declined> {
    match Python::try_attach(ask) {
        Some(Ok(answer)) => Ok(answer),
        Some(Err(error)) => {
            let said = Declined(error.to_string());
            raised.replace(Some(error));
            Err(said)
        }
        None => Err(Declined("the interpreter has ended".into())),
    }
}

/// A finite number that a callable has returned.
fn returned(who: &str, what: &str, time: f64, object: &Bound<'_, PyAny>) -> PyResult<f64> {
    let refuse = || {
        kind(format!(
            "{who} returned {} at {time} s: it has to return {what}",
            type_name(object)
        ))
    };
    // numpy has float() of an array of one number, with a warning, and of a complex number, too.
    let is_array = object
        .getattr_opt("ndim")?
        .is_some_and(|ndim| ndim.extract::<usize>().is_ok_and(|ndim| ndim > 0));
    if is_array
        || object.is_instance_of::<PyBool>()
        || object.is_instance_of::<PyString>()
        || type_name(object).starts_with("complex")
    {
        return Err(refuse());
    }
    let number: f64 = object.extract().map_err(|_| refuse())?;
    if number.is_finite() {
        Ok(number)
    } else {
        Err(value(format!(
            "{who} returned {number} at {time} s: it has to return {what}, and finite"
        )))
    }
}

struct Balancer<'a> {
    call: &'a Py<PyAny>,
    raised: &'a RefCell<Option<PyErr>>,
}

impl ExternalBalancer for Balancer<'_> {
    fn balance(&mut self, seen: &BalancerView<'_>) -> Result<f64, Declined> {
        asked(self.raised, |py| {
            let view = Bound::new(py, PyBalancerView::from(seen))?;
            let answer = self.call.bind(py).call1((view,))?;
            returned(
                "balancer",
                "the torque of the frame on the balancer, a number in N m",
                seen.time,
                &answer,
            )
        })
    }
}

/// The followed curve as last converted, with what it was made of.
type Curve = (
    Arc<Vec<bikebot_sim::external::PathSample>>,
    Py<PyArray2<f64>>,
);

struct Follower<'a> {
    call: &'a Py<PyAny>,
    raised: &'a RefCell<Option<PyErr>>,
    curve: Option<Curve>,
}

impl Follower<'_> {
    /// The followed curve as an array, made anew when another is followed.
    fn curve(&mut self, py: Python<'_>, seen: &FollowerView<'_>) -> PyResult<Py<PyArray2<f64>>> {
        let samples = seen.path.shared_samples();
        if let Some((of, array)) = &self.curve
            && Arc::ptr_eq(of, samples)
        {
            return Ok(array.clone_ref(py));
        }
        let step = seen.path.step();
        let every = (SPACING / step).round().max(1.0) as usize;
        let rows: Vec<f64> = samples
            .iter()
            .enumerate()
            .step_by(every)
            .flat_map(|(i, p)| {
                let s = i as f64 * step;
                [
                    p.position.x,
                    p.position.y,
                    p.heading,
                    p.curvature,
                    s,
                    p.speed,
                ]
            })
            .collect();
        let count = rows.len() / 6;
        let array = PyArray1::from_vec(py, rows).reshape([count, 6])?;
        array.readwrite().make_nonwriteable();
        let array = array.unbind();
        self.curve = Some((samples.clone(), array.clone_ref(py)));
        Ok(array)
    }
}

impl ExternalFollower for Follower<'_> {
    fn follow(&mut self, seen: &FollowerView<'_>) -> Result<FollowerCommand, Declined> {
        let raised = self.raised;
        asked(raised, |py| {
            let path = self.curve(py, seen)?;
            let view = Bound::new(py, PyFollowerView::new(seen, path))?;
            let answer = self.call.bind(py).call1((view,))?;
            const FORM: &str = "(acceleration in m/s², steering rate in rad/s), a sequence or an array of two numbers";
            let refuse = |what: String| {
                format!(
                    "follower returned {what} at {} s: it has to return {FORM}",
                    seen.time
                )
            };
            if answer.is_instance_of::<PyString>() {
                return Err(kind(refuse("str".into())));
            }
            let parts = answer
                .try_iter()
                .map_err(|_| kind(refuse(type_name(&answer))))?
                .take(3)
                .collect::<PyResult<Vec<_>>>()?;
            let [acceleration, steer_rate] = &parts[..] else {
                let many = if parts.len() > 2 {
                    "more than 2".into()
                } else {
                    parts.len().to_string()
                };
                return Err(value(refuse(format!("{many} numbers"))));
            };
            Ok(FollowerCommand {
                acceleration: returned("follower", FORM, seen.time, acceleration)?,
                steer_rate: returned("follower", FORM, seen.time, steer_rate)?,
            })
        })
    }
}

/// What a balance law of your own is shown at a control tick: what the sensors say, by the names of a recording.
///
/// `state` is the same as an array: (roll_rad, balancer_rad, roll_rate_radps, balancer_rate_radps).
#[pyclass(name = "BalancerView", module = "bikebot", frozen)]
pub struct PyBalancerView {
    /// Time since the start of the ride, s.
    #[pyo3(get)]
    time_s: f64,
    /// Control period: the answer holds so long, s.
    #[pyo3(get)]
    period_s: f64,
    /// Roll, rad, positive to the right.
    #[pyo3(get)]
    roll_rad: f64,
    /// Angle of the balancer against the frame, rad, same sense; counts turns.
    #[pyo3(get)]
    balancer_rad: f64,
    /// Roll rate, rad/s.
    #[pyo3(get)]
    roll_rate_radps: f64,
    /// Rate of the balancer, rad/s.
    #[pyo3(get)]
    balancer_rate_radps: f64,
    /// The lean asked for, rad: that of the turn, with the share of the roll moment felt.
    #[pyo3(get)]
    roll_reference_rad: f64,
    /// Its rate, rad/s.
    #[pyo3(get)]
    roll_reference_rate_radps: f64,
    /// Centripetal acceleration of the turn the bike is in, m/s², positive to the left; 0 while it stands.
    #[pyo3(get)]
    centripetal_mps2: f64,
    /// Yaw rate, rad/s.
    #[pyo3(get)]
    yaw_rate_radps: f64,
    /// Yaw acceleration, rad/s².
    #[pyo3(get)]
    yaw_acceleration_radps2: f64,
    /// Estimated roll moment from outside, N m; 0 without the observer ([balance] observer).
    #[pyo3(get)]
    roll_moment_estimate_nm: f64,
    /// Distance of the balancer's centre of gravity above its pivot, m.
    #[pyo3(get)]
    balancer_offset_m: f64,
    state: Vec<f64>,
}

impl From<&BalancerView<'_>> for PyBalancerView {
    fn from(seen: &BalancerView<'_>) -> Self {
        let state = seen.state;
        Self {
            time_s: seen.time,
            period_s: seen.period,
            roll_rad: state.roll,
            balancer_rad: state.balancer,
            roll_rate_radps: state.roll_rate,
            balancer_rate_radps: state.balancer_rate,
            roll_reference_rad: seen.reference.value,
            roll_reference_rate_radps: seen.reference.derivatives[0],
            centripetal_mps2: seen.turn.centripetal,
            yaw_rate_radps: seen.turn.yaw_rate,
            yaw_acceleration_radps2: seen.turn.yaw_acceleration,
            roll_moment_estimate_nm: seen.moment_estimate,
            balancer_offset_m: seen.offset,
            state: vec![
                state.roll,
                state.balancer,
                state.roll_rate,
                state.balancer_rate,
            ],
        }
    }
}

#[pymethods]
impl PyBalancerView {
    /// (roll_rad, balancer_rad, roll_rate_radps, balancer_rate_radps), a read-only array.
    #[getter]
    fn state<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        lend(this, &this.get().state)
    }

    fn __repr__(&self) -> String {
        format!(
            "BalancerView({} s, roll {} rad at {} rad/s, balancer {} rad at {} rad/s)",
            self.time_s,
            self.roll_rad,
            self.roll_rate_radps,
            self.balancer_rad,
            self.balancer_rate_radps
        )
    }
}

/// What a path follower of your own is shown at a control tick: what the sensors say, by the names of a recording, and where
/// that is on the curve.
///
/// `state` is the first of it as an array: (x_m, y_m, heading_rad, steer_rad, roll_rad, balancer_rad, speed_mps,
/// roll_rate_radps, balancer_rate_radps, steer_rate_radps). `path` is the curve: (n, 6) with x, y, heading, curvature, s, speed.
#[pyclass(name = "FollowerView", module = "bikebot", frozen)]
pub struct PyFollowerView {
    /// Time since the start of the ride, s.
    #[pyo3(get)]
    time_s: f64,
    /// Control period: the answer holds so long, s.
    #[pyo3(get)]
    period_s: f64,
    /// Rear contact, x, m.
    #[pyo3(get)]
    x_m: f64,
    /// Rear contact, y, m.
    #[pyo3(get)]
    y_m: f64,
    /// Heading, rad, counter-clockwise from +x.
    #[pyo3(get)]
    heading_rad: f64,
    /// Steering angle projected to the ground, rad, positive to the left.
    #[pyo3(get)]
    steer_rad: f64,
    /// Roll, rad, positive to the right.
    #[pyo3(get)]
    roll_rad: f64,
    /// Angle of the balancer, rad.
    #[pyo3(get)]
    balancer_rad: f64,
    /// Speed of the rear contact, m/s.
    #[pyo3(get)]
    speed_mps: f64,
    /// Roll rate, rad/s.
    #[pyo3(get)]
    roll_rate_radps: f64,
    /// Rate of the balancer, rad/s.
    #[pyo3(get)]
    balancer_rate_radps: f64,
    /// Steering rate, rad/s.
    #[pyo3(get)]
    steer_rate_radps: f64,
    /// Foot of the followed point: arc length along the curve, m.
    #[pyo3(get)]
    path_s_m: f64,
    /// The foot, x, m.
    #[pyo3(get)]
    path_x_m: f64,
    /// The foot, y, m.
    #[pyo3(get)]
    path_y_m: f64,
    /// Heading of the curve there, rad.
    #[pyo3(get)]
    path_heading_rad: f64,
    /// Its curvature there, 1/m, positive to the left.
    #[pyo3(get)]
    path_curvature_per_m: f64,
    /// Speed of the profile there, m/s.
    #[pyo3(get)]
    speed_reference_mps: f64,
    /// Distance of the followed point beside the curve, m, positive to the left.
    #[pyo3(get)]
    lateral_error_m: f64,
    /// How far ahead of the rear contact the followed point lies, m.
    #[pyo3(get)]
    look_ahead_m: f64,
    /// Way of the rear contact to the end of the path, m; negative past it.
    #[pyo3(get)]
    remaining_m: f64,
    state: Vec<f64>,
    path: Py<PyArray2<f64>>,
}

impl PyFollowerView {
    fn new(seen: &FollowerView<'_>, path: Py<PyArray2<f64>>) -> Self {
        let (m, here) = (seen.measured, seen.reference);
        Self {
            time_s: seen.time,
            period_s: seen.period,
            x_m: m.pose.position.x,
            y_m: m.pose.position.y,
            heading_rad: m.pose.heading,
            steer_rad: m.steer,
            roll_rad: m.roll,
            balancer_rad: m.balancer,
            speed_mps: m.speed,
            roll_rate_radps: m.roll_rate,
            balancer_rate_radps: m.balancer_rate,
            steer_rate_radps: m.steer_rate,
            path_s_m: seen.projection.s,
            path_x_m: here.position.x,
            path_y_m: here.position.y,
            path_heading_rad: here.heading,
            path_curvature_per_m: here.curvature,
            speed_reference_mps: here.speed,
            lateral_error_m: seen.projection.lateral,
            look_ahead_m: seen.ahead,
            remaining_m: seen.remaining,
            state: vec![
                m.pose.position.x,
                m.pose.position.y,
                m.pose.heading,
                m.steer,
                m.roll,
                m.balancer,
                m.speed,
                m.roll_rate,
                m.balancer_rate,
                m.steer_rate,
            ],
            path,
        }
    }
}

#[pymethods]
impl PyFollowerView {
    /// What the sensors say, as a read-only array of shape (10,).
    #[getter]
    fn state<'py>(this: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        lend(this, &this.get().state)
    }

    /// The curve to be followed, as `Ride.followed`: a read-only array of shape (n, 6), the same object as long as the curve is.
    #[getter]
    fn path(&self, py: Python<'_>) -> Py<PyArray2<f64>> {
        self.path.clone_ref(py)
    }

    fn __repr__(&self) -> String {
        format!(
            "FollowerView({} s, {} m along, {} m beside, {} m/s)",
            self.time_s, self.path_s_m, self.lateral_error_m, self.speed_mps
        )
    }
}
