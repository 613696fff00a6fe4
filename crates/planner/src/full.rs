//! The default method: certified curves of continuous curvature, the cheapest that the budget allows (planning note, 4.6).
//!
//! | step | stage | yields |
//! |---|---|---|
//! | first | [`shortest`], [`guide::search`] | the exact shortest polyline, or one by search on the clearance grid |
//! | again and again | [`birrt::search`] | other polylines, round obstacles on other sides |
//! | each | [`taut::pull`] | the shortest polyline of its class |
//! | each | [`refine::apply`] | a certified curve along it, or along the polyline with its ends bent ([`end_arcs`](crate::end_arcs)) |
//! | where that fails | [`corridor::search`] | a certified path of curves, for [`refine::polish`] to smooth |
//! | the cheapest | [`refine::polish`] | the same on finer control points |
//!
//! The starts that follow the first are made in batches of fixed size. All of a batch know the same rivals, those found before it, and
//! each owns its stream of chance; results are taken in the order of their numbers. So they may run on any number of threads,
//! and the plan is the same. Where an iteration budget ends in the midst of a batch, the start it ends in is made again with what is
//! left for it, as if all had run one after the other.

mod found;
mod starts;

pub(crate) use found::{Best, FullSearch, Step};

use crate::budget::Meter;
use crate::chance::{Chance, Purpose};
use crate::connection::Connector;
use crate::connectivity;
use crate::corridor;
use crate::corridor_ends::Ends;
use crate::end_arcs::DubinsWord;
use crate::guide;
use crate::motion::MotionChecker;
use crate::params::{GoalMode, PlannerParams};
use crate::problem::PlanningProblem;
use crate::refine::{self, Refined};
use crate::report::Stage;
use crate::shortest::shortest;
use crate::taut::{self, Ending, Pulled, Rivals};
use bikebot_geometry::{CurvePath, ParametricCurve, Point2, Polyline, Pose2, Vector2, angle};
use found::{Tell, Way, step};

/// Starts of a batch. Rivals are shared between batches only: more of them would find more paths twice.
const BATCH: u32 = 8;
/// Samples of a BiRRT start when a way is known already.
const SAMPLES: u64 = 3000;
/// Iterations for the exact shortest way: before anything else is tried, a tenth of a millisecond among a few obstacles; and once there is
/// a path, tens of milliseconds among thousands.
const QUICK: u64 = 100;
/// Cells of the clearance field beyond which there are too many obstacles for the quick try.
const SIMPLE: usize = 50_000;
const PATIENT: u64 = 10_000;
/// Part of its length by which a taut polyline may be longer than the shortest way it stands for.
const TOUCHING: f64 = 1e-3;
/// The guide is looked for on every fourth cell of the grid along x and y, then, if there is no way, on every second; and on all of them.
const PITCHES: [usize; 3] = [4, 2, 1];
/// Cells along the field of the floods that look for a proof, once the grid has shown no way.
const FLOODS: [usize; 2] = [64, 256];
/// Spacing of the polish: this part of the spacing it starts from, which counts as no more than so many scales.
const FINER: f64 = 0.5;
const POLISH_SPACING: f64 = 2.0;
/// Way, in scales, on which a steering angle that has to jump is taken to turn. It makes the bending of a path with jumps finite, and dear: one of
/// continuous curvature is as good as always cheaper.
const JUMP: f64 = 0.01;
/// Length that later stages may make up for, in units of the scale: rivals longer by more are dropped.
const SLACK: f64 = 3.0;
/// Distance of the ends, in turning radii, up to which Dubins words are tried; and their radius: a spline of continuous curvature needs room
/// to wind up to a turn.
const NEAR: f64 = 6.0;
const WORD_RADIUS: f64 = 1.3;
/// A turn between an end's heading and the guide beyond which bending the guide may give the cheaper curve, rad.
const SHARP: f64 = std::f64::consts::FRAC_PI_3;

/// Everything the starts share; nothing of it changes.
pub(crate) struct Full<'a, 'w> {
    pub problem: &'a PlanningProblem<'w>,
    pub params: &'a PlannerParams,
    pub seed: u64,
    /// For the whole footprint.
    pub checker: &'a MotionChecker<'w>,
    /// For its inscribed disc.
    pub discs: &'a MotionChecker<'w>,
}

impl Full<'_, '_> {
    /// Searches until no start has brought a gain for as long as the parameters say, or the budget ends.
    pub fn search(&self, meter: &mut Meter<'_>, tell: Tell<'_>) -> FullSearch {
        let mut found = FullSearch::default();
        self.first(&mut found, meter, tell);
        let mut next = 1;
        let mut last_gain = 0;
        while !self.is_over(&found, meter)
            && next <= self.params.starts
            && next - last_gain <= self.params.starts_without_gain
        {
            let before = found.cost();
            self.batch(next, &mut found, meter, tell);
            next += BATCH;
            if found.cost() < before {
                last_gain = next - 1;
            }
            if !found.has_way {
                // Each of these has used up all its samples, without a proof.
                break;
            }
        }
        found
    }

    fn is_over(&self, found: &FullSearch, meter: &Meter<'_>) -> bool {
        let is_enough = |best: &Best| best.smooth && meter.is_content_with(best.cost);
        found.disconnected
            || meter.cut_short().is_some()
            || found.best.as_ref().is_some_and(is_enough)
    }

    /// The starts that need no chance. The exact shortest way comes first where it is found at once; else the grid's guide, coarse for a
    /// first path soon, fine for a better one, and then the shortest way if patience finds it.
    fn first(&self, found: &mut FullSearch, meter: &mut Meter<'_>, tell: Tell<'_>) {
        let [start, goal] = [self.problem.start.position, self.problem.goal.position];
        let (columns, rows) = self.problem.world.clearance_cells();
        let is_simple = columns * rows <= SIMPLE;
        // That the middle of a ball cannot be reached says nothing of the rest of it.
        let must_reach_goal = self.params.goal == GoalMode::Pose;
        found.disconnected = (must_reach_goal
            && connectivity::are_in_separate_regions(self.discs, start, goal, meter))
            || (is_simple && self.shortest(QUICK, found, meter, tell));
        if found.disconnected {
            return;
        }
        self.turn_at_once(found, meter, tell);
        if found.is_exact {
            self.polish(found, meter, tell);
            return;
        }
        for pitch in PITCHES {
            let is_finest = pitch == PITCHES[PITCHES.len() - 1];
            if self.is_over(found, meter) || (found.has_way && !is_finest) {
                continue;
            }
            let Some(coarse) = guide::search(self.discs, start, goal, pitch, meter) else {
                continue;
            };
            let pulled = taut::pull(&coarse, &self.rivals(&found.rivals), self.discs, meter);
            self.follow(Stage::Guide, coarse, pulled, found, meter, tell);
        }
        self.polish(found, meter, tell);
        if !self.is_over(found, meter) {
            found.disconnected = self.shortest(PATIENT, found, meter, tell);
            self.polish(found, meter, tell);
        }
        if must_reach_goal && !found.has_way && !found.disconnected {
            found.disconnected =
                connectivity::are_in_separate_rooms(self.discs, start, goal, meter)
                    || FLOODS.into_iter().any(|cells| {
                        connectivity::are_separated(self.discs, start, goal, cells, meter)
                    });
        }
    }

    /// Where start and goal are so near to each other that to turn is most of the way, the Dubins words between them are ways of their own: a
    /// polyline knows nothing of going round.
    fn turn_at_once(&self, found: &mut FullSearch, meter: &mut Meter<'_>, tell: Tell<'_>) {
        let [Some(from), Some(to)] = self.headings() else {
            return;
        };
        let [start, goal] = [self.problem.start.position, self.problem.goal.position];
        let radius = WORD_RADIUS / self.problem.max_curvature;
        if (goal - start).norm() > NEAR * radius {
            return;
        }
        let ends =
            [(start, from), (goal, to)].map(|(position, heading)| Pose2 { position, heading });
        for word in DubinsWord::between(&ends[0], &ends[1], radius) {
            if self.is_over(found, meter) || self.weight() * word.length() >= found.cost() {
                return;
            }
            let mut path: Vec<_> = word
                .poses(self.params.max_step())
                .iter()
                .map(|pose| pose.position)
                .collect();
            path.dedup();
            if let Some(last) = path.last_mut() {
                *last = goal;
            }
            let way = Way {
                number: 0,
                tree: Vec::new(),
                coarse: path.clone(),
                pulled: Pulled {
                    path,
                    length: word.length(),
                    ending: Ending::Taut,
                    rounds: 0,
                },
            };
            found.has_way = true;
            let mut told = found.cost();
            let (problem, params) = (self.problem, self.params);
            let refined = refine::apply(
                problem,
                params,
                self.checker,
                &way.pulled.path,
                meter,
                &mut |iteration, refined| {
                    if refined.cost < told {
                        told = refined.cost;
                        tell(&step(iteration, refined));
                    }
                },
            );
            if refined.is_some() {
                self.keep(&way, refined, told, found, meter, tell);
            }
        }
    }

    /// Looks for the exact shortest way for at most so many iterations, and for a curve along it if it is none of those known. `true` if it is
    /// proven that there is no way at all. In any case something is known then of how short a path can be.
    fn shortest(
        &self,
        most: u64,
        found: &mut FullSearch,
        meter: &mut Meter<'_>,
        tell: Tell<'_>,
    ) -> bool {
        let problem = self.problem;
        let tolerance = match self.params.goal {
            GoalMode::Pose => 0.0,
            GoalMode::Ball => problem.goal.tolerance,
        };
        let known = found.rivals.iter().copied().reduce(f64::min);
        let shortest = meter.at_most(most, |meter| {
            shortest(
                problem.world,
                self.discs.inscribed_radius() + self.discs.margin(),
                problem.start.position,
                problem.goal.position,
                tolerance,
                // In the ball a way is shorter than one to its middle.
                known.filter(|_| tolerance == 0.0),
                meter,
            )
        });
        if shortest.length == f64::INFINITY {
            return true;
        }
        found.lower_bound = found.lower_bound.max(shortest.length);
        found.is_exact = shortest.is_exact;
        if let Some(path) = shortest.path {
            let pulled = Pulled {
                path: path.clone(),
                length: shortest.length,
                ending: Ending::Taut,
                rounds: 0,
            };
            self.follow(Stage::Shortest, path, pulled, found, meter, tell);
        }
        false
    }

    /// Refines the way `pulled`, unless it is like one of those known, and tells of it while that is under way.
    fn follow(
        &self,
        stage: Stage,
        coarse: Vec<Point2>,
        pulled: Pulled,
        found: &mut FullSearch,
        meter: &mut Meter<'_>,
        tell: Tell<'_>,
    ) {
        if !found.has_way {
            self.tell_polyline(stage, &coarse, meter, tell);
            if stage == Stage::Guide {
                self.tell_polyline(Stage::Taut, &pulled.path, meter, tell);
            }
        }
        found.has_way = true;
        let way = Way {
            number: 0,
            tree: Vec::new(),
            coarse,
            pulled,
        };
        let shortest_known = found.rivals.iter().copied().fold(f64::INFINITY, f64::min);
        let is_new = match stage {
            // A taut polyline keeps a hair off the obstacles that the shortest way touches.
            Stage::Shortest => way.pulled.length < (1.0 - TOUCHING) * shortest_known,
            _ => self.is_new(&way, &found.rivals),
        };
        if !is_new {
            return;
        }
        found.rivals.push(way.pulled.length);
        let guide = self.to_the_region(&way.pulled.path);
        let mut told = found.cost();
        let refined = self.refine(&guide, meter, &mut |iteration, refined| {
            if refined.cost < told {
                told = refined.cost;
                tell(&step(iteration, refined));
            }
        });
        self.keep(&way, refined, told, found, meter, tell);
    }

    fn rivals<'k>(&self, lengths: &'k [f64]) -> Rivals<'k> {
        Rivals {
            lengths,
            slack: SLACK * self.params.scale,
        }
    }

    /// Whether a curve along `way` may be unlike those there are already.
    fn is_new(&self, way: &Way, rivals: &[f64]) -> bool {
        let rivals = Rivals {
            lengths: rivals,
            slack: 0.0,
        };
        match way.pulled.ending {
            Ending::Taut => !rivals.has_the_like_of(way.pulled.length),
            Ending::Longer | Ending::Repeated => false,
            Ending::CutShort => true,
        }
    }

    /// A curve along `guide`, a taut polyline from start to goal, and polished: the stages that follow a way already known.
    pub fn curve_along(
        &self,
        guide: &[Point2],
        meter: &mut Meter<'_>,
        tell: Tell<'_>,
    ) -> Option<Best> {
        let guide = self.to_the_region(guide);
        let refined = self.refine(&guide, meter, &mut |_, _| {})?;
        tell(&step(meter.iterations(), &refined));
        let mut found = FullSearch {
            best: Some(Best::from(refined)),
            ..FullSearch::default()
        };
        self.polish(&mut found, meter, tell);
        found.best
    }

    /// A curve along `guide`, a taut polyline from start to goal, not polished.
    pub fn sketch_along(&self, guide: &[Point2], meter: &mut Meter<'_>) -> Option<Refined> {
        self.refine(&self.to_the_region(guide), meter, &mut |_, _| {})
    }

    /// The cheapest curve along `guide`: as it is, or with its ends bent where they turn sharply or nothing is found otherwise.
    fn refine(
        &self,
        guide: &[Point2],
        meter: &mut Meter<'_>,
        observe: &mut dyn FnMut(u64, &Refined),
    ) -> Option<Refined> {
        let (problem, params) = (self.problem, self.params);
        let refined = refine::apply(problem, params, self.checker, guide, meter, observe);
        let may_bend = params.end_arcs && self.has_headings() && meter.cut_short().is_none();
        if !may_bend || (refined.is_some() && !self.turns_sharply(guide)) {
            return refined;
        }
        let connector = Connector::new(params, problem.max_curvature, self.checker);
        let line = Polyline::new(guide.to_vec()).ok()?;
        let ends = Ends::new(problem, params, &line, &connector, meter);
        if ends.guide.vertices() == guide {
            return refined;
        }
        let bent = ends.guide.vertices();
        let bent = refine::apply(problem, params, self.checker, bent, meter, observe);
        match (refined, bent) {
            (Some(a), Some(b)) => Some(if b.cost < a.cost { b } else { a }),
            (a, b) => a.or(b),
        }
    }

    /// Makes the curve along `way` the best path, if there is one and it is the cheapest; where nothing is known at all yet,
    /// looks for one in the corridor. `told` is the cost of what has been told of already.
    fn keep(
        &self,
        way: &Way,
        refined: Option<Refined>,
        told: f64,
        found: &mut FullSearch,
        meter: &mut Meter<'_>,
        tell: Tell<'_>,
    ) {
        let stages = |found: &mut FullSearch| {
            found.stages.tree.clone_from(&way.tree);
            found.stages.coarse = Polyline::new(way.coarse.clone()).ok();
            found.stages.guide = Polyline::new(way.pulled.path.clone()).ok();
        };
        match refined {
            Some(refined) => {
                if !found.is_beaten_by(refined.cost) {
                    return;
                }
                if refined.cost < told {
                    tell(&step(meter.iterations(), &refined));
                }
                stages(found);
                found.best = Some(Best::from(refined));
            }
            None if found.best.is_none() => {
                stages(found);
                if found.corridors < self.params.guides && meter.cut_short().is_none() {
                    found.corridors += 1;
                    self.search_corridor(way, found, meter, tell);
                }
            }
            None => {}
        }
    }

    /// Refines the best path on finer control points, once.
    fn polish(&self, found: &mut FullSearch, meter: &mut Meter<'_>, tell: Tell<'_>) {
        let Some(best) = &mut found.best else {
            return;
        };
        let is_enough = best.smooth && meter.is_content_with(best.cost);
        if best.polished || is_enough || meter.cut_short().is_some() {
            return;
        }
        best.polished = true;
        let spacing = FINER * best.spacing.min(POLISH_SPACING * self.params.scale);
        let mut least = best.cost;
        let polished = refine::polish(
            self.problem,
            self.params,
            self.checker,
            &best.curves,
            spacing,
            meter,
            &mut |iteration, refined| {
                if refined.cost < least {
                    least = refined.cost;
                    tell(&step(iteration, refined));
                }
            },
        );
        if let Some(polished) = polished
            && found.is_beaten_by(polished.cost)
        {
            found.best = Some(Best {
                polished: true,
                ..Best::from(polished)
            });
        }
    }

    /// RRT* in the corridor about `way`, smoothed if that can be certified.
    fn search_corridor(
        &self,
        way: &Way,
        found: &mut FullSearch,
        meter: &mut Meter<'_>,
        tell: Tell<'_>,
    ) {
        let Ok(guide) = Polyline::new(self.to_the_region(&way.pulled.path)) else {
            return;
        };
        let mut chance = Chance::new(self.seed, Purpose::Corridor, way.number);
        let search = corridor::search(
            self.problem,
            self.params,
            self.checker,
            &guide,
            &mut chance,
            meter,
            &mut |_| {},
        );
        found.stages.corridor_tree = search.edges;
        found.stages.corridor_guide = Some(search.guide);
        found.stages.corridor_half_width = Some(self.params.corridor_half_width());
        let Some(curves) = search.path.filter(|curves| !curves.is_empty()) else {
            return;
        };
        let Ok(path) = CurvePath::new(curves.clone()) else {
            return;
        };
        if self.problem.start.curvature.is_some() {
            // A tree of curves leaves along the heading, but with any curvature: no path until it is smoothed.
            let spacing = FINER * self.params.scale;
            let smoothed = refine::polish(
                self.problem,
                self.params,
                self.checker,
                &curves,
                spacing,
                meter,
                &mut |_, _| {},
            );
            if let Some(smoothed) = smoothed {
                tell(&step(meter.iterations(), &smoothed));
                found.best = Some(Best::from(smoothed));
            }
            return;
        }
        let jerk_weight = refine::jerk_weight(self.params.corner_length());
        let length = path.length();
        // ∫ (dσ/ds)² ds over a jump Δσ turned on a way ε is Δσ²/ε.
        let jumps: f64 = curves
            .windows(2)
            .map(|pair| (pair[1].curvature(0.0) - pair[0].curvature(1.0)).powi(2))
            .sum();
        let bending = path.bending() + jumps / (JUMP * self.params.scale);
        let cost = self.weight() * (length + jerk_weight * bending);
        tell(&Step {
            stage: Stage::Corridor,
            iteration: meter.iterations(),
            length,
            cost,
            curves: Some(&curves),
        });
        found.best = Some(Best {
            curves,
            cost,
            spacing: self.params.scale,
            smooth: false,
            polished: false,
        });
    }

    /// w_p, or 1 where it is 0.
    fn weight(&self) -> f64 {
        if self.params.length_weight > 0.0 {
            self.params.length_weight
        } else {
            1.0
        }
    }

    fn headings(&self) -> [Option<f64>; 2] {
        let goal = match self.params.goal {
            GoalMode::Pose => self.problem.goal.heading,
            GoalMode::Ball => None,
        };
        [self.problem.start.heading, goal]
    }

    fn has_headings(&self) -> bool {
        self.headings().iter().any(Option::is_some)
    }

    /// Whether the guide leaves or arrives in quite another direction than the headings prescribe.
    fn turns_sharply(&self, guide: &[Point2]) -> bool {
        let [.., before, last] = guide else {
            return false;
        };
        let legs: [Vector2; 2] = [guide[1] - guide[0], last - before];
        self.headings().iter().zip(legs).any(|(heading, leg)| {
            heading
                .is_some_and(|heading| angle::difference(leg.y.atan2(leg.x), heading).abs() > SHARP)
        })
    }

    /// `path`, which leads to the goal, up to where it enters the goal's ball, if anywhere in there will do.
    fn to_the_region(&self, path: &[Point2]) -> Vec<Point2> {
        let goal = &self.problem.goal;
        if self.params.goal == GoalMode::Pose {
            return path.to_vec();
        }
        // A hair inside, so that rounding does not put the end outside.
        let radius = goal.tolerance * (1.0 - 1e-9);
        let mut cut = Vec::with_capacity(path.len());
        for (i, &vertex) in path.iter().enumerate() {
            if (vertex - goal.position).norm() > radius || i == 0 {
                cut.push(vertex);
                continue;
            }
            let before = path[i - 1];
            let (leg, to) = (vertex - before, before - goal.position);
            // |to + t leg| = radius, the first of the two
            let (a, b, c) = (
                leg.norm_squared(),
                to.dot(&leg),
                to.norm_squared() - radius * radius,
            );
            let t = (-b - (b * b - a * c).max(0.0).sqrt()) / a;
            cut.push(before + leg * t.clamp(0.0, 1.0));
            break;
        }
        cut
    }

    fn tell_polyline(&self, stage: Stage, path: &[Point2], meter: &Meter<'_>, tell: Tell<'_>) {
        let length = path.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
        tell(&Step {
            stage,
            iteration: meter.iterations(),
            length,
            cost: self.params.length_weight * length,
            curves: None,
        });
    }
}
