//! The true bike with everything mounted on it: plant, motors, sensors, and what the world does to them.
//!
//! One control period of it is [`TrueBike::measure`], a command from whoever rides, and [`TrueBike::act`].
//! The closed loop rides it with our controllers, [`crate::episode`] with an agent's actions.

use crate::disturbance::{Disturbances, MotorFaults, SensorFaults};
use crate::setup::Setup;
use crate::true_plant::{TruePlant, true_offset};
use bikebot_dynamics::{
    Actuators, BikeInput, BikeState, Command, DynamicsError, Measurement, Offset, Saturation,
    Sensors,
};
use rand_chacha::ChaCha8Rng;

/// The true bike of a scenario, in motion.
#[derive(Debug)]
pub(crate) struct TrueBike {
    pub plant: TruePlant,
    pub state: BikeState,
    /// What acted on it when the last period began.
    pub input: BikeInput,
    /// Friction of the ground under the rear and the front wheel when the last period began.
    pub friction: [f64; 2],
    pub disturbances: Disturbances,
    pub actuators: Actuators,
    motor_faults: MotorFaults,
    sensors: Sensors,
    sensor_faults: SensorFaults,
}

impl TrueBike {
    /// The true bike of `setup`, put down in `state` while its controller has the balancer shifted to
    /// `commanded`; `rng` is the noise of its sensors.
    pub fn new(
        setup: &Setup,
        state: BikeState,
        commanded: Offset,
        rng: ChaCha8Rng,
    ) -> Result<Self, DynamicsError> {
        let offset = true_offset(&setup.bike, &setup.true_bike, setup.mode, commanded);
        let plant = TruePlant::new(setup, &state, offset)?;
        Ok(Self {
            actuators: Actuators::new(plant.params()),
            motor_faults: MotorFaults::new(plant.params()),
            disturbances: Disturbances::new(&setup.disturbances, plant.params()),
            friction: [plant.params().friction; 2],
            sensors: Sensors::new(&setup.noise, &setup.bike, setup.control.seconds(), rng),
            sensor_faults: SensorFaults::new(
                &setup.disturbances,
                setup.control,
                setup.bike.wheelbase,
                setup.noise.odometry_replay,
            ),
            input: BikeInput {
                offset,
                ..BikeInput::default()
            },
            plant,
            state,
        })
    }

    /// What the sensors say at time `t` (s), faults and all. Once per control period, in order of time.
    pub fn measure(&mut self, t: f64) -> Measurement {
        let measured = self
            .sensors
            .measure(t, &self.state, self.actuators.steer_rate());
        self.sensor_faults.bend(&self.disturbances, t, &measured)
    }

    /// One control period from `t` (s) on under `command`, with the balancer where the controller wants it;
    /// `stepped` is told states and input of each integration step, and its length (s).
    pub fn act(
        &mut self,
        setup: &Setup,
        t: f64,
        command: &Command,
        commanded: Offset,
        mut stepped: impl FnMut(&BikeState, &BikeState, &BikeInput, f64),
    ) -> Saturation {
        let dt = setup.step.seconds();
        let steps = setup.control.nanoseconds() / setup.step.nanoseconds();
        let mut saturation = Saturation::default();
        let offset = true_offset(&setup.bike, &setup.true_bike, setup.mode, commanded);
        let mass = self.plant.params().mass();
        self.plant.begin_tick();
        for step in 0..steps {
            let t = t + step as f64 * dt;
            let bent = self.motor_faults.bend(&self.disturbances, t, dt, command);
            let applied = self.actuators.apply(
                &bent.command,
                self.state.steer,
                self.state.balancer_rate,
                dt,
            );
            saturation = saturation.or(applied.saturation).or(bent.saturation);
            let loads = self.disturbances.at(t, dt, &self.state);
            let mut input = loads.on(
                BikeInput {
                    drive_force: applied.drive_force,
                    steer_rate: applied.steer_rate,
                    balancer_torque: applied.balancer_torque,
                    offset,
                    ..BikeInput::default()
                },
                mass,
            );
            if bent.steering_is_stuck {
                input.steer_rate = 0.0;
                self.actuators.stop_steering();
            }
            if bent.balancer_is_stuck {
                input.balancer_torque = self.plant.jamming_torque(&self.state, &input, dt);
            }
            if step == 0 {
                self.input = input;
                self.friction = loads.friction;
            }
            let before = self.state;
            if !setup.traffic.is_empty() {
                self.plant.move_obstacles(&setup.traffic, t + dt);
            }
            self.state = self.plant.step(t, &before, &input, loads.friction, dt);
            stepped(&before, &self.state, &input, dt);
            // What is no number is not stepped any further: the judge names it.
            if !self.state.is_finite() {
                break;
            }
        }
        saturation
    }
}
