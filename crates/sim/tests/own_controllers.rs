//! Controllers from outside, in closed loop: what they may do, and what becomes of one that fails.

mod common;

use bikebot_control::BalanceController;
use bikebot_control::follower::Turning;
use bikebot_control::follower::steering::SteeringFollower;
use bikebot_sim::external::{BalancerView, Declined, External, FollowerCommand, FollowerView};
use bikebot_sim::record::Trace;
use bikebot_sim::{Error, RunControl, RunOutcome, RunReport, Setup, run_with};

const COURSE: &str = include_str!("../../../scenarios/course.toml");
const STAND: &str = "format = 1\nname = \"stand\"\n[start]\nroll_deg = 2.0\n[plant]\nmodel = \"two_link\"\n\
                     [noise]\nroll_sigma_deg = 0.1\n[run]\nduration_s = 3.0\n";

fn ridden(setup: &Setup, external: External<'_>) -> Result<RunReport, Error> {
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    run_with(setup, &mut (), control, external)
}

#[test]
fn a_follower_that_does_what_ours_does_rides_the_same_ride() {
    for controller in ["pure_pursuit", "stanley", "lqr"] {
        let setup = common::setup(COURSE, &[&format!("follow.controller={controller}")]);
        let ours = common::ride(&setup, &mut ());
        let mut law: Option<SteeringFollower> = None;
        let mut same = |seen: &FollowerView<'_>| -> Result<FollowerCommand, Declined> {
            let law = law.get_or_insert_with(|| {
                SteeringFollower::new(&setup.follow, &setup.bike, &seen.projection)
            });
            let step = law.step(seen.path, seen.measured, &seen.projection);
            let Turning::SteerRate(steer_rate) = step.turning else {
                unreachable!("a steering law gives a steering rate")
            };
            Ok(FollowerCommand {
                acceleration: step.acceleration,
                steer_rate,
            })
        };
        let external = External {
            follower: Some(&mut same),
            ..External::default()
        };
        let outside = ridden(&setup, external).expect("rides");
        assert_eq!(outside.outcome, RunOutcome::Arrived);
        assert_eq!(outside.result_hash, ours.result_hash, "{controller}");
    }
}

#[test]
fn a_balance_law_that_does_what_ours_does_gives_the_same_bits() {
    let setup = common::setup(STAND, &[]);
    let ours = common::ride(&setup, &mut ());
    let period = setup.control.seconds();
    let mut law = BalanceController::new(&setup.bike, setup.mode, &setup.balance, period)
        .expect("the bike can balance");
    let mut same = |seen: &BalancerView<'_>| Ok(law.torque(seen.state).torque);
    let external = External {
        balancer: Some(&mut same),
        ..External::default()
    };
    let outside = ridden(&setup, external).expect("rides");
    assert_eq!(outside.result_hash, ours.result_hash);
    assert_eq!(outside.metrics, ours.metrics);
}

#[test]
fn a_linear_law_of_ones_own_balances_a_whole_ride() {
    // Proportional and derivative about the lean asked for: no design, and enough for the gentle course.
    let setup = common::setup(COURSE, &[]);
    let mut law = |seen: &BalancerView<'_>| {
        let [rate, ..] = seen.reference.derivatives;
        let state = seen.state;
        Ok(800.0 * (state.roll - seen.reference.value)
            + 220.0 * (state.roll_rate - rate)
            + 4.0 * state.balancer_rate)
    };
    let external = External {
        balancer: Some(&mut law),
        ..External::default()
    };
    let report = ridden(&setup, external).expect("rides");
    assert_eq!(report.outcome, RunOutcome::Arrived, "{report:#?}");
    let ours = common::ride(&setup, &mut ());
    assert_ne!(report.result_hash, ours.result_hash);
}

#[test]
fn the_log_says_that_the_scenario_alone_does_not_repeat_the_ride() {
    let setup = common::setup(STAND, &["run.duration_s=0.1"]);
    let mut trace = Trace::default();
    let mut nothing = |_: &BalancerView<'_>| Ok(0.0);
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    let external = External {
        balancer: Some(&mut nothing),
        ..External::default()
    };
    run_with(&setup, &mut trace, control, external).expect("rides");
    assert!(
        trace
            .lines
            .iter()
            .any(|line| line.text.contains("balance law is not one of ours"))
    );
}

#[test]
fn a_controller_that_declines_or_gives_no_number_ends_the_ride() {
    let setup = common::setup(STAND, &[]);
    let mut tired = |seen: &BalancerView<'_>| {
        if seen.time > 0.5 {
            Err(Declined("enough".into()))
        } else {
            Ok(0.0)
        }
    };
    let external = External {
        balancer: Some(&mut tired),
        ..External::default()
    };
    let error = ridden(&setup, external).expect_err("it declines");
    assert_eq!(error.to_string(), "the balancer gave no command: enough");

    let setup = common::setup(COURSE, &[]);
    let mut broken = |_: &FollowerView<'_>| -> Result<FollowerCommand, Declined> {
        Ok(FollowerCommand {
            acceleration: 0.1,
            steer_rate: f64::NAN,
        })
    };
    let external = External {
        follower: Some(&mut broken),
        ..External::default()
    };
    let error = ridden(&setup, external).expect_err("no number");
    assert!(
        error.to_string().contains("steering rate is NaN"),
        "{error}"
    );
}

#[test]
fn a_follower_needs_a_path() {
    let setup = common::setup(STAND, &[]);
    let mut idle = |_: &FollowerView<'_>| -> Result<FollowerCommand, Declined> {
        Ok(FollowerCommand {
            acceleration: 0.0,
            steer_rate: 0.0,
        })
    };
    let external = External {
        follower: Some(&mut idle),
        ..External::default()
    };
    assert!(matches!(
        ridden(&setup, external),
        Err(Error::NothingToFollow)
    ));
}
