//! What can be recovered at all, and what each balance law recovers of it.
//!
//! `cargo run --release --example recoverable [-- map.svg]`
//!
//! First the standing bike (two-link model): the bound under the limits of torque and speed, and the
//! basin, the largest roll and the largest push of each law. Then the ride straight ahead at 1.5 m/s
//! on the whole bike, where a wheel that slips or lifts is a fall. With a file name the basins are
//! drawn.

#![allow(clippy::print_stdout, reason = "an example shows what it found")]

use bikebot::control::recoverable::{BasinGrid, Standing, largest, share};
use bikebot::control::{BalanceLawKind, BalanceParams};
use bikebot::dynamics::{BalancerMode, BikeParams, TwoLinkState};
use bikebot::sim::{RunControl, RunOutcome, ScenarioFile, Setup, run};
use std::fmt::Write as _;

const PERIOD: f64 = 0.005;
const LAWS: [(&str, BalanceLawKind); 3] = [
    ("output_zeroing", BalanceLawKind::OutputZeroing),
    ("lqr", BalanceLawKind::Lqr),
    ("mpc", BalanceLawKind::Mpc),
];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let bike = BikeParams::default();
    let grid = BasinGrid::default();
    let mut maps = Vec::new();
    println!("standing, control every 5 ms: share of the 33 x 33 grid, largest roll, largest push");
    for mode in [BalancerMode::Flywheel, BalancerMode::Balancer] {
        let standing = Standing::new(&bike, mode);
        let bound = grid.map(|state| standing.can_be_saved(state));
        let roll = largest(0.05, 20.0, |d| standing.can_be_saved(&leaning(d)));
        let push = largest(0.1, 60.0, |j| standing.push_can_be_saved(j));
        println!(
            "{mode:?}: any law {:.4}, {roll:.2} deg, {push:.1} N s",
            share(&bound)
        );
        for (name, controller) in LAWS {
            let params = BalanceParams {
                controller,
                observer: false,
                ..BalanceParams::default()
            };
            let recovers = |state: &TwoLinkState, impulse: f64| {
                standing
                    .recovers(&params, PERIOD, state, impulse)
                    .unwrap_or(false)
            };
            let basin = grid.map(|state| recovers(state, 0.0));
            let roll = largest(0.05, 20.0, |d| recovers(&leaning(d), 0.0));
            let push = largest(0.1, 60.0, |j| recovers(&TwoLinkState::default(), j));
            println!(
                "{mode:?}: {name} {:.4} ({:.1} % of the bound), {roll:.2} deg, {push:.1} N s",
                share(&basin),
                100.0 * share(&basin) / share(&bound)
            );
            if controller != BalanceLawKind::Lqr {
                maps.push((format!("{mode:?}, {name}"), bound.clone(), basin));
            }
        }
    }
    if let Some(file) = std::env::args().nth(1) {
        std::fs::write(file, picture(&grid, &maps))?;
    }

    println!(
        "riding straight ahead at 1.5 m/s, no wheel slips or lifts: largest roll, largest push"
    );
    for mode in [BalancerMode::Flywheel, BalancerMode::Balancer] {
        for (name, _) in LAWS {
            for assist in [false, true] {
                let rides = |roll: f64, push: f64| {
                    arrives(&riding_scenario(mode, name, assist, roll, push)).unwrap_or(None)
                };
                let mut loads = [f64::INFINITY; 2];
                let roll = largest(0.25, 20.0, |d| keep(&mut loads[0], rides(d, 0.0)));
                let push = largest(0.5, 50.0, |j| keep(&mut loads[1], rides(0.0, j)));
                println!(
                    "{mode:?}: {name}{} {roll:.2} deg (least load {:.0} N), {push:.1} N s ({:.0} N)",
                    if assist { " + steering" } else { "" },
                    loads[0],
                    loads[1]
                );
            }
        }
    }
    Ok(())
}

/// A ride straight ahead at 1.5 m/s that begins with some roll, degrees, or is pushed with some
/// N s after 2 s.
fn riding_scenario(
    mode: BalancerMode,
    law: &str,
    assist: bool,
    roll_deg: f64,
    impulse: f64,
) -> String {
    let mode = match mode {
        BalancerMode::Flywheel => "flywheel",
        BalancerMode::Balancer => "balancer",
    };
    let push = if impulse == 0.0 {
        String::new()
    } else {
        format!("[[disturbance]]\nkind = \"push\"\nimpulse_ns = {impulse:?}\ntime_s = 2.0\n")
    };
    format!(
        "format = 1\nname = \"recoverable\"\n\
         [start]\nspeed_mps = 1.5\nroll_deg = {roll_deg:?}\n\
         [path]\nwaypoints = [[0.0, 0.0, 0.0], [20.0, 0.0, 0.0]]\ntangent_per_chord = 1.0\n\
         [bike]\nmode = \"{mode}\"\n\
         [balance]\ncontroller = \"{law}\"\nsteering_assist = {assist}\n\
         [run]\nduration_s = 40.0\n{push}"
    )
}

fn leaning(degrees: f64) -> TwoLinkState {
    TwoLinkState {
        roll: degrees.to_radians(),
        ..TwoLinkState::default()
    }
}

/// Remembers the load of the last ride that arrived; whether this one did.
fn keep(load: &mut f64, ride: Option<f64>) -> bool {
    if let Some(least) = ride {
        *load = least;
    }
    ride.is_some()
}

/// The least load of a wheel, N, if the bike arrives.
fn arrives(text: &str) -> Result<Option<f64>, Box<dyn std::error::Error>> {
    let file = ScenarioFile::parse(text, &[])?;
    let setup = Setup::resolve(&file, &mut |name| Err(format!("no file {name}")))?;
    let control = RunControl {
        stop: &|| false,
        progress: &mut |_| {},
        clock: None,
    };
    let report = run(&setup, &mut (), control)?;
    let load = report.metrics.wheel_load_min_n;
    Ok((report.outcome == RunOutcome::Arrived).then(|| load.unwrap_or(0.0)))
}

/// The basins side by side: recovered, recoverable but lost, and beyond the bound.
fn picture(grid: &BasinGrid, maps: &[(String, Vec<bool>, Vec<bool>)]) -> String {
    const CELL: usize = 6;
    let side = CELL * grid.points;
    const GAP: usize = 54;
    let (width, height) = (maps.len() * (side + GAP) + 24, side + 90);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n"
    );
    for (k, (name, bound, basin)) in maps.iter().enumerate() {
        let (left, top) = (GAP + k * (side + GAP), 30);
        let _ = writeln!(svg, "<text x=\"{left}\" y=\"20\">{name}</text>");
        let colour = |i: usize| match (bound[i], basin[i]) {
            (_, true) => "#009e73",
            (true, false) => "#d55e00",
            (false, false) => "#e8e8e8",
        };
        for row in 0..grid.points {
            let cells = row * grid.points..(row + 1) * grid.points;
            let y = top + CELL * (grid.points - 1 - row);
            // Cells of one colour that lie side by side are one rectangle.
            let mut first = cells.start;
            while first < cells.end {
                let same = |i: &usize| colour(*i) == colour(first);
                let count = (first..cells.end).take_while(same).count();
                let _ = writeln!(
                    svg,
                    "<rect x=\"{}\" y=\"{y}\" width=\"{}\" height=\"{CELL}\" fill=\"{}\"/>",
                    left + CELL * (first - cells.start),
                    CELL * count,
                    colour(first)
                );
                first += count;
            }
        }
        let (right, bottom) = (left + side, top + side);
        let _ = writeln!(
            svg,
            "<text x=\"{left}\" y=\"{0}\">-16°</text><text x=\"{right}\" y=\"{0}\" text-anchor=\"end\">16° roll</text>",
            bottom + 16
        );
        let _ = writeln!(
            svg,
            "<text x=\"{0}\" y=\"{bottom}\" text-anchor=\"end\">-1</text><text x=\"{0}\" y=\"{1}\" text-anchor=\"end\">1 rad/s</text>",
            left - 4,
            top + 10
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"{GAP}\" y=\"{}\">green: recovered; orange: could be recovered, is not; grey: beyond what any law can recover</text>\n</svg>",
        height - 14
    );
    svg
}
