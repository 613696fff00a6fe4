//! The last stage: a guide becomes a curve whose curvature does not jump (planning note, 4.5).
//!
//! The curve is a uniform cubic B-spline, so each piece is a Ferguson–Coons segment like every other curve of
//! the planner, and neighbours share their second derivative. Its control points minimise
//!
//! ```text
//!     L + w_J J,      L = length,   J = ∫ (dσ/ds)² ds,
//! ```
//!
//! subject to clearance and curvature, by a sequence of convex quadratic programmes: length is majorised, J is
//! at first taken at constant speed and then linearised, clearance and curvature are linearised as elastic rows, and a trust weight μ
//! keeps steps to where that holds. Rows are only a guide to where good curves are. What is returned has been *certified*: the exact
//! curvature test and the check of the whole footprint, segment by segment, no sampling.

mod certify;
mod objective;
mod rows;
mod spline;
mod survey;
#[cfg(test)]
mod tests;

use self::certify::{Fault, faults};
use self::objective::{Bending, Objective};
use self::rows::{Demands, RowMaker};
use self::spline::{Clamp, Spline};
use self::survey::Survey;
use crate::budget::Meter;
use crate::motion::MotionChecker;
use crate::params::{GoalMode, PlannerParams};
use crate::problem::PlanningProblem;
use bikebot_geometry::{CurvePath, FergusonCurve, Point2, Polyline, Vector2};
use bikebot_qp::{BandedQp, QpError, Settings, Status};
use bikebot_world::FootprintDisc;

/// Spacing of the control points in units of the scale, and the most rounds. Wide spacing is cheap and smooth but cannot follow
/// turns much tighter than itself: at 3 the rounds are cheaper still, but twice as many of them pass before one certifies.
const LADDER: [(f64, u32); 3] = [(2.0, 8), (1.0, 20), (0.5, 20)];
/// Most rounds of [`polish`].
const POLISH_ROUNDS: u32 = 20;
/// Fewest segments: with less, a short curve between two headings has nothing left to move.
const FEWEST_SEGMENTS: usize = 6;
/// Most segments; longer paths are too long for their scale.
const MOST_SEGMENTS: f64 = 10_000.0;

/// Equalities of a programme: position and heading at both ends, curvature at the start.
const MOST_EQUALITIES: usize = 7;

/// Clearance asked of the rows beyond the checker's margin, in units of the scale; or the checker's resolution, if that is more.
const MARGIN: f64 = 0.05;
/// What a blocked segment is asked to keep in addition each time, in units of the scale. With a fifth of it a long path among two thousand
/// obstacles takes twice as many rounds to its first certificate, and no path ends up shorter.
const MORE_CLEARANCE: f64 = 0.05;
/// Part of σ_MAX the rows ask for, and the part of that which a tight segment is asked for each time.
const CURVATURE: f64 = 0.97;
const LESS_CURVATURE: f64 = 0.98;
/// Clearances beyond it, in units of the scale, are not looked at.
const REACH: f64 = 2.0;
/// Smallest forward component of the tangent at an end with a heading, in units of the spacing.
const FORWARD: f64 = 0.3;

/// ρ: metres of length that a metre of violation is worth in the programme, and how much more in the merit.
const PRICE: f64 = 20.0;
const MERIT_PRICE: f64 = 10.0 * PRICE;
/// Trust weight in units of 1/scale: at first, at least and at most.
const TRUST: f64 = 0.02;
const LEAST_TRUST: f64 = 1e-4;
const MOST_TRUST: f64 = 1e3;
/// A certified curve whose merit falls by less than this part is not improved further.
const GAIN: f64 = 5e-4;

/// Steps refused in a row after which a certified curve is not improved further.
const MOST_REFUSALS: u32 = 3;
/// ε_g of a round's programme: a relative 1e-4 in the norm of the Hessian, when the next round linearises anew.
const GAP: f64 = 1e-8;
/// Rounds that take bending as jerk at constant speed, before it is linearised.
const JERK_ROUNDS: u32 = 2;
/// A step that does not improve the merit is shortened to this part, so many times.
const SHORTER: f64 = 0.4;
const SHORTENINGS: u32 = 2;

/// ℓ_c / w_J^{1/4}: the transition length of a corner where jerk is weighed by w_J.
const CORNER: f64 = 6.6;

/// A certified curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Refined {
    /// Ferguson segments from start to goal: positions, headings and curvatures of neighbours agree.
    pub curves: Vec<FergusonCurve>,
    /// L, m.
    pub length: f64,
    /// J = ∫ (dσ/ds)² ds, 1/m³.
    pub bending: f64,
    /// w_p (L + w_J J) with w_J of [`jerk_weight`]; w_p counts as 1 where it is 0. What to compare refined curves by.
    pub cost: f64,
    /// Quadratic programmes solved, on all rungs of the ladder.
    pub rounds: u32,
    /// Length of the guide per segment, h, m.
    pub spacing: f64,
}

/// w_J, m⁴: the weight of J against length that makes the transition of a corner `corner_length` (m) long,
/// ℓ_c ≈ 6.6 w_J^{1/4}.
#[must_use]
pub fn jerk_weight(corner_length: f64) -> f64 {
    (corner_length / CORNER).powi(4)
}

/// Refines `guide` into a smooth curve from the problem's start to its goal, the cheapest certified one of the first spacing
/// of the ladder that yields any.
///
/// The guide's ends are those of the problem; with [`GoalMode::Ball`] its last vertex is the goal and any heading will do
/// there. It need not leave and arrive along prescribed headings: a guide as it is often gives a shorter curve than one bent by
/// [`crate::end_arcs`], which lead round full circles where a half turn is too much; bend it where this gives none.
/// `None` if no curve could be certified, or the meter ran out before one was.
///
/// A round counts as some [`Meter::CHECK_EVERY`] iterations of the meter, and asks it for more in its midst. `observe` is told of every certified curve that is cheaper
/// than those before it on the same rung, as soon as it is known, and of the iterations of the meter until then.
pub fn apply(
    problem: &PlanningProblem<'_>,
    params: &PlannerParams,
    checker: &MotionChecker<'_>,
    guide: &[Point2],
    meter: &mut Meter<'_>,
    observe: &mut dyn FnMut(u64, &Refined),
) -> Option<Refined> {
    let last = *guide.last()?;
    let guide = Polyline::new(guide.to_vec()).ok()?;
    let refinement = Refinement::new(problem, params, checker, guide.length(), last)?;
    let mut course = Course {
        rounds: 0,
        meter,
        observe,
    };
    for (spacing, most_rounds) in LADDER {
        let Some(segments) = segments(guide.length(), spacing * params.scale) else {
            break;
        };
        let spline = Spline::along(&guide, segments, &refinement.ends);
        let spacing = guide.length() / segments as f64;
        let most_rounds = most_rounds.min(params.refine_rounds.saturating_sub(course.rounds));
        if most_rounds == 0 {
            break;
        }
        let best = refinement.run(spline, spacing, JERK_ROUNDS, most_rounds, &mut course);
        if let Some(best) = best {
            return Some(Refined {
                rounds: course.rounds,
                ..best
            });
        }
        if course.meter.cut_short().is_some() {
            break;
        }
    }
    None
}

/// Refines `curves`, which lead from the problem's start to its goal, a finer spacing (m) than theirs giving them more to move: a
/// refined curve of [`apply`], or one of the corridor RRT*.
///
/// The cheapest certified curve met, which for curves that were certified is seldom dearer than they are: compare. `None` as for
/// [`apply`].
pub fn polish(
    problem: &PlanningProblem<'_>,
    params: &PlannerParams,
    checker: &MotionChecker<'_>,
    curves: &[FergusonCurve],
    spacing: f64,
    meter: &mut Meter<'_>,
    observe: &mut dyn FnMut(u64, &Refined),
) -> Option<Refined> {
    let path = CurvePath::new(curves.to_vec()).ok()?;
    let length = path.length();
    let segments = segments(length, spacing)?;
    let spacing = length / segments as f64;
    let points: Vec<_> = (0..=segments)
        .map(|i| path.at(spacing * i as f64).position)
        .collect();
    let goal = points[segments];
    let refinement = Refinement::new(problem, params, checker, length, goal)?;
    let tangents = [path.start_pose(), path.end_pose()].map(|pose| pose.direction() * spacing);
    let spline = Spline::through(&points, tangents[0], tangents[1]);
    let mut course = Course {
        rounds: 0,
        meter,
        observe,
    };
    let best = refinement.run(spline, spacing, 0, POLISH_ROUNDS, &mut course)?;
    Some(Refined {
        rounds: course.rounds,
        ..best
    })
}

/// What stays the same on all rungs of the ladder.
struct Refinement<'a, 'w> {
    checker: &'a MotionChecker<'w>,
    discs: Vec<FootprintDisc>,
    ends: [Clamp; 2],
    scale: f64,
    max_curvature: f64,
    /// w_J, m⁴.
    jerk_weight: f64,
    /// w_p, or 1.
    length_weight: f64,
}

/// The quadratic programme of a round, refilled each time.
struct Programme<'a> {
    qp: BandedQp<8>,
    rows: RowMaker<'a>,
    objective: Objective,
}

/// How far a refinement has come, what it may spend, and who is told.
struct Course<'c, 'b> {
    /// Quadratic programmes solved.
    rounds: u32,
    meter: &'c mut Meter<'b>,
    observe: &'c mut dyn FnMut(u64, &Refined),
}

/// A curve with what is known of it.
struct Candidate {
    spline: Spline,
    curves: Vec<FergusonCurve>,
    survey: Survey,
}

impl<'a, 'w> Refinement<'a, 'w> {
    fn new(
        problem: &PlanningProblem<'_>,
        params: &PlannerParams,
        checker: &'a MotionChecker<'w>,
        length: f64,
        last: Point2,
    ) -> Option<Self> {
        let usable = |v: f64| v.is_finite() && v > 0.0;
        let jerk_weight = jerk_weight(params.corner_length());
        if ![params.scale, problem.max_curvature, jerk_weight, length]
            .into_iter()
            .all(usable)
        {
            return None;
        }
        let direction = |heading: f64| Vector2::new(heading.cos(), heading.sin());
        let start = Clamp {
            position: problem.start.position,
            direction: problem.start.heading.map(direction),
            curvature: problem.start.curvature,
        };
        let goal = match params.goal {
            GoalMode::Pose => Clamp {
                position: problem.goal.position,
                direction: problem.goal.heading.map(direction),
                curvature: None,
            },
            GoalMode::Ball => Clamp {
                position: last,
                direction: None,
                curvature: None,
            },
        };
        Some(Self {
            checker,
            discs: checker.footprint().discs(),
            ends: [start, goal],
            scale: params.scale,
            max_curvature: problem.max_curvature,
            jerk_weight,
            length_weight: if usable(params.length_weight) {
                params.length_weight
            } else {
                1.0
            },
        })
    }

    /// One rung: from `spline`, the cheapest certified curve met while the merit falls.
    fn run(
        &self,
        spline: Spline,
        spacing: f64,
        mut jerk_rounds: u32,
        most_rounds: u32,
        course: &mut Course<'_, '_>,
    ) -> Option<Refined> {
        let Course {
            rounds,
            meter,
            observe,
        } = course;
        let segments = spline.segments();
        let rows = self.row_maker();
        let mut programme = Programme {
            qp: BandedQp::new(
                2 * (segments + 3),
                rows.most_rows(segments),
                MOST_EQUALITIES,
            ),
            rows,
            objective: Objective {
                jerk_weight: self.jerk_weight,
                spacing,
            },
        };
        let margin = self.checker.margin() + (MARGIN * self.scale).max(self.checker.resolution());
        let mut demands = Demands {
            clearance: vec![margin; segments],
            curvature: vec![CURVATURE * self.max_curvature; segments],
        };
        let mut best = None;
        let mut refusals = 0;
        let mut mu = TRUST * (spacing / self.scale).min(1.0) / self.scale;

        if !meter.step_dearly() {
            return None;
        }
        let mut current = self.candidate(spline, meter)?;
        if !meter.step_dearly() {
            return None;
        }
        let mut faults = self.certify(&current, spacing, &mut best, meter, observe)?;
        for _ in 0..most_rounds {
            let is_enough = |best: &Refined| meter.is_content_with(best.cost);
            if best.as_ref().is_some_and(is_enough) || !begin_round(meter) {
                break;
            }
            *rounds += 1;
            let bending = if jerk_rounds > 0 {
                Bending::Jerk
            } else {
                Bending::GaussNewton
            };
            jerk_rounds = jerk_rounds.saturating_sub(1);
            self.demand_more(&faults, &mut demands);
            let merit = self.merit(&current.survey, &demands);
            // On long paths each part of a round takes its time: what was begun when the budget ends is thrown away.
            let go_on = || !meter.is_stopped();
            let next = self.step(&mut programme, &current, &demands, (bending, mu), &go_on);
            if !meter.step_dearly() {
                break;
            }
            let next = next
                .and_then(|next| self.candidate(next, meter))
                .and_then(|next| self.better_of_the_way(&current, next, &demands, meter));
            if !meter.step_dearly() {
                break;
            }
            if let Some(next) = next {
                let gain = merit - self.merit(&next.survey, &demands);
                current = next;
                mu = (0.5 * mu).max(LEAST_TRUST / self.scale);
                refusals = 0;
                let Some(found) = self.certify(&current, spacing, &mut best, meter, observe) else {
                    break;
                };
                faults = found;
                if faults.is_empty() && gain < GAIN * merit {
                    break;
                }
            } else if bending == Bending::GaussNewton {
                mu *= 8.0;
                refusals += 1;
                if mu > MOST_TRUST / self.scale || (best.is_some() && refusals == MOST_REFUSALS) {
                    break;
                }
            }
        }
        best
    }

    fn is_curvature_fixed(&self) -> bool {
        let start = &self.ends[0];
        start.direction.is_some() && start.curvature.is_some()
    }

    fn row_maker(&self) -> RowMaker<'_> {
        RowMaker {
            world: self.checker.world(),
            discs: &self.discs,
            reach: REACH * self.scale,
            max_curvature: self.max_curvature,
            price: PRICE,
            clamped: self.ends.map(|end| end.direction.is_some()),
            curvature_is_fixed: self.is_curvature_fixed(),
        }
    }

    /// `spline` snapped to the ends and measured; `None` if it is no curve, or the meter runs out.
    fn candidate(&self, mut spline: Spline, meter: &Meter<'_>) -> Option<Candidate> {
        spline.snap(&self.ends);
        if !spline.is_finite() {
            return None;
        }
        let curves = spline.curves(&self.ends);
        let reach = REACH * self.scale;
        let go_on = || !meter.is_stopped();
        let world = self.checker.world();
        let survey = Survey::of(&spline, &curves, &self.discs, world, reach, &go_on)?;
        Some(Candidate {
            spline,
            curves,
            survey,
        })
    }

    /// The minimiser of this round's quadratic programme.
    fn step(
        &self,
        programme: &mut Programme<'_>,
        current: &Candidate,
        demands: &Demands,
        (bending, mu): (Bending, f64),
        go_on: &dyn Fn() -> bool,
    ) -> Option<Spline> {
        let Programme {
            qp,
            rows,
            objective,
        } = programme;
        let spline = &current.spline;
        qp.reset(2 * spline.control.len()).ok()?;
        objective.add_to(qp, spline, bending, mu).ok()?;
        self.hold_ends(qp, spline, objective.spacing).ok()?;
        rows.add_to(qp, spline, &current.survey, demands);
        if !go_on() {
            return None;
        }
        let summary = qp.solve_while(
            &Settings {
                gap_tolerance: GAP,
                ..Settings::default()
            },
            go_on,
        );
        match summary.status {
            Status::Solved | Status::MaxIterations => Some(spline.moved(qp.x())),
            _ => None,
        }
    }

    /// Both end points stay where they are; end tangents stay along their headings, and forward; and so does a prescribed
    /// curvature: n·c_2 − σ_0 v²/3 keeps its value, linearised in the speed v. What is left of the square, snapping takes off.
    fn hold_ends(
        &self,
        qp: &mut BandedQp<8>,
        spline: &Spline,
        spacing: f64,
    ) -> Result<(), QpError> {
        let n = spline.control.len();
        for (end, first) in self.ends.iter().zip([0, n - 3]) {
            let [x0, x1, x2] = [0, 1, 2].map(|k| 2 * (first + k));
            for axis in 0..2 {
                let point = [(x0 + axis, 1.0), (x1 + axis, 4.0), (x2 + axis, 1.0)];
                qp.add_equality(&point, 0.0)?;
            }
            if let Some(u) = end.direction {
                // n·(c_2 − c_0) with n = (−u_y, u_x)
                let lateral = [(x0, u.y), (x0 + 1, -u.x), (x2, -u.y), (x2 + 1, u.x)];
                qp.add_equality(&lateral, 0.0)?;
                let forward = [0.5 * u.x, 0.5 * u.y, 0.0, 0.0, -0.5 * u.x, -0.5 * u.y];
                let tangent = (spline.control[first + 2] - spline.control[first]) * 0.5;
                let bound = tangent.dot(&u) - FORWARD * spacing;
                qp.add_row(x0, &forward, bound)?;
                if let Some(sigma) = end.curvature {
                    let speed = tangent.dot(&u);
                    // ∂(σ_0 v²/3)/∂c_2 = −∂/∂c_0 = σ_0 v u/3
                    let by = u * (sigma * speed / 3.0);
                    let curved = [
                        (x0, by.x),
                        (x0 + 1, by.y),
                        (x2, -u.y - by.x),
                        (x2 + 1, u.x - by.y),
                    ];
                    qp.add_equality(&curved, 0.0)?;
                }
            }
        }
        Ok(())
    }

    /// L + w_J J, m.
    fn value(&self, survey: &Survey) -> f64 {
        survey.length + self.jerk_weight * survey.bending
    }

    /// The value and the price of what is asked for and not met, m.
    fn merit(&self, survey: &Survey, demands: &Demands) -> f64 {
        let mut violation = 0.0;
        for least in &survey.least {
            for (clearance, asked) in least.iter().zip(&demands.clearance) {
                violation += (asked - clearance).max(0.0);
            }
        }
        let radius_squared = (self.max_curvature * self.max_curvature).recip();
        for (sigma, limit) in survey.curvature.iter().zip(&demands.curvature) {
            for s in sigma {
                // The curvature of a curve that stands still is not a number.
                let excess = if s.is_nan() {
                    f64::INFINITY
                } else {
                    s.abs() - limit
                };
                violation += radius_squared * excess.max(0.0) / sigma.len() as f64;
            }
        }
        self.value(survey) + MERIT_PRICE * violation
    }

    /// The first of `next` and points on the way to it from `current` whose merit is less than that of `current`.
    fn better_of_the_way(
        &self,
        current: &Candidate,
        mut next: Candidate,
        demands: &Demands,
        meter: &mut Meter<'_>,
    ) -> Option<Candidate> {
        let merit = self.merit(&current.survey, demands);
        for _ in 0..SHORTENINGS {
            if self.merit(&next.survey, demands) < merit {
                break;
            }
            if !meter.step_dearly() {
                return None;
            }
            next = self.candidate(current.spline.towards(&next.spline, SHORTER), meter)?;
        }
        // A merit that is not a number is no improvement.
        (self.merit(&next.survey, demands) < merit).then_some(next)
    }

    /// Asks for more where the curve may not be ridden.
    fn demand_more(&self, faults: &[(usize, Fault)], demands: &mut Demands) {
        for (segment, fault) in faults {
            match fault {
                Fault::Blocked => demands.clearance[*segment] += MORE_CLEARANCE * self.scale,
                Fault::Tight => demands.curvature[*segment] *= LESS_CURVATURE,
                // The programme's hard rows ask for it already.
                Fault::Backward => {}
            }
        }
    }

    /// Whether the curve leaves and arrives along its headings, not against them.
    fn is_forward(&self, curves: &[FergusonCurve]) -> bool {
        let ends = [
            curves.first().map(FergusonCurve::start_tangent),
            curves.last().map(FergusonCurve::end_tangent),
        ];
        self.ends.iter().zip(ends).all(|(end, tangent)| {
            end.direction
                .is_none_or(|u| tangent.is_some_and(|tangent| tangent.dot(&u) > 0.0))
        })
    }

    /// What keeps `candidate` from being ridden; nothing if it is certified, and then it is kept if it is the cheapest. `None` if the meter
    /// runs out.
    fn certify(
        &self,
        candidate: &Candidate,
        spacing: f64,
        best: &mut Option<Refined>,
        meter: &mut Meter<'_>,
        observe: &mut dyn FnMut(u64, &Refined),
    ) -> Option<Vec<(usize, Fault)>> {
        let go_on = || !meter.is_stopped();
        let faults = faults(&candidate.curves, self.max_curvature, self.checker, &go_on);
        // Stopped in its midst it counts for nothing, as with that many iterations it would.
        if !meter.step_dearly() {
            return None;
        }
        let mut faults = faults?;
        if !self.is_forward(&candidate.curves) {
            faults.push((0, Fault::Backward));
        }
        let survey = &candidate.survey;
        let cost = self.length_weight * self.value(survey);
        if faults.is_empty()
            && cost.is_finite()
            && best.as_ref().is_none_or(|best| cost < best.cost)
        {
            let better = best.insert(Refined {
                curves: candidate.curves.clone(),
                length: survey.length,
                bending: survey.bending,
                cost,
                rounds: 0,
                spacing,
            });
            observe(meter.iterations(), better);
        }
        Some(faults)
    }
}

/// How many segments of about `spacing` (m) make up `length` (m); `None` if there would be too many.
fn segments(length: f64, spacing: f64) -> Option<usize> {
    let wanted = (length / spacing).ceil();
    (wanted <= MOST_SEGMENTS).then_some((wanted as usize).max(FEWEST_SEGMENTS))
}

/// Begins a round. It counts as several iterations of the meter, so that a deadline is looked at in every round.
fn begin_round(meter: &mut Meter<'_>) -> bool {
    (0..Meter::CHECK_EVERY).all(|_| meter.step())
}
