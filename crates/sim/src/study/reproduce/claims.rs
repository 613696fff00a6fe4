//! The claims, as data: what the paper says, in our words, what it prints, what has to hold for us, and where it does not.
//!
//! A claim *holds*, or *differs* where it does not hold for a reason we know and say, or *fails*. One that fails ends
//! `bikebot reproduce` with exit code 1. One whose difference has gone away holds: nothing is known to differ for ever.

use super::measured::{Measured, Rides};
use crate::outcome::{Metrics, RunOutcome};
use crate::study::table2::{Row, paper_figures};
use bikebot_planner::Method;
use serde::Serialize;

/// Whose claim it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// The paper's.
    Paper,
    /// Ours, beyond the paper.
    Ours,
}

/// One sentence that can be held against measurements.
#[derive(Debug, Clone, Copy)]
pub struct Claim {
    /// Its name, for scripts.
    pub id: &'static str,
    /// Whose it is.
    pub origin: Origin,
    /// Where it stands: a table, a figure, a section.
    pub source: &'static str,
    /// The claim, in our words.
    pub text: &'static str,
    /// What has to be measured for it to hold.
    pub criterion: &'static str,
    /// Why ours differs where it does; a claim without it fails instead.
    pub difference: Option<&'static str>,
    /// What a reader should know in any case; may be empty.
    pub remark: &'static str,
    /// The command behind it, with `{runs}`, `{rides}`, `{unknown}` and `{seed}` for the numbers.
    command: &'static str,
    /// Its figures; `None` where it was not measured.
    judge: fn(&Measured) -> Option<Finding>,
}

/// What was found of a claim.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Our figure.
    pub ours: String,
    /// The paper's figure; empty where it prints none.
    pub paper: String,
    /// The criterion is met.
    pub holds: bool,
}

/// What came of a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The criterion is met.
    Holds,
    /// It is not met, for a reason that is known and told.
    Differs,
    /// It is not met.
    Fails,
    /// This program was built without what it takes.
    NotMeasured,
}

impl Verdict {
    /// The word for it.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Differs => "differs",
            Self::Fails => "fails",
            Self::NotMeasured => "not measured",
        }
    }
}

/// A claim with its verdict.
#[derive(Debug, Clone, Serialize)]
pub struct Judged {
    /// Its name.
    pub id: &'static str,
    /// Whose it is.
    pub origin: Origin,
    /// Where it stands.
    pub source: &'static str,
    /// The claim.
    pub claim: &'static str,
    /// What has to hold.
    pub criterion: &'static str,
    /// What came of it.
    pub verdict: Verdict,
    /// Its figures.
    #[serde(flatten)]
    pub finding: Option<Finding>,
    /// Why it differs, where it does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub difference: Option<&'static str>,
    /// What else there is to know.
    #[serde(skip_serializing_if = "str::is_empty")]
    pub remark: &'static str,
    /// The command that measures it again.
    pub command: String,
}

/// Holds every claim against what was measured, in the order of [`CLAIMS`].
#[must_use]
pub fn judge(measured: &Measured) -> Vec<Judged> {
    let judged = CLAIMS.iter().map(|claim| claim.judged(measured));
    judged.collect()
}

impl Claim {
    /// Holds it against what was measured.
    #[must_use]
    pub fn judged(&self, measured: &Measured) -> Judged {
        let finding = (self.judge)(measured);
        let verdict = match (&finding, self.difference) {
            (None, _) => Verdict::NotMeasured,
            (Some(finding), _) if finding.holds => Verdict::Holds,
            (Some(_), Some(_)) => Verdict::Differs,
            (Some(_), None) => Verdict::Fails,
        };
        let unknown = measured.unknown.0.len().to_string();
        Judged {
            id: self.id,
            origin: self.origin,
            source: self.source,
            claim: self.text,
            criterion: self.criterion,
            verdict,
            finding,
            difference: self.difference.filter(|_| verdict == Verdict::Differs),
            remark: self.remark,
            command: self
                .command
                .replace("{runs}", &measured.runs.to_string())
                .replace("{seed}", &measured.seed.to_string())
                .replace("{rides}", &measured.rides.to_string())
                .replace("{unknown}", &unknown),
        }
    }
}

/// Share of the paper's lengths by which ours may lie beside them. The field is a reconstruction (D8): they show the order, not the
/// metre.
const NEAR: f64 = 0.1;
/// The same for the proposed row, which is what the reconstruction was made to be comparable for.
const NEAR_PROPOSED: f64 = 0.03;
/// Factor within which a roughness has the size of another; the rows of Table 2 lie between 10 and 10⁶ apart.
const SAME_SIZE: f64 = 3.0;
/// A lateral error that is not seen in a drawing of a 10 m arena, m; the bound of `scenarios/fig7.toml`.
const ON_THE_CURVE: f64 = 0.02;
/// Share of its top speed at which a bike has slowed down.
const SLOWER: f64 = 0.85;
/// Lean at which the ride of Fig. 7 stays in the region that any law recovers, °; the bound of `scenarios/fig7.toml`.
const UPRIGHT_DEG: f64 = 9.0;
/// Load that keeps a wheel firmly on the ground, N; the bound of `scenarios/fig7.toml`.
const LOADED_N: f64 = 50.0;
/// Lean from which both modes have to recover, °.
const LEAN_DEG: f64 = 5.0;
/// Tolerance of the goal on the arena, m.
const AT_GOAL: f64 = 0.3;

const TABLE_2: &str = "bikebot table2 --runs {runs} --seed {seed}";
const RIDES: &str = "bikebot sweep scenarios/fig7.toml --runs {rides} --seed {seed} -o fig7.csv";
const RIDES_BALANCER: &str =
    "bikebot sweep scenarios/fig7-balancer.toml --runs {rides} --seed {seed} -o fig7-balancer.csv";
const BOTH: &str = "bikebot sweep scenarios/fig7.toml --vary 'bike.mode=[\"flywheel\",\"balancer\"]' --runs {rides} --seed {seed} -o fig7.csv";
const LEANS: &str = "bikebot sweep scenarios/balance-recover.toml --vary 'bike.mode=[\"flywheel\",\"balancer\"]' --vary start.roll_deg=5:14:181 -o lean.csv";

const FIELD: &str =
    "The field is a reconstruction (D8): lengths on it compare methods with each other.";

/// A claim of the paper without a difference or a remark.
const fn paper(id: &'static str, source: &'static str, text: &'static str) -> Claim {
    Claim {
        id,
        origin: Origin::Paper,
        source,
        text,
        criterion: "",
        difference: None,
        remark: "",
        command: TABLE_2,
        judge: |_| None,
    }
}

/// All claims: the paper's in its order, then ours.
pub const CLAIMS: &[Claim] = &[
    Claim {
        criterion: "every run of `paper` finds a path",
        remark: "With the slips of the listing put right (D1, D4, D5, D18).",
        judge: |m| {
            let row = row(m, "paper")?;
            Some(Finding {
                ours: format!("{} of {} runs", row.found, row.runs),
                paper: "found".into(),
                holds: row.runs > 0 && row.found == row.runs,
            })
        },
        ..paper(
            "finds-a-path",
            "Algorithm 1, Table 2",
            "The proposed method finds a path on the field of 100 m × 100 m.",
        )
    },
    Claim {
        criterion: "some run to the letter finds a path",
        difference: Some(
            "Tangents of k = 1 m on edges of 5 m bend every edge beyond σ_MAX, so nothing is found. With tangents as long as the chord \
             it works (D18).",
        ),
        command: "bikebot plan scenarios/planning/fig6-as-printed.toml --runs {runs} --seed {seed}",
        judge: |m| {
            Some(Finding {
                ours: format!("{} of {} runs", m.as_printed.found, m.as_printed.runs),
                paper: "found".into(),
                holds: m.as_printed.found > 0,
            })
        },
        ..paper(
            "as-printed",
            "Algorithm 1, Table 1",
            "It does so with the parameters and the listing as printed.",
        )
    },
    Claim {
        criterion: "largest curvature of all runs ≤ 1 per metre",
        judge: |m| {
            let most = row(m, "paper")?.max_curvature_per_m?;
            Some(Finding {
                ours: format!("at most {most:.3} per metre"),
                paper: "σ_MAX = 1 per metre".into(),
                // Rounding of a root to nine digits.
                holds: most <= 1.0 + 1e-9,
            })
        },
        ..paper(
            "curvature-limit",
            "Table 1",
            "The curvature of the path stays within the limit.",
        )
    },
    Claim {
        criterion: "mean length of `paper` below those of all rows of the table, LP read as Laplace potential",
        remark: FIELD,
        judge: |m| {
            let others = [
                "laplace",
                "rrt",
                "rrt_star",
                "birrt",
                "birrt_smooth",
                "mpc_laplace",
            ];
            shortest(m, &others)
        },
        ..paper(
            "shortest",
            "Table 2",
            "The proposed path is the shortest of the table.",
        )
    },
    Claim {
        criterion: "mean length of `paper` below `linear_program` and `mpc_linear_program`",
        difference: Some(
            "MPC along the path of the linear programme is shorter than Algorithm 1 on our field, which contradicts the order that the \
             paper prints (D22, D23).",
        ),
        judge: |m| shortest(m, &["linear_program", "mpc_linear_program"]),
        ..paper(
            "shortest-linear",
            "Table 2",
            "It is so as well if “LP” is a linear programme.",
        )
    },
    Claim {
        criterion: "mean length within 3 % of the printed one",
        remark: "On a guide pulled tight it is 1 % shorter still (row `paper_taut`, D21). Both end in the goal ball, as the paper's does.",
        judge: |m| length_near(m, Method::Paper, NEAR_PROPOSED),
        ..paper("length", "Table 2", "The proposed path is 177.2 m long.")
    },
    Claim {
        criterion: "mean roughness within a factor of three of the printed one",
        remark: "The paper does not print its definition; ours is J/L² with J = ∫(dσ/ds)² ds (D7).",
        judge: |m| {
            let ours = mean_roughness(m, "paper")?;
            let paper = paper_figures(Method::Paper)?.roughness;
            Some(Finding {
                ours: scientific(ours),
                paper: scientific(paper),
                holds: ours <= SAME_SIZE * paper && paper <= SAME_SIZE * ours,
            })
        },
        ..paper("roughness", "Table 2", "Its roughness is 5.61e-5.")
    },
    Claim {
        criterion: "mean time ≤ the printed one",
        remark: "The paper's is MATLAB on a computer of 2016.",
        judge: |m| {
            let ours = row(m, "paper")?.time_s?.mean;
            let paper = paper_figures(Method::Paper)?.time_s?;
            Some(Finding {
                ours: seconds(ours),
                paper: seconds(paper),
                holds: ours <= paper,
            })
        },
        ..paper("time", "Table 2", "It takes 1.41 s.")
    },
    Claim {
        criterion: "median time of `paper` below those of the rows of LP and of MPC, in both readings",
        remark: "Sect. 4.1 prints 188 s for MPC where the table has 2.70e3 s; 188.2 is its length.",
        judge: |m| {
            let ours = row(m, "paper")?.time_s?.median;
            let names = [
                "laplace",
                "linear_program",
                "mpc_laplace",
                "mpc_linear_program",
            ];
            let others: Option<Vec<f64>> = names
                .iter()
                .map(|name| Some(row(m, name)?.time_s?.median))
                .collect();
            let least = others?.into_iter().fold(f64::INFINITY, f64::min);
            let paper = |method| Some(seconds(paper_figures(method)?.time_s?));
            Some(Finding {
                ours: format!("{} against {} at least", seconds(ours), seconds(least)),
                paper: format!(
                    "{} against {} (LP) and {} (MPC)",
                    paper(Method::Paper)?,
                    paper(Method::Laplace)?,
                    paper(Method::MpcLaplace)?
                ),
                holds: ours < least,
            })
        },
        ..paper(
            "faster",
            "Table 2",
            "It takes less time than LP and than MPC.",
        )
    },
    Claim {
        criterion: "mean lengths of RRT, RRT* and BiRRT each at least 1.3 times that of `paper`",
        judge: |m| {
            let ours = mean_length(m, "paper")?;
            let trees = ["rrt", "rrt_star", "birrt"].map(|name| mean_length(m, name));
            let [rrt, star, birrt] = [trees[0]?, trees[1]?, trees[2]?];
            let printed = |method| Some(paper_figures(method)?.length_m);
            Some(Finding {
                ours: format!("{rrt:.1}, {star:.1}, {birrt:.1} against {ours:.1} m"),
                paper: format!(
                    "{}, {}, {} against {} m",
                    printed(Method::Rrt)?,
                    printed(Method::RrtStar)?,
                    printed(Method::Birrt)?,
                    printed(Method::Paper)?
                ),
                holds: rrt.min(star).min(birrt) >= 1.3 * ours,
            })
        },
        ..paper(
            "trees-are-long",
            "Table 2",
            "Trees alone (RRT, RRT*, BiRRT) make paths that are half as long again.",
        )
    },
    Claim {
        criterion: "mean lengths of RRT, RRT* and BiRRT within a tenth of the printed ones",
        remark: "The radius of RRT* is not printed; 2 m gives the printed length (D3).",
        judge: |m| {
            let methods = [Method::Rrt, Method::RrtStar, Method::Birrt];
            let found: Option<Vec<Finding>> =
                methods.iter().map(|it| length_near(m, *it, NEAR)).collect();
            let found = found?;
            let join = |text: fn(&Finding) -> &str| {
                let all: Vec<&str> = found
                    .iter()
                    .map(|it| text(it).trim_end_matches(" m"))
                    .collect();
                format!("{} m", all.join(", "))
            };
            Some(Finding {
                ours: join(|it| &it.ours),
                paper: join(|it| &it.paper),
                holds: found.iter().all(|it| it.holds),
            })
        },
        ..paper(
            "tree-lengths",
            "Table 2",
            "Their lengths are 270.2, 263.6 and 261.2 m.",
        )
    },
    Claim {
        criterion: "`birrt_smooth` below 0.8 times the length of `birrt`, and rougher on its own vertices",
        remark: "That it is rougher comes of a few close vertices that shortcuts leave: resampled at 0.5 m it is the smoother one (D7).",
        judge: |m| {
            let lengths = [mean_length(m, "birrt")?, mean_length(m, "birrt_smooth")?];
            let rough = [
                mean_roughness(m, "birrt")?,
                mean_roughness(m, "birrt_smooth")?,
            ];
            let (before, after) = (
                paper_figures(Method::Birrt)?,
                paper_figures(Method::BirrtSmooth)?,
            );
            Some(Finding {
                ours: step(lengths, rough),
                paper: step(
                    [before.length_m, after.length_m],
                    [before.roughness, after.roughness],
                ),
                holds: lengths[1] < 0.8 * lengths[0] && rough[1] > rough[0],
            })
        },
        ..paper(
            "smoothing-shortens",
            "Table 2",
            "Smoothing makes BiRRT's path a third shorter, and rougher.",
        )
    },
    Claim {
        criterion: "`paper` both shorter and less rough than `birrt_smooth`",
        judge: |m| {
            let lengths = [mean_length(m, "birrt_smooth")?, mean_length(m, "paper")?];
            let rough = [
                mean_roughness(m, "birrt_smooth")?,
                mean_roughness(m, "paper")?,
            ];
            let (before, after) = (
                paper_figures(Method::BirrtSmooth)?,
                paper_figures(Method::Paper)?,
            );
            Some(Finding {
                ours: step(lengths, rough),
                paper: step(
                    [before.length_m, after.length_m],
                    [before.roughness, after.roughness],
                ),
                holds: lengths[1] < lengths[0] && rough[1] < rough[0],
            })
        },
        ..paper(
            "corridor-smooths",
            "Table 2",
            "RRT* in the corridor about that path then makes it shorter still, and smooth.",
        )
    },
    Claim {
        criterion: "both rows of MPC less rough than every other row of the paper's table",
        remark: "The path of the Laplace potential comes closer to it here than the paper's LP did (D22).",
        judge: |m| {
            let mpc = [
                mean_roughness(m, "mpc_laplace")?,
                mean_roughness(m, "mpc_linear_program")?,
            ];
            let others = [
                "laplace",
                "linear_program",
                "rrt",
                "rrt_star",
                "birrt",
                "birrt_smooth",
                "paper",
            ];
            let others: Option<Vec<f64>> =
                others.iter().map(|name| mean_roughness(m, name)).collect();
            let least = others?.into_iter().fold(f64::INFINITY, f64::min);
            Some(Finding {
                ours: format!(
                    "{} and {}; next {}",
                    scientific(mpc[0]),
                    scientific(mpc[1]),
                    scientific(least)
                ),
                paper: format!(
                    "{}; next {}",
                    scientific(paper_figures(Method::MpcLaplace)?.roughness),
                    scientific(paper_figures(Method::Paper)?.roughness)
                ),
                holds: mpc[0].max(mpc[1]) < least,
            })
        },
        ..paper(
            "mpc-is-smoothest",
            "Table 2",
            "MPC makes the smoothest path.",
        )
    },
    Claim {
        criterion: "every ride in flywheel mode arrives within 0.3 m of (8, 8)",
        remark: "The arena is a reconstruction, one block moved so that a bike with a wheelbase can turn out (D8); σ_MAX = 0.8 per metre (D20).",
        command: RIDES,
        judge: |m| arrives(&m.flywheel),
        ..paper(
            "rides",
            "Fig. 7",
            "The bike robot moves from (1, 1, 0°) to (8, 8, 90°) along the generated path.",
        )
    },
    Claim {
        criterion: "every ride in balancer mode arrives within 0.3 m of (8, 8)",
        command: RIDES_BALANCER,
        judge: |m| arrives(&m.balancer),
        ..paper(
            "rides-balancer",
            "Fig. 7, Sect. 2",
            "It does so with the balancer's centre of gravity off its pivot, too.",
        )
    },
    Claim {
        criterion: "largest distance of the followed point from its curve ≤ 20 mm on every ride",
        remark: "The followed point rides ahead of the rear contact (D14); the rear contact itself is given beside it.",
        command: BOTH,
        judge: |m| {
            let lateral = both(m, Rides::most, |it| it.lateral_error_max_m)?;
            let rear = both(m, Rides::most, |it| it.rear_error_max_m)?;
            Some(Finding {
                ours: format!(
                    "at most {:.1} mm, rear contact {:.1} mm",
                    1e3 * lateral,
                    1e3 * rear
                ),
                paper: "seen in the figure only".into(),
                holds: lateral <= ON_THE_CURVE,
            })
        },
        ..paper(
            "on-the-curve",
            "Fig. 7",
            "The actual path lies on the desired one.",
        )
    },
    Claim {
        criterion: "speed in the sharpest turn ≤ 0.85 of the top speed, on average over the rides",
        remark: "Turns within 1.5 m of the ends do not count: there it is slow anyway. A ride whose path has none but gentle ones need not slow down.",
        command: BOTH,
        judge: |m| {
            let share = |it: &Metrics| Some(it.corner_speed_mps? / it.speed_max_mps?);
            let mean = both(m, Rides::mean, share)?;
            let least = both(m, Rides::least, share)?;
            Some(Finding {
                ours: format!(
                    "{:.0} % of the top speed on average, {:.0} % at least",
                    100.0 * mean,
                    100.0 * least
                ),
                paper: "seen in the figure only".into(),
                holds: mean <= SLOWER,
            })
        },
        ..paper(
            "slows-down",
            "Fig. 8",
            "It rides slower where the curvature is large.",
        )
    },
    Claim {
        criterion: "on every ride: no fall, roll ≤ 9°, wheel loads ≥ 50 N",
        command: BOTH,
        judge: |m| {
            let roll = both(m, Rides::most, |it| it.roll_max_deg)?;
            let load = both(m, Rides::least, |it| it.wheel_load_min_n)?;
            let falls = [&m.flywheel, &m.balancer]
                .into_iter()
                .flat_map(|rides| &rides.0)
                .filter(|ride| ride.outcome == RunOutcome::Fell)
                .count();
            Some(Finding {
                ours: format!("{falls} falls, roll up to {roll:.1}°, loads from {load:.0} N"),
                paper: "no fall".into(),
                holds: falls == 0 && roll <= UPRIGHT_DEG && load >= LOADED_N,
            })
        },
        ..paper(
            "in-balance",
            "Sect. 2, 3",
            "Output zeroing keeps it in balance while it turns.",
        )
    },
    Claim {
        criterion: "no tick of any ride in which the augmented energy rises by more than was supplied",
        remark: "Strictly so here, out of an energy tank of finite content (D24).",
        command: BOTH,
        judge: |m| {
            let most = both(m, Rides::most, |it| {
                it.passivity_violations.map(|count| count as f64)
            })?;
            Some(Finding {
                ours: format!("{most:.0} violations"),
                paper: "proved".into(),
                holds: most == 0.0,
            })
        },
        ..paper(
            "passive",
            "Sect. 3",
            "The velocity field control of the bike is passive.",
        )
    },
    Claim {
        criterion: "the standing bike recovers from 5° in both modes",
        command: LEANS,
        judge: |m| {
            let least = m.lean_flywheel_deg.min(m.lean_balancer_deg);
            Some(Finding {
                ours: leans(m),
                paper: String::new(),
                holds: least >= LEAN_DEG,
            })
        },
        ..paper(
            "both-modes",
            "Sect. 2",
            "The balancer balances the bike as a flywheel and as an inverted pendulum.",
        )
    },
    Claim {
        criterion: "a greater lean is caught in flywheel mode",
        remark: "The laboratory's own statement, which the paper builds on. Leans are tried in steps of 0.05°.",
        command: LEANS,
        judge: |m| {
            Some(Finding {
                ours: leans(m),
                paper: String::new(),
                holds: m.lean_flywheel_deg > m.lean_balancer_deg,
            })
        },
        ..paper(
            "flywheel-is-stronger",
            "Keo, Yamakita 2010",
            "Flywheel mode is the one for large disturbances.",
        )
    },
    Claim {
        criterion: "every ride on a field known only from the laser arrives, with new paths on the way",
        remark: "The paper shows its method on fields known beforehand. Ours are 30 m × 20 m with two walls to be passed around.",
        command: "bikebot sweep scenarios/unknown-yard.toml --runs {unknown} --seed {seed} -o unknown.csv",
        judge: |m| {
            let replans = m.unknown.least(|it| it.replans.map(|count| count as f64));
            let clearance = m.unknown.least(|it| it.min_clearance_m);
            let (replans, clearance) = (replans.unwrap_or(0.0), clearance.unwrap_or(0.0));
            Some(Finding {
                ours: format!(
                    "{} of {} arrive, {replans:.0} or more replans, clearance {clearance:.2} m",
                    m.unknown.arrived(),
                    m.unknown.0.len()
                ),
                paper: "known fields only".into(),
                holds: m.unknown.all_arrived() && replans >= 1.0 && clearance > 0.0,
            })
        },
        ..paper(
            "on-line",
            "Introduction",
            "Paths are made on line from what the sensors show.",
        )
    },
    Claim {
        origin: Origin::Ours,
        criterion: "`full_smooth` shorter than 177.2 m and less rough than 6.08e-7, to the goal itself with both headings",
        remark: FIELD,
        judge: |m| {
            let (length, rough) = (
                mean_length(m, "full_smooth")?,
                mean_roughness(m, "full_smooth")?,
            );
            let (shortest, smoothest) = (
                paper_figures(Method::Paper)?,
                paper_figures(Method::MpcLaplace)?,
            );
            Some(Finding {
                ours: format!("{length:.1} m, {}", scientific(rough)),
                paper: format!(
                    "{} m; {}",
                    shortest.length_m,
                    scientific(smoothest.roughness)
                ),
                holds: length < shortest.length_m && rough < smoothest.roughness,
            })
        },
        ..paper(
            "full-beats-both",
            "beyond",
            "The default planner is shorter than the paper's shortest row and smoother than its smoothest, at once.",
        )
    },
    Claim {
        origin: Origin::Ours,
        criterion: "largest jump of curvature below 1e-9 per metre; that of `paper` is given beside it",
        remark: "A steering angle cannot jump, so the paper's path cannot be followed exactly (D16).",
        judge: |m| {
            let full = row(m, "full")?.curvature_jump_per_m?;
            let paper = row(m, "paper")?.curvature_jump_per_m?;
            Some(Finding {
                ours: format!("{} per metre; `paper` {paper:.2}", scientific(full)),
                paper: String::new(),
                holds: full < 1e-9,
            })
        },
        ..paper(
            "full-is-continuous",
            "beyond",
            "The curvature of the default planner's path does not jump.",
        )
    },
    Claim {
        origin: Origin::Ours,
        criterion: "the ride of Fig. 7 arrives on rigid bodies with wheel contact, within 20 mm of its curve",
        remark: "That plant shares no equation with the models the controllers are designed on (docs/plants.md).",
        command: "bikebot compare scenarios/fig7.toml --plants bike3d,rapier3d --seed {seed}",
        judge: |m| {
            let ride = m.rigid.as_ref()?;
            let lateral = ride.metrics.lateral_error_max_m;
            Some(Finding {
                ours: format!(
                    "{}, lateral error {}",
                    ride.outcome,
                    lateral
                        .map_or_else(|| "not measured".into(), |it| format!("{:.1} mm", 1e3 * it))
                ),
                paper: String::new(),
                holds: ride.outcome == RunOutcome::Arrived
                    && lateral.is_some_and(|it| it <= ON_THE_CURVE),
            })
        },
        ..paper(
            "on-rigid-bodies",
            "beyond",
            "The controllers hold on an independent model of the bike.",
        )
    },
];

fn row<'m>(measured: &'m Measured, name: &str) -> Option<&'m Row> {
    let mut rows = measured.table2.rows.iter();
    rows.find(|row| row.method == name)
}

fn mean_length(measured: &Measured, name: &str) -> Option<f64> {
    Some(row(measured, name)?.length_m?.mean)
}

fn mean_roughness(measured: &Measured, name: &str) -> Option<f64> {
    Some(row(measured, name)?.roughness?.mean)
}

/// The proposed row against others by length.
fn shortest(measured: &Measured, others: &[&str]) -> Option<Finding> {
    let ours = mean_length(measured, "paper")?;
    let mut least = ("", f64::INFINITY);
    let mut least_printed = f64::INFINITY;
    for name in others {
        let row = row(measured, name)?;
        let length = row.length_m?.mean;
        if length < least.1 {
            least = (row.method, length);
        }
        least_printed = least_printed.min(row.paper?.length_m);
    }
    Some(Finding {
        ours: format!("{ours:.1} m; next `{}` {:.1} m", least.0, least.1),
        paper: format!(
            "{} m; next {least_printed} m",
            paper_figures(Method::Paper)?.length_m
        ),
        holds: ours < least.1,
    })
}

/// A mean length against the printed one.
fn length_near(measured: &Measured, method: Method, share: f64) -> Option<Finding> {
    let ours = mean_length(measured, method.name())?;
    let paper = paper_figures(method)?.length_m;
    Some(Finding {
        ours: format!("{ours:.1} m"),
        paper: format!("{paper} m"),
        holds: (ours - paper).abs() <= share * paper,
    })
}

fn arrives(rides: &Rides) -> Option<Finding> {
    let end = rides.most(|it| it.end_position_error_m);
    let heading = rides.most(|it| it.end_heading_error_deg);
    let off = match (end, heading) {
        (Some(end), Some(heading)) => {
            format!(", at most {:.1} mm and {heading:.2}° off", 1e3 * end)
        }
        _ => String::new(),
    };
    Some(Finding {
        ours: format!("{} of {} arrive{off}", rides.arrived(), rides.0.len()),
        paper: "arrives".into(),
        holds: rides.all_arrived() && end.is_some_and(|end| end <= AT_GOAL),
    })
}

/// What is looked at of a ride.
type Metric = fn(&Metrics) -> Option<f64>;

/// A metric over the rides of both modes.
fn both(
    measured: &Measured,
    over: fn(&Rides, Metric) -> Option<f64>,
    metric: Metric,
) -> Option<f64> {
    let all = [&measured.flywheel, &measured.balancer]
        .into_iter()
        .flat_map(|rides| rides.0.iter().cloned());
    over(&Rides(all.collect()), metric)
}

fn leans(measured: &Measured) -> String {
    format!(
        "flywheel {:.2}°, balancer {:.2}°",
        measured.lean_flywheel_deg, measured.lean_balancer_deg
    )
}

/// From one row to the next.
fn step(lengths: [f64; 2], roughness: [f64; 2]) -> String {
    format!(
        "{:.1} → {:.1} m, roughness {} → {}",
        lengths[0],
        lengths[1],
        scientific(roughness[0]),
        scientific(roughness[1])
    )
}

/// A number over many orders of magnitude: `5.61e-5`; near 1 as it is.
fn scientific(value: f64) -> String {
    if (0.1..1000.0).contains(&value) {
        format!("{value:.2}")
    } else if value == 0.0 {
        "0".into()
    } else {
        format!("{value:.2e}")
    }
}

fn seconds(value: f64) -> String {
    if value < 1.0 {
        format!("{:.1} ms", 1e3 * value)
    } else if value < 100.0 {
        format!("{value:.2} s")
    } else {
        format!("{value:.0} s")
    }
}
