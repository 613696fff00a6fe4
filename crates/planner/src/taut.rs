//! Pulling a polyline tight: the shortest path that can be reached from it without passing over an obstacle.
//!
//! A shortest path touches obstacles at its vertices and is straight in between. From any free polyline it is reached in
//! three ways, each of which only ever shortens:
//!
//! * **prune**: from each kept vertex gallop (1, 2, 4, …), then bisect to the farthest visible one, and drop what lies between;
//! * **slide**: move a vertex along one of its legs as long as the other leg stays free. The one leg stays where it is, so
//!   only the other is to be checked. Slides along both legs bring a vertex to the corner it goes around;
//! * **cut**: where the two legs touch different corners, or a round one, replace the vertex by two; or let a neighbour give
//!   way by a few millimetres, if that is what holds the vertex.
//!
//! A blind bisection asks for five positions and two legs each, most of them close to touching, where a check is dearest.
//! A refused leg knows better: it names a place it was refused at, and the obstacle's point nearest to
//! that. The line from the leg's fixed end past that point, half a resolution off, is where the slide would have to stop if
//! that point were the corner. If it is, one check confirms it; if not, the next refusal names a better one. Bisection is left for where this does
//! not get on. A vertex is looked at again only after a neighbour of it has moved.
//!
//! Every leg of the result is one that the checker accepts (or was one of the input), and the result is never longer than
//! the input. It keeps the way the input went around obstacles, unless a leg finds a short way through by chance.

use crate::budget::Meter;
use crate::motion::MotionChecker;
use bikebot_geometry::{Point2, Vector2};

/// Rounds at most. Each shortens, and they end when nothing does: this is never met in practice.
const MAX_ROUNDS: u32 = 100;
/// A round that shortens the path by less than this part of its length is slow, and three such rounds are the end.
const SLOW_GAIN: f64 = 3e-4;
const SLOW_ROUNDS: u32 = 3;
/// Neighbours look again at a vertex that gained more than this part of the path's length.
const NOTABLE_GAIN: f64 = 1e-5;
/// Two vertices in place of one must be worth this part of the path's length.
const CUT_GAIN: f64 = 1e-4;
/// Checks for one slide.
const SLIDE_CHECKS: u32 = 10;
/// Where a corner is cut, in parts of its two legs.
const CUTS: [(f64, f64); 6] = [
    (1.0, 0.5),
    (0.5, 1.0),
    (0.25, 0.25),
    (0.25, 1.0),
    (1.0, 0.25),
    (0.06, 0.06),
];
/// How far a vertex may be moved outward to mend its other leg, in distances of a touching leg.
const OUTWARD: f64 = 10.0;
/// How far a vertex is moved outward to let its neighbour pass, in distances of a touching leg.
const GIVE: f64 = 2.0;
/// After so many rounds a path is compared with its rivals, and dropped if this many times as long. A round brings most paths
/// within a few per cent of where they end.
const FIRST_COMPARISON: u32 = 1;
const FAR_LONGER: f64 = 1.25;
/// And again, now also with the way it takes.
const SECOND_COMPARISON: u32 = 3;
const LONGER: f64 = 1.03;
/// Paths whose lengths differ by less than this part are taken to go the same way around everything.
const SAME_WAY: f64 = 2e-3;

/// Taut lengths known already: a path that is not going to be better need not be finished.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rivals<'a> {
    /// Lengths of the taut paths found so far, m, in any order.
    pub lengths: &'a [f64],
    /// How much more length, m, a path may have than the shortest of them: what the later stages may make up for. 3 · scale.
    pub slack: f64,
}

impl Rivals<'_> {
    /// Every path is pulled tight to the end.
    #[must_use]
    pub fn none() -> Self {
        Self {
            lengths: &[],
            slack: 0.0,
        }
    }

    fn best(&self) -> f64 {
        self.lengths.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Whether one of them is as long as `length` (m), and therefore most probably goes the same way around everything.
    pub(crate) fn has_the_like_of(&self, length: f64) -> bool {
        self.lengths
            .iter()
            .any(|known| (known - length).abs() <= SAME_WAY * known)
    }
}

/// How the pulling ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// There was nothing more to gain.
    Taut,
    /// It was given up: longer than its rivals.
    Longer,
    /// It was given up, or is done: as long as one of its rivals, most probably the same way around everything.
    Repeated,
    /// The budget ended; the path is as short as it was by then.
    CutShort,
}

/// What [`pull`] made of a path.
#[derive(Debug, Clone, PartialEq)]
pub struct Pulled {
    /// The vertices, with the ends of the input.
    pub path: Vec<Point2>,
    /// Its length, m.
    pub length: f64,
    /// Why it ended.
    pub ending: Ending,
    /// Rounds over all vertices.
    pub rounds: u32,
}

/// Pulls `path`, which must be free for `checker`, tight between its ends.
///
/// For any footprint but a point or a disc, give the [inscribed](MotionChecker::inscribed) checker: vertices turn on the
/// spot. Each motion checked counts as an iteration of the budget.
#[must_use]
pub fn pull(
    path: &[Point2],
    rivals: &Rivals<'_>,
    checker: &MotionChecker<'_>,
    meter: &mut Meter<'_>,
) -> Pulled {
    let before = length_of(path);
    let mut band = Band::new(path, before, checker, meter);
    band.prune();
    let (ending, rounds) = band.tighten(rivals);
    let pulled: Vec<_> = band.vertices.iter().map(|v| v.position).collect();
    let length = length_of(&pulled);
    // Gains below the rounding of a sum of many legs may not show in it.
    let (path, length) = if length <= before {
        (pulled, length)
    } else {
        (path.to_vec(), before)
    };
    Pulled {
        path,
        length,
        ending,
        rounds,
    }
}

fn length_of(path: &[Point2]) -> f64 {
    path.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum()
}

/// How much shorter a–b is than a–v–b, m.
fn detour(a: Point2, v: Point2, b: Point2) -> f64 {
    (v - a).norm() + (b - v).norm() - (b - a).norm()
}

/// The point of the segment from `a` to `b` nearest to `p`.
fn foot(a: Point2, b: Point2, p: Point2) -> Point2 {
    let span = b - a;
    let squared = span.norm_squared();
    if squared == 0.0 {
        return a;
    }
    a + span * ((p - a).dot(&span) / squared).clamp(0.0, 1.0)
}

#[derive(Debug, Clone, Copy)]
struct Vertex {
    position: Point2,
    /// To be slid: it, or a neighbour, has moved.
    restless: bool,
    /// To be cut: it, or a neighbour, has moved since that was last tried.
    uncut: bool,
}

impl Vertex {
    fn new(position: Point2) -> Self {
        Self {
            position,
            restless: true,
            uncut: true,
        }
    }
}

/// A leg of a slide: the vertex at one end moves, the other stays.
#[derive(Clone, Copy)]
struct Slide {
    /// Where the vertex is, and the end of the leg along which it moves.
    from: Point2,
    to: Point2,
    /// The fixed end of the leg that is checked.
    pivot: Point2,
    /// Whether the path comes from the pivot.
    leaves_pivot: bool,
}

impl Slide {
    fn at(&self, t: f64) -> Point2 {
        self.from + (self.to - self.from) * t
    }

    /// Where to stop so that the leg passes the obstacle's point `corner` at the distance `berth`; `None` if it would not pass it.
    fn stop_at(&self, corner: Point2, berth: f64) -> Option<f64> {
        let to_corner = corner - self.pivot;
        let distance = to_corner.norm();
        let span = self.to - self.from;
        let side = to_corner.perp(&(self.from - self.pivot)).signum();
        let sine = (berth / distance).min(1.0);
        let along = to_corner / distance;
        let across = Vector2::new(-along.y, along.x) * side;
        let direction = along * (1.0 - sine * sine).sqrt() + across * sine;
        let t = (self.pivot - self.from).perp(&direction) / span.perp(&direction);
        // Anything that is not a number falls through here.
        if !(0.0..1.0).contains(&t) {
            return None;
        }
        let leg = self.at(t) - self.pivot;
        let passed = leg.dot(&direction);
        (passed >= 0.0 && to_corner.dot(&direction) <= passed).then_some(t)
    }
}

struct Band<'c, 'w, 'm, 'b> {
    checker: &'c MotionChecker<'w>,
    meter: &'m mut Meter<'b>,
    vertices: Vec<Vertex>,
    length: f64,
    /// Distance of a touching leg from the obstacle, for the centre of the disc, m: a hair more than the checker asks for.
    berth: f64,
    /// Shorter ways are not worth a check, m.
    fineness: f64,
}

impl<'c, 'w, 'm, 'b> Band<'c, 'w, 'm, 'b> {
    fn new(
        path: &[Point2],
        length: f64,
        checker: &'c MotionChecker<'w>,
        meter: &'m mut Meter<'b>,
    ) -> Self {
        let resolution = checker.resolution();
        let floor = checker.inscribed_radius() + checker.margin() + 0.5 * resolution;
        let mut vertices: Vec<_> = path.iter().copied().map(Vertex::new).collect();
        vertices.dedup_by(|a, b| a.position == b.position);
        Self {
            checker,
            meter,
            vertices,
            length,
            berth: floor + (0.05 * resolution).max(1e-6 * length),
            fineness: (0.25 * resolution).max(1e-6 * length),
        }
    }

    fn position(&self, i: usize) -> Point2 {
        self.vertices[i].position
    }

    /// Where a motion is refused; when the budget has ended every motion is, so that nothing moves any more.
    fn obstruction(&mut self, from: Point2, to: Point2) -> Option<Point2> {
        if !self.meter.step() {
            return Some(from);
        }
        self.checker.obstruction(from, to)
    }

    fn is_free(&mut self, from: Point2, to: Point2) -> bool {
        self.obstruction(from, to).is_none()
    }

    fn corner_at(&self, place: Point2) -> Point2 {
        self.checker.world().nearest_obstacle_point(place)
    }

    fn wake(&mut self, i: usize) {
        if let Some(vertex) = self.vertices.get_mut(i) {
            (vertex.restless, vertex.uncut) = (true, true);
        }
    }

    /// Wakes the neighbours of vertex `i`, if what it gained is worth it.
    fn tell_neighbours(&mut self, i: usize, gain: f64) {
        self.length -= gain;
        if gain > NOTABLE_GAIN * self.length {
            self.wake(i - 1);
            self.wake(i + 1);
        }
    }

    fn tighten(&mut self, rivals: &Rivals<'_>) -> (Ending, u32) {
        if self.vertices.len() < 3 {
            return (self.verdict(rivals), 0);
        }
        let best = rivals.best();
        let mut slow = 0;
        for round in 1..=MAX_ROUNDS {
            let before = self.length;
            let mut i = 1;
            while i + 1 < self.vertices.len() {
                if self.vertices[i].restless && self.settle(i) {
                    continue;
                }
                i += 1;
            }
            if before - self.length < SLOW_GAIN * before {
                self.cut_corners();
                self.prune();
            }
            if self.meter.cut_short().is_some() {
                return (Ending::CutShort, round);
            }
            slow = if before - self.length < SLOW_GAIN * before {
                slow + 1
            } else {
                0
            };
            let inner = self.vertices.len() - 1;
            let at_rest = !self.vertices[1..inner]
                .iter()
                .any(|v| v.restless || v.uncut);
            if at_rest || slow >= SLOW_ROUNDS {
                return (self.verdict(rivals), round);
            }
            if round == FIRST_COMPARISON && self.length > FAR_LONGER * best + rivals.slack
                || round == SECOND_COMPARISON && self.length > LONGER * best + rivals.slack
            {
                return (Ending::Longer, round);
            }
            if round == SECOND_COMPARISON && rivals.has_the_like_of(self.length) {
                return (Ending::Repeated, round);
            }
        }
        (self.verdict(rivals), MAX_ROUNDS)
    }

    fn verdict(&self, rivals: &Rivals<'_>) -> Ending {
        if rivals.has_the_like_of(self.length) {
            Ending::Repeated
        } else {
            Ending::Taut
        }
    }

    /// Drops vertices that the path need not visit: from each kept vertex it goes on to the farthest visible one.
    fn prune(&mut self) {
        let last = self.vertices.len().saturating_sub(1);
        let mut kept = 0;
        let mut from = 0;
        while from < last {
            let (mut seen, mut hidden) = (from + 1, last + 1);
            let mut stride = 2;
            while seen < last && hidden > last {
                let next = (from + stride).min(last);
                if self.is_free(self.position(from), self.position(next)) {
                    seen = next;
                    stride *= 2;
                } else {
                    hidden = next;
                }
            }
            while hidden <= last && hidden - seen > 1 {
                let middle = seen + (hidden - seen) / 2;
                if self.is_free(self.position(from), self.position(middle)) {
                    seen = middle;
                } else {
                    hidden = middle;
                }
            }
            let skips = seen > from + 1;
            // Vertices up to `kept` are final; `kept` never overtakes `from`.
            self.vertices[kept] = self.vertices[from];
            if skips {
                let mut way: f64 = 0.0;
                for i in from..seen {
                    way += (self.position(i + 1) - self.position(i)).norm();
                }
                self.length -= way - (self.position(seen) - self.position(from)).norm();
                self.wake(kept);
                self.wake(seen);
            }
            kept += 1;
            from = seen;
        }
        if last > 0 {
            self.vertices[kept] = self.vertices[last];
            self.vertices.truncate(kept + 1);
        }
    }

    /// Moves vertex `i` to the corner it goes around; `true` if it has been dropped instead, or replaced by two.
    fn settle(&mut self, i: usize) -> bool {
        let (a, start, b) = (self.position(i - 1), self.position(i), self.position(i + 1));
        let Some(place) = self.obstruction(a, b) else {
            self.vertices.remove(i);
            self.length -= detour(a, start, b);
            self.wake(i - 1);
            self.wake(i);
            return true;
        };
        self.vertices[i].restless = false;
        let corner = self.corner_at(place);
        let (v, after) = self.slide(
            Slide {
                from: start,
                to: a,
                pivot: b,
                leaves_pivot: false,
            },
            corner,
        );
        let (v, before) = self.slide(
            Slide {
                from: v,
                to: b,
                pivot: a,
                leaves_pivot: true,
            },
            corner,
        );
        self.vertices[i].position = v;
        let gain = detour(a, start, b) - detour(a, v, b);
        self.tell_neighbours(i, gain);
        let (first, second) = (foot(a, v, before), foot(v, b, after));
        // Past a point touched, the path turns about it. From where the leg is nearest to that point it could only turn into it.
        let chord = second - first;
        let back_off = |touching: Point2, end: Point2, leg: Vector2, chord: Vector2| {
            let turn = leg.angle(&chord);
            let room = (end - touching).norm();
            let shift = (self.berth * (0.5 * turn).tan()).min(room);
            if shift > 0.0 {
                touching + (end - touching) * (shift / room)
            } else {
                touching
            }
        };
        let backed = (
            back_off(first, a, v - first, chord),
            back_off(second, b, second - v, chord),
        );
        let nearer = |part: f64| (v + (first - v) * part, v + (second - v) * part);
        for (p, q) in [backed, nearer(1.0), nearer(0.5), nearer(0.25)] {
            if detour(p, v, q) > CUT_GAIN * self.length && self.replace(i, p, q) {
                break;
            }
        }
        false
    }

    /// The farthest the vertex gets, and the obstacle's point that the moving leg touches there.
    ///
    /// `corner` is where the leg from `slide.to`, the end of the way, is refused.
    fn slide(&mut self, slide: Slide, corner: Point2) -> (Point2, Point2) {
        let way = (slide.to - slide.from).norm();
        let (mut reached, mut refused) = (0.0, 1.0);
        // What the vertex is near is a good guess for what it is going around.
        let near = self.corner_at(slide.from);
        let mut touched = corner;
        let mut aim = [near, corner]
            .into_iter()
            .filter_map(|c| Some((slide.stop_at(c, self.berth)?, c)))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((t, c)) = aim
            && t * way <= self.fineness
        {
            return (slide.from, c);
        }
        for _ in 0..SLIDE_CHECKS {
            if (refused - reached) * way <= self.fineness {
                break;
            }
            let aimed = aim.filter(|(t, _)| *t > reached && *t < refused);
            let t = aimed.map_or(0.5 * (reached + refused), |(t, _)| t);
            match self.leg_obstruction(slide.pivot, slide.at(t), slide.leaves_pivot) {
                None => {
                    reached = t;
                    if let Some((_, corner)) = aimed {
                        touched = corner;
                        break;
                    }
                    aim = slide.stop_at(touched, self.berth).map(|t| (t, touched));
                }
                Some(place) => {
                    let gets_on = aimed.is_none() || refused - t >= 0.5 * (refused - reached);
                    refused = t;
                    touched = self.corner_at(place);
                    aim = slide
                        .stop_at(touched, self.berth)
                        .filter(|_| gets_on)
                        .map(|t| (t, touched));
                }
            }
        }
        let v = slide.at(reached);
        let stays = (slide.from, touched);
        if reached == 0.0 {
            return stays;
        }
        // Part of a free leg is free, but the checker may not be able to tell, and the path is to consist of legs it accepts.
        let Some(place) = self.leg_obstruction(slide.to, v, !slide.leaves_pivot) else {
            return (v, touched);
        };
        // Such a leg passes an obstacle at less than half a resolution. Turning a little farther out mends that.
        let outward = (v - slide.pivot).normalize() * (OUTWARD * self.berth);
        let mending = Slide {
            from: v,
            to: v + outward,
            pivot: slide.to,
            leaves_pivot: !slide.leaves_pivot,
        };
        let Some(t) = mending.stop_at(self.corner_at(place), self.berth) else {
            return stays;
        };
        let v = mending.at(t);
        let is_shorter =
            detour(slide.to, v, slide.pivot) < detour(slide.to, slide.from, slide.pivot);
        let is_accepted = is_shorter
            && self
                .leg_obstruction(mending.pivot, v, mending.leaves_pivot)
                .is_none()
            && self
                .leg_obstruction(slide.pivot, v, slide.leaves_pivot)
                .is_none();
        if is_accepted { (v, touched) } else { stays }
    }

    fn leg_obstruction(&mut self, pivot: Point2, v: Point2, leaves_pivot: bool) -> Option<Point2> {
        let (from, to) = if leaves_pivot { (pivot, v) } else { (v, pivot) };
        self.obstruction(from, to)
    }

    /// Cuts the corners that have not been since they or their neighbours moved.
    fn cut_corners(&mut self) {
        let mut i = 1;
        while i + 1 < self.vertices.len() {
            if self.vertices[i].uncut {
                self.vertices[i].uncut = false;
                let v = self.position(i);
                let off = (self.corner_at(v) - v).norm() - self.berth;
                // A vertex that touches an obstacle has nowhere to go.
                if off > 2.0 * self.fineness && !self.give_way(i, true) && !self.give_way(i, false)
                {
                    self.cut(i);
                }
            }
            i += 1;
        }
    }

    /// Moves the vertex next to `i` (ahead or behind) a little outward and slides `i` along its other leg; `true` if that pays.
    ///
    /// A vertex that touches an obstacle stands so close to it that hardly any other leg can be led past: the neighbour would
    /// be held where it is for a few millimetres.
    fn give_way(&mut self, i: usize, ahead: bool) -> bool {
        let (near, far, other) = if ahead {
            (i + 1, i + 2, i - 1)
        } else {
            (i - 1, i.wrapping_sub(2), i + 1)
        };
        if far >= self.vertices.len() {
            return false;
        }
        let [v, old, beyond, end] = [i, near, far, other].map(|k| self.position(k));
        let leg = old - beyond;
        let pivot = old + leg * (GIVE * self.berth / leg.norm());
        let slide = Slide {
            from: v,
            to: end,
            pivot,
            leaves_pivot: !ahead,
        };
        let gives = self.leg_obstruction(beyond, pivot, !ahead).is_none()
            && self.leg_obstruction(pivot, v, !ahead).is_none();
        if !gives {
            return false;
        }
        let moved = match self.leg_obstruction(pivot, end, !ahead) {
            None => end,
            Some(place) => self.slide(slide, self.corner_at(place)).0,
        };
        let before = length_of(&[end, v, old, beyond]);
        let gain = before - length_of(&[end, moved, pivot, beyond]);
        let pays = gain > NOTABLE_GAIN * self.length;
        if pays {
            self.vertices[i].position = moved;
            self.vertices[near].position = pivot;
            self.length -= gain;
            for k in [i, near, far, other] {
                self.wake(k);
            }
            if moved == end {
                self.vertices.remove(i);
            }
        }
        pays
    }

    /// Cuts a corner where it gains most.
    fn cut(&mut self, i: usize) {
        let (a, v, b) = (self.position(i - 1), self.position(i), self.position(i + 1));
        let mut cuts = CUTS.map(|(back, ahead)| {
            let (p, q) = (v + (a - v) * back, v + (b - v) * ahead);
            (detour(p, v, q), p, q)
        });
        cuts.sort_by(|a, b| b.0.total_cmp(&a.0));
        let least = CUT_GAIN * self.length;
        for (gain, p, q) in cuts {
            if gain > least && self.replace(i, p, q) {
                return;
            }
        }
        // Close to a corner the parts above are all too much.
        let (back, ahead) = ((a - v).norm(), (b - v).norm());
        let mut distance = 0.5 * back.min(ahead);
        loop {
            let p = v + (a - v) * (distance / back);
            let q = v + (b - v) * (distance / ahead);
            // Anything that is not a number ends this, too.
            let is_worth_it = detour(p, v, q) > least;
            if !is_worth_it || self.replace(i, p, q) {
                return;
            }
            distance *= 0.5;
        }
    }

    /// Puts `p` on the leg before vertex `i` and `q` on the leg after it in its place, if the path stays free.
    fn replace(&mut self, i: usize, p: Point2, q: Point2) -> bool {
        let (a, v, b) = (self.position(i - 1), self.position(i), self.position(i + 1));
        let (keeps_a, keeps_b) = (p == a, q == b);
        if !self.is_free(p, q)
            || (!keeps_a && !self.is_free(a, p))
            || (!keeps_b && !self.is_free(q, b))
        {
            return false;
        }
        let new = [(p, keeps_a), (q, keeps_b)];
        let new = new
            .into_iter()
            .filter(|(_, drop)| !drop)
            .map(|(p, _)| Vertex::new(p));
        let count = new.clone().count();
        self.vertices.splice(i..=i, new);
        self.length -= detour(p, v, q);
        self.wake(i - 1);
        self.wake(i + count);
        true
    }
}

#[cfg(test)]
mod tests;
