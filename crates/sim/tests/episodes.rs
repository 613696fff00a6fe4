//! Episodes against the closed loop they are cut from, and many against one.

mod common;

use bikebot_sim::episode::{Bikes, Buffers, Course, Ending, Episode, EpisodeError, Spread, Task};
use bikebot_sim::external::{BalancerView, Declined, External, FollowerCommand, FollowerView};
use bikebot_sim::record::Trace;
use bikebot_sim::{RunControl, Setup, run_with};
use std::sync::Arc;

const COURSE: &str = include_str!("../../../scenarios/course.toml");
const SMOOTH: &str = include_str!("../../../scenarios/course-smooth.toml");
const STAND: &str = "format = 1\nname = \"stand\"\n[start]\nroll_deg = 2.0\n[plant]\nmodel = \"two_link\"\n\
                     [noise]\nroll_sigma_deg = 0.1\nroll_rate_sigma_radps = 0.01\n\
                     [[disturbance]]\nkind = \"push\"\ntime_s = 0.5\nimpulse_ns = 3.0\n[run]\nduration_s = 2.0\n";

fn course(setup: Setup, task: Task, spread: Spread) -> Arc<Course> {
    Arc::new(Course::new(setup, task, spread, &|| false).expect("a course"))
}

/// A ride with its numbers, by controllers from outside.
fn ridden(setup: &Setup, external: External<'_>) -> Trace {
    let mut trace = Trace::default();
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    run_with(setup, &mut trace, control, external).expect("rides");
    trace
}

/// A column of a ride.
fn column<'t>(trace: &'t Trace, name: &str) -> &'t [f64] {
    trace.state.column(name).expect("a column of that name")
}

/// Gains that balance the standing bike in flywheel mode, as shares of 70 N m.
fn share(roll: f64, roll_rate: f64, balancer_rate: f64) -> f32 {
    (12.0 * roll + 3.3 * roll_rate + 0.05 * balancer_rate) as f32
}

#[test]
fn balancing_is_the_closed_loop_with_the_agent_as_its_law() {
    let setup = common::setup(STAND, &["run.seed=5"]);
    let most = setup.bike.balancer_torque_max;
    let mut law = |seen: &BalancerView<'_>| {
        let s = seen.state;
        let action = share(s.roll, s.roll_rate, s.balancer_rate).clamp(-1.0, 1.0);
        Ok(f64::from(action) * most)
    };
    let external = External {
        balancer: Some(&mut law),
        ..External::default()
    };
    let trace = ridden(&setup, external);
    let course = course(setup, Task::Balance, Spread::NONE);
    let mut episode = Episode::new(&course, 5).expect("an episode");
    let ticks = column(&trace, "roll_rad").len();
    assert_eq!(ticks, 401);
    for tick in 0..ticks {
        let state = episode.state();
        for (name, value) in [
            ("roll_rad", state.roll),
            ("balancer_rad", state.balancer),
            ("roll_rate_radps", state.roll_rate),
            ("balancer_rate_radps", state.balancer_rate),
        ] {
            // To the last bit: the same code has to have run.
            assert_eq!(
                value.to_bits(),
                column(&trace, name)[tick].to_bits(),
                "{name} {tick}"
            );
        }
        if tick + 1 == ticks {
            break;
        }
        let m = episode.measured();
        let action = share(m.roll, m.roll_rate, m.balancer_rate);
        let step = episode.step(&[action]).expect("under way");
        let last = tick + 2 == ticks;
        assert_eq!(step.ending == Ending::Duration, last, "{tick}: {step:?}");
    }
}

#[test]
fn following_is_the_closed_loop_with_the_agent_as_its_follower() {
    let setup = common::setup(COURSE, &["run.duration_s=4.0"]);
    let (steer, speed_up) = (setup.bike.steer_rate_max, setup.follow.drive_acceleration);
    let action = |lateral: f64, speed: f64| -> [f32; 2] {
        let gas = (0.5 * (0.8 - speed)).clamp(0.0, 1.0) as f32;
        [gas, (-0.2 * lateral).clamp(-1.0, 1.0) as f32]
    };
    let mut law = |seen: &FollowerView<'_>| -> Result<FollowerCommand, Declined> {
        let [gas, turn] = action(seen.measured.pose.position.y, seen.measured.speed);
        Ok(FollowerCommand {
            acceleration: f64::from(gas) * speed_up,
            steer_rate: f64::from(turn) * steer,
        })
    };
    let external = External {
        follower: Some(&mut law),
        ..External::default()
    };
    let trace = ridden(&setup, external);
    let seed = setup.seed;
    let course = course(setup, Task::Follow, Spread::NONE);
    let mut episode = Episode::new(&course, seed).expect("an episode");
    let ticks = column(&trace, "x_m").len();
    assert!(ticks > 300, "{ticks}");
    for tick in 0..ticks {
        let state = *episode.state();
        for (name, value) in [
            ("x_m", state.pose.position.x),
            ("y_m", state.pose.position.y),
            ("heading_rad", state.pose.heading),
            ("steer_rad", state.steer),
            ("roll_rad", state.roll),
            ("speed_mps", state.speed),
        ] {
            assert_eq!(
                value.to_bits(),
                column(&trace, name)[tick].to_bits(),
                "{name} {tick}"
            );
        }
        let [gas, turn] = action(state.pose.position.y, state.speed);
        if episode.step(&[gas, turn]).expect("under way").ending != Ending::None {
            break;
        }
    }
}

/// Rows of every outcome, as bits.
fn recorded(bikes: &mut Bikes, steps: usize) -> Vec<u64> {
    let task = bikes.course().task();
    let (count, width, wide) = (
        bikes.bikes().len(),
        task.observations().len(),
        task.actions().len(),
    );
    let mut observations = vec![0.0; count * width];
    let mut rewards = vec![0.0; count];
    let (mut terminated, mut truncated) = (vec![false; count], vec![false; count]);
    let mut endings = vec![0; count];
    let mut found = Vec::new();
    let seeds: Vec<Option<u64>> = (0..count as u64).map(|i| Some(100 + i)).collect();
    bikes
        .reset(&seeds, None, &mut observations)
        .expect("resets");
    for step in 0..steps {
        let actions: Vec<f32> = (0..count * wide)
            .map(|i| ((i * 7 + step) as f32 * 0.37).sin())
            .collect();
        bikes
            .step(
                &actions,
                Buffers {
                    observations: &mut observations,
                    rewards: &mut rewards,
                    terminated: &mut terminated,
                    truncated: &mut truncated,
                    endings: &mut endings,
                },
            )
            .expect("steps");
        for i in 0..count {
            found.extend(
                observations[i * width..(i + 1) * width]
                    .iter()
                    .map(|value| u64::from(value.to_bits())),
            );
            found.push(rewards[i].to_bits());
            found.push(u64::from(endings[i]));
            found.push(u64::from(terminated[i]) + 2 * u64::from(truncated[i]));
        }
    }
    found
}

#[test]
fn many_bikes_on_any_number_of_threads_are_as_many_alone() {
    for (text, changes, task, count, steps) in [
        (STAND, &["run.duration_s=0.6"][..], Task::Balance, 67, 400),
        (COURSE, &["run.duration_s=1.0"][..], Task::Ride, 35, 300),
        (COURSE, &["run.duration_s=0.5"][..], Task::Follow, 33, 120),
    ] {
        let course = course(common::setup(text, changes), task, Spread::of(task));
        let seeds = vec![0; count];
        let on = |threads| {
            let mut bikes = Bikes::new(course.clone(), &seeds, threads).expect("bikes");
            recorded(&mut bikes, steps)
        };
        let one = on(1);
        assert_eq!(one, on(2), "{task:?}");
        assert_eq!(one, on(5), "{task:?}");

        // Alone, with the same actions, and begun again in the step after an end.
        let width = task.observations().len();
        let wide = task.actions().len();
        let row = width + 3;
        for i in [0, 1, count - 1] {
            let mut episode = Episode::new(&course, 100 + i as u64).expect("an episode");
            let mut endings = 0;
            for step in 0..steps {
                let action: Vec<f32> = (i * wide..(i + 1) * wide)
                    .map(|k| ((k * 7 + step) as f32 * 0.37).sin())
                    .collect();
                let (reward, ending) = if episode.is_over() {
                    episode.reset_next().expect("resets");
                    (0.0, Ending::None)
                } else {
                    let step = episode.step(&action).expect("steps");
                    (step.reward, step.ending)
                };
                endings += usize::from(ending != Ending::None);
                let mut seen = vec![0.0; width];
                episode.observe(&mut seen).expect("observes");
                let at = (step * count + i) * row;
                let expected = &one[at..at + row];
                let bits: Vec<u64> = seen.iter().map(|it| u64::from(it.to_bits())).collect();
                assert_eq!(bits, expected[..width], "{task:?} bike {i} step {step}");
                assert_eq!(reward.to_bits(), expected[width]);
                assert_eq!(ending as u64, expected[width + 1]);
            }
            assert!(endings > 0, "{task:?}: nothing was begun again");
        }
    }
}

#[test]
fn starts_and_noise_differ_from_episode_to_episode_and_repeat_with_the_seed() {
    let course = course(
        common::setup(STAND, &[]),
        Task::Balance,
        Spread::of(Task::Balance),
    );
    let begin = |seed| Episode::new(&course, seed).expect("an episode");
    let (mut one, other) = (begin(1), begin(2));
    let first = (*one.state(), *one.measured());
    assert_ne!(first.0, *other.state());
    assert_ne!(first.0.roll, first.1.roll, "the sensors are noisy");
    one.reset_next().expect("resets");
    assert_ne!(first.0, *one.state());
    one.reset(1).expect("resets");
    assert_eq!(first, (*one.state(), *one.measured()));
    let around = 2f64.to_radians();
    for seed in 0..200 {
        let state = *begin(seed).state();
        assert!((state.roll - around).abs() <= 0.03 && state.balancer.abs() <= 0.1);
    }
}

#[test]
fn an_episode_ends_in_a_fall_or_when_its_time_is_over() {
    let setup = common::setup(STAND, &["bike.mode=balancer"]);
    let course = course(setup, Task::Balance, Spread::NONE);
    let mut episode = Episode::new(&course, 1).expect("an episode");
    let ending = loop {
        let step = episode.step(&[0.0]).expect("under way");
        assert!(step.reward.is_finite());
        if step.ending != Ending::None {
            break step.ending;
        }
    };
    assert_eq!(ending, Ending::Roll);
    assert!(episode.state().roll.abs() > 0.7 && episode.is_over());
    assert!(matches!(
        episode.step(&[0.0]),
        Err(EpisodeError::Over { bike: 0 })
    ));
}

#[test]
fn a_bike_led_along_the_course_arrives() {
    // Towards the curve and along its profile: what the observation says is enough to ride by.
    let setup = common::setup(SMOOTH, &["follow.max_speed_mps=1.0"]);
    let names: Vec<&str> = Task::Follow.observations().iter().map(|it| it.0).collect();
    let at = |name: &str| names.iter().position(|it| *it == name).expect("a name");
    let [beside, turned, speed, wanted, steer, bend] = [
        "lateral_error_m",
        "heading_error_rad",
        "speed_mps",
        "speed_reference_mps",
        "steer_rad",
        "path_curvature_ahead_0.5m_per_m",
    ]
    .map(at);
    let wheelbase = setup.bike.wheelbase as f32;
    let ahead = setup.follow.look_ahead as f32;
    let course = course(setup, Task::Follow, Spread::of(Task::Follow));
    for seed in 0..3 {
        let mut episode = Episode::new(&course, seed).expect("an episode");
        let mut seen = vec![0.0; names.len()];
        let mut total = 0.0;
        let ending = loop {
            episode.observe(&mut seen).expect("observes");
            // The followed point, ahead of the rear contact, moves to the side the bike turns to.
            let drift = seen[turned] + (ahead / wheelbase * seen[steer].tan()).atan();
            let curvature = seen[bend] - 2.0 * seen[beside] - 2.0 * drift;
            let angle = (wheelbase * curvature).atan();
            let action = [
                2.0 * (seen[wanted] - seen[speed]),
                2.0 * (angle - seen[steer]),
            ];
            let step = episode.step(&action).expect("under way");
            total += step.reward;
            if step.ending != Ending::None {
                break step.ending;
            }
        };
        assert_eq!(ending, Ending::AtGoal, "seed {seed}");
        // The course is 10.6 m long; what is beside it costs.
        assert!(total > 8.0, "seed {seed}: {total}");
    }
}

#[test]
fn what_does_not_fit_the_task_is_refused() {
    let refused = |text: &str, changes: &[&str], task| {
        Course::new(common::setup(text, changes), task, Spread::NONE, &|| false)
            .expect_err("refused")
            .to_string()
    };
    assert!(refused(COURSE, &[], Task::Balance).contains("two_link"));
    assert!(refused(STAND, &[], Task::Ride).contains("no path to follow"));
    let kinematic = refused(COURSE, &["plant.model=kinematic"], Task::Follow);
    assert!(kinematic.contains("bike3d"), "{kinematic}");
    let spread = Spread {
        lateral: f64::NAN,
        ..Spread::NONE
    };
    assert!(Course::new(common::setup(STAND, &[]), Task::Balance, spread, &|| false).is_err());
}

#[test]
fn a_step_that_is_refused_moves_no_bike() {
    let course = course(common::setup(STAND, &[]), Task::Balance, Spread::NONE);
    let mut bikes = Bikes::new(course, &[1, 2, 3], 1).expect("bikes");
    let before = *bikes.bikes()[0].state();
    let mut observations = [0.0; 12];
    let mut rewards = [0.0; 3];
    let (mut terminated, mut truncated, mut endings) = ([false; 3], [false; 3], [0; 3]);
    for actions in [&[0.0, f32::NAN, 0.0][..], &[0.0, 0.0], &[0.0; 4]] {
        let out = Buffers {
            observations: &mut observations,
            rewards: &mut rewards,
            terminated: &mut terminated,
            truncated: &mut truncated,
            endings: &mut endings,
        };
        assert!(bikes.step(actions, out).is_err());
        assert_eq!(before, *bikes.bikes()[0].state());
    }
}
