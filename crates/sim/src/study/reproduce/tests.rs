//! Verdicts over measurements made by hand, and one small study that is really made.

use super::*;
use crate::outcome::Metrics;
use crate::study::Spread;
use crate::study::table2::{Row as TableRow, Table2, paper_figures};
use std::collections::BTreeSet;

fn table_row(method: Method, name: &'static str, found: u64) -> TableRow {
    let paper = paper_figures(method);
    let spread = |value: Option<f64>| value.and_then(|value| Spread::of([value]));
    TableRow {
        method: name,
        curvature_limited: method.is_curvature_limited(),
        deterministic: method.is_deterministic(),
        runs: 10,
        found,
        time_s: spread(paper.and_then(|it| it.time_s).or(Some(2.0))),
        length_m: spread(paper.map(|it| it.length_m).or(Some(176.0))),
        roughness: spread(paper.map(|it| it.roughness).or(Some(5e-7))),
        roughness_fixed_step: None,
        max_curvature_per_m: method.is_curvature_limited().then_some(0.9),
        curvature_jump_per_m: method.is_curvature_limited().then_some(1e-12),
        goal_gap_m: None,
        paper,
    }
}

fn rides() -> Rides {
    let ride = |seed| Ridden {
        seed,
        outcome: RunOutcome::Arrived,
        reason: "at_goal".into(),
        metrics: Metrics {
            lateral_error_max_m: Some(0.01),
            rear_error_max_m: Some(0.015),
            end_position_error_m: Some(0.001),
            end_heading_error_deg: Some(0.1),
            roll_max_deg: Some(5.0),
            speed_max_mps: Some(1.5),
            corner_speed_mps: Some(1.0),
            wheel_load_min_n: Some(180.0),
            min_clearance_m: Some(0.1),
            passivity_violations: Some(0),
            replans: Some(3),
            ..Metrics::default()
        },
        result_hash: String::new(),
    };
    Rides(vec![ride(1), ride(2)])
}

/// The paper's own figures, as if we had measured them, and rides as they should be.
fn as_the_paper_has_it() -> Measured {
    let mut rows: Vec<TableRow> = Method::ALL
        .into_iter()
        .map(|method| table_row(method, method.name(), 10))
        .collect();
    rows.push(table_row(Method::Full, "full_smooth", 10));
    Measured {
        runs: 10,
        rides: 2,
        seed: 1,
        table2: Table2 {
            rows,
            runs: 10,
            seed: 1,
            interrupted: false,
        },
        as_printed: Found { runs: 10, found: 0 },
        flywheel: rides(),
        balancer: rides(),
        rigid: rides().0.pop(),
        unknown: rides(),
        lean_flywheel_deg: 11.0,
        lean_balancer_deg: 9.0,
    }
}

fn verdict(measured: &Measured, id: &str) -> Verdict {
    let all = judge(measured);
    let found = all.iter().find(|judged| judged.id == id);
    found.unwrap_or_else(|| panic!("no claim {id}")).verdict
}

#[test]
fn the_papers_own_figures_meet_its_claims() {
    for judged in judge(&as_the_paper_has_it()) {
        let wanted = if judged.id == "as-printed" {
            Verdict::Differs
        } else {
            Verdict::Holds
        };
        assert_eq!(judged.verdict, wanted, "{judged:?}");
        assert_eq!(judged.difference.is_some(), wanted == Verdict::Differs);
    }
}

/// For each claim a measurement that breaks it, and whether that is told as a failure or as a known difference.
#[test]
fn every_claim_can_fail() {
    type Break = fn(&mut Measured);
    fn of<'m>(m: &'m mut Measured, name: &str) -> &'m mut TableRow {
        let mut rows = m.table2.rows.iter_mut();
        rows.find(|row| row.method == name).unwrap()
    }
    fn lengthen(m: &mut Measured, name: &str, to: f64) {
        of(m, name).length_m = Spread::of([to]);
    }
    fn roughen(m: &mut Measured, name: &str, to: f64) {
        of(m, name).roughness = Spread::of([to]);
    }
    let broken: &[(&str, Break)] = &[
        ("finds-a-path", |m| of(m, "paper").found = 9),
        ("as-printed", |m| m.as_printed.found = 0),
        ("curvature-limit", |m| {
            of(m, "paper").max_curvature_per_m = Some(1.001);
        }),
        ("shortest", |m| lengthen(m, "birrt_smooth", 177.0)),
        ("shortest-linear", |m| {
            lengthen(m, "mpc_linear_program", 177.0);
        }),
        ("length", |m| lengthen(m, "paper", 183.0)),
        ("roughness", |m| roughen(m, "paper", 1.7e-4)),
        ("time", |m| of(m, "paper").time_s = Spread::of([1.5])),
        ("faster", |m| of(m, "laplace").time_s = Spread::of([1.4])),
        ("trees-are-long", |m| lengthen(m, "birrt", 230.0)),
        ("tree-lengths", |m| lengthen(m, "rrt", 300.0)),
        ("smoothing-shortens", |m| roughen(m, "birrt_smooth", 1e-3)),
        ("corridor-smooths", |m| lengthen(m, "paper", 178.8)),
        ("mpc-is-smoothest", |m| roughen(m, "laplace", 6e-7)),
        ("rides", |m| m.flywheel.0[1].outcome = RunOutcome::Stopped),
        ("rides-balancer", |m| m.balancer.0.clear()),
        ("on-the-curve", |m| {
            m.balancer.0[0].metrics.lateral_error_max_m = Some(0.021);
        }),
        ("slows-down", |m| {
            for ride in &mut m.flywheel.0 {
                ride.metrics.corner_speed_mps = Some(1.5);
            }
            for ride in &mut m.balancer.0 {
                ride.metrics.corner_speed_mps = Some(1.4);
            }
        }),
        ("in-balance", |m| {
            m.flywheel.0[0].metrics.wheel_load_min_n = Some(40.0);
        }),
        ("passive", |m| {
            m.flywheel.0[0].metrics.passivity_violations = Some(1);
        }),
        ("both-modes", |m| m.lean_balancer_deg = 4.9),
        ("flywheel-is-stronger", |m| m.lean_flywheel_deg = 9.0),
        ("on-line", |m| m.unknown.0[0].metrics.replans = Some(0)),
        ("full-beats-both", |m| roughen(m, "full_smooth", 7e-7)),
        ("full-is-continuous", |m| {
            of(m, "full").curvature_jump_per_m = Some(0.1);
        }),
        ("on-rigid-bodies", |m| {
            m.rigid.as_mut().unwrap().outcome = RunOutcome::Fell;
        }),
    ];
    assert_eq!(broken.len(), CLAIMS.len());
    for (id, spoil) in broken {
        let mut measured = as_the_paper_has_it();
        spoil(&mut measured);
        let is_known = CLAIMS
            .iter()
            .any(|claim| claim.id == *id && claim.difference.is_some());
        let wanted = if is_known {
            Verdict::Differs
        } else {
            Verdict::Fails
        };
        // An empty list of rides has no errors to be judged by, but none has arrived either.
        assert_eq!(verdict(&measured, id), wanted, "{id}");
    }
}

#[test]
fn what_was_not_measured_neither_holds_nor_fails() {
    let mut measured = as_the_paper_has_it();
    measured.rigid = None;
    assert_eq!(verdict(&measured, "on-rigid-bodies"), Verdict::NotMeasured);
}

#[test]
fn a_difference_that_has_gone_away_holds() {
    let mut measured = as_the_paper_has_it();
    measured.as_printed.found = 3;
    assert_eq!(verdict(&measured, "as-printed"), Verdict::Holds);
}

#[test]
fn every_claim_says_what_it_takes_and_how_to_measure_it() {
    let mut ids = BTreeSet::new();
    for judged in judge(&as_the_paper_has_it()) {
        assert!(ids.insert(judged.id), "{} stands twice", judged.id);
        assert!(!judged.criterion.is_empty() && !judged.claim.is_empty());
        assert!(judged.command.starts_with("bikebot "), "{}", judged.command);
        assert!(!judged.command.contains('{') || judged.command.contains("[\""));
        for word in judged.command.split_whitespace() {
            if word.starts_with("scenarios/") {
                assert!(FILES.iter().any(|file| file.path == word), "{word}");
            }
        }
    }
}

/// One run of everything: what is told of a ride is what the scenario gives when it is ridden by itself.
#[test]
fn the_study_measures_what_the_commands_measure() {
    let ticks = std::sync::atomic::AtomicU64::new(0);
    let study = ReproduceStudy {
        runs: 1,
        rides: 1,
        seed: 3,
        jobs: 2,
        // A clock of the test's own: a second at each look.
        clock: &|| ticks.fetch_add(1, std::sync::atomic::Ordering::Relaxed) as f64,
        stop: &|| false,
    };
    let mut steps = 0;
    let (measured, material) = study.measure(&mut |_| steps += 1).unwrap().unwrap();
    assert_eq!(steps, study.steps().unwrap());
    let file = ScenarioFile::parse(
        built_in::text(FIG7).unwrap(),
        &[Override::new("run.seed", 3)],
    )
    .unwrap();
    let setup = Setup::resolve(&file, &mut |name| built_in::named_in(FIG7, name)).unwrap();
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    let alone = crate::run(&setup, &mut (), control).unwrap();
    assert_eq!(measured.flywheel.0[0].result_hash, alone.result_hash);
    assert!(!material.ride.state.time_s.is_empty());
    assert_eq!(material.paths.len(), DRAWN.len());
    assert!(
        !material.stages.contains("time_s\":0"),
        "no clock in a picture"
    );
    // One run does not show what means do; what every ride shows it must.
    for id in [
        "rides",
        "rides-balancer",
        "on-the-curve",
        "slows-down",
        "in-balance",
        "passive",
        "both-modes",
        "flywheel-is-stronger",
        "on-line",
        "curvature-limit",
    ] {
        assert_eq!(verdict(&measured, id), Verdict::Holds, "{id}");
    }
    if measured.rigid.is_some() {
        assert_eq!(verdict(&measured, "on-rigid-bodies"), Verdict::Holds);
    }
    // The bounds of docs/balance.md, standing, from rest.
    assert!(
        (measured.lean_flywheel_deg - 11.3).abs() < 0.11,
        "{}",
        measured.lean_flywheel_deg
    );
    assert!(
        (measured.lean_balancer_deg - 9.3).abs() < 0.11,
        "{}",
        measured.lean_balancer_deg
    );
}

/// So the commands of Fig. 5 and 6 draw what stands in Table 2.
#[test]
fn the_scenario_with_its_changes_is_the_row_of_table_2() {
    let changes = TABLE_1.map(|(key, value)| Override::new(key, value));
    let yard = Shipped::load(FIG6, &changes).unwrap();
    let problem = yard.problem().unwrap();
    let study = ReproduceStudy {
        runs: 1,
        rides: 1,
        seed: 1,
        jobs: 1,
        clock: &|| 0.0,
        stop: &|| false,
    };
    let plain = Shipped::load(FIG6, &[]).unwrap();
    let of_plain = study.table2(&plain.setup, &problem).rows();
    let rows = study.table2(&yard.setup, &problem).rows();
    assert_eq!(rows, of_plain, "the changes do not change the table");
    let row = rows.iter().find(|row| row.name == "paper").unwrap();
    assert_eq!(row.params, yard.setup.planner);
}

#[test]
fn a_study_that_is_stopped_has_no_result() {
    let study = ReproduceStudy {
        runs: 2,
        rides: 2,
        seed: 1,
        jobs: 1,
        clock: &|| 0.0,
        stop: &|| true,
    };
    assert!(study.measure(&mut |_| {}).unwrap().is_none());
}
