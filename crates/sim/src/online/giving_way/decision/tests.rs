use super::*;
use bikebot_geometry::{FergusonCurve, Point2, Vector2};
use proptest::prelude::*;

const BRAKING: BrakingLimits = BrakingLimits {
    service: 0.5,
    emergency: 1.0,
};

fn straight() -> CurvePath {
    CurvePath::new(vec![FergusonCurve::straight(
        Point2::new(0.0, 0.0),
        Point2::new(40.0, 0.0),
    )])
    .unwrap()
}

fn giving_way() -> GivingWay {
    GivingWay::new(&GivingWayParams::default(), &Footprint::bike(), 0.05)
}

fn ride(path: &CurvePath, s: f64, speed: f64) -> Ride<'_> {
    Ride {
        time: 0.0,
        s,
        speed,
        path,
        profile: &|_| 1.5,
        braking: BRAKING,
        up: 0.3,
        stop: None,
    }
}

/// A disc of 0.3 m that is well known.
fn disc(id: u64, x: f64, y: f64, vx: f64, vy: f64) -> Sighted {
    let (at, velocity) = (Point2::new(x, y), Vector2::new(vx, vy));
    Sighted {
        announced: Mover::straight(id, at, velocity, [0.65, 0.1, 0.05]),
        believed: Mover::straight(id, at, velocity, [0.35, 0.05, 0.0]),
    }
}

fn courses(counsel: &Counsel) -> Vec<Course> {
    counsel.turns.iter().map(|turn| turn.course).collect()
}

#[test]
fn nobody_is_given_way_to_who_does_not_come_near() {
    let path = straight();
    for far in [
        disc(1, 10.0, 5.0, 1.0, 0.0),
        disc(1, 2.0, 2.5, -1.5, 0.3),
        // Has left the path, and goes on.
        disc(1, 6.0, 2.0, 0.0, 1.2),
    ] {
        let counsel = giving_way().weigh(&[far], &ride(&path, 0.0, 1.5));
        assert_eq!(counsel, Counsel::default(), "{far:?}");
    }
}

#[test]
fn who_would_be_met_is_given_way_to_before_the_place() {
    let path = straight();
    // Both come to x = 5.5 at the same time.
    let counsel = giving_way().weigh(&[disc(1, 5.5, -3.3, 0.0, 1.2)], &ride(&path, 0.0, 1.5));
    assert!(
        counsel.stop_at.is_some() || counsel.speed_cap.is_some(),
        "{counsel:?}"
    );
    if let Some(stop) = counsel.stop_at {
        // The front is 1.46 m ahead of the rear contact.
        assert!(stop < 5.5 - 1.46 - 0.3, "{stop}");
    }
}

#[test]
fn one_that_stands_on_the_way_is_stopped_for_and_not_slowly_run_over() {
    let path = straight();
    let counsel = giving_way().weigh(&[disc(1, 6.0, 0.0, 0.0, 0.0)], &ride(&path, 0.0, 1.5));
    let stop = counsel.stop_at.expect("a stop");
    assert!((1.25..6.0 - 1.46 - 0.65).contains(&stop), "{stop}");
}

#[test]
fn who_comes_late_is_passed_and_who_changes_his_mind_a_little_still_is() {
    let path = straight();
    let mut giving_way = giving_way();
    // 4 m ahead, but 9 m off the path.
    let late = |y: f64| disc(1, 3.0, -y, 0.0, 1.2);
    let counsel = giving_way.weigh(&[late(9.0)], &ride(&path, 0.0, 1.5));
    assert_eq!((counsel.stop_at, counsel.speed_cap), (None, None));
    assert_eq!(courses(&counsel), [Course::Pass]);
    // Told once.
    let counsel = giving_way.weigh(&[late(8.6)], &ride(&path, 0.15, 1.5));
    assert_eq!((counsel.stop_at, counsel.turns.len()), (None, 0));
}

#[test]
fn who_was_given_way_to_is_not_passed_for_a_hair() {
    let path = straight();
    let at = |y: f64| [disc(1, 5.0, -y, 0.0, 1.2)];
    // The least distance from which an undecided bike goes first.
    let first = |giving_way: &GivingWay| {
        (30..200)
            .map(|k| 0.1 * f64::from(k))
            .find(|y| {
                let counsel = giving_way.clone().weigh(&at(*y), &ride(&path, 0.0, 1.5));
                counsel.stop_at.is_none() && counsel.speed_cap.is_none()
            })
            .unwrap()
    };
    let undecided = giving_way();
    let with = |course| GivingWay {
        courses: vec![(1, course)],
        ..giving_way()
    };
    let (yielding, passing) = (with(Course::Yield), with(Course::Pass));
    let found = [&passing, &undecided, &yielding].map(first);
    assert!(
        found[0] < found[1] - 0.4 && found[2] > found[1] + 0.4,
        "{found:?}"
    );
}

#[test]
fn one_who_steps_out_too_near_is_unavoidable_and_braked_for() {
    let path = straight();
    // Steps before the wheel: 0.5 m ahead of the front.
    let counsel = giving_way().weigh(&[disc(7, 2.2, -0.6, 0.0, 0.5)], &ride(&path, 0.0, 1.5));
    assert_eq!(counsel.stop_at, Some(0.0));
    let turn = counsel.turns[0];
    assert_eq!((turn.id, turn.course), (7, Course::Unavoidable));
    assert!(
        turn.contact < 1.0 && turn.stopping_distance > 1.25,
        "{turn:?}"
    );
}

#[test]
fn a_waiting_bike_goes_on_when_the_place_is_free() {
    let path = straight();
    let mut giving_way = giving_way();
    let (mut y, mut went) = (-2.0, None);
    for step in 0..100 {
        let counsel = giving_way.weigh(&[disc(1, 4.0, y, 0.0, 1.2)], &ride(&path, 1.0, 0.0));
        match counsel.stop_at {
            None => {
                went.get_or_insert(y);
            }
            Some(stop) => {
                assert!(
                    went.is_none() && stop < 2.0,
                    "went at {went:?}, and stops at {stop} at {y}"
                );
            }
        }
        y += 0.06;
        assert!(step < 99 || went.is_some());
    }
    // Setting off takes the second or two that the other needs to leave the lane.
    assert!((-1.2..1.0).contains(&went.unwrap()), "{went:?}");
}

#[test]
fn a_slower_one_ahead_is_followed() {
    let path = straight();
    let mut giving_way = giving_way();
    let (mut s, mut speed, mut x): (f64, f64, f64) = (0.0, 1.5, 8.0);
    let mut least = f64::INFINITY;
    for _ in 0..400 {
        let counsel = giving_way.weigh(&[disc(1, x, 0.0, 0.8, 0.0)], &ride(&path, s, speed));
        let wanted = counsel.speed_cap.unwrap_or(1.5).min(
            counsel
                .stop_at
                .map_or(1.5, |stop| (2.0 * 0.5 * (stop - s).max(0.0)).sqrt()),
        );
        speed += (wanted - speed).clamp(-0.05, 0.015);
        s += 0.05 * speed;
        x += 0.05 * 0.8;
        least = least.min(x - 0.3 - (s + 1.46));
        assert!(speed >= 0.0);
    }
    assert!(least > 0.3, "{least}");
    assert!(s > 10.0, "it follows: {s}");
}

proptest! {
    // Each case is a ride of 20 s.
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// A bike that does as it is told, and things that go straight on: they never meet if the first look left the stopping distance.
    #[test]
    fn who_goes_straight_on_and_was_seen_in_time_is_never_met(
        x in 4.0..16.0_f64,
        y in 2.0..9.0_f64,
        speed in 0.3..2.0_f64,
        aslant in -0.9..0.9_f64,
        x2 in 4.0..16.0_f64,
        y2 in 2.0..9.0_f64,
        speed2 in 0.3..2.0_f64,
    ) {
        let path = straight();
        let mut giving_way = giving_way();
        let first = (Point2::new(x, -y), Vector2::new(aslant.sin(), aslant.cos()) * speed);
        let second = (Point2::new(x2, y2), Vector2::new(0.0, -speed2));
        let (mut s, mut v): (f64, f64) = (0.0, 1.5);
        let dt = 0.05;
        for step in 0..400 {
            let t = dt * f64::from(step);
            let at = |(p, v): (Point2, Vector2)| p + v * t;
            let seen = |id, mover: (Point2, Vector2)| {
                let p = at(mover);
                disc(id, p.x, p.y, mover.1.x, mover.1.y)
            };
            let counsel = giving_way.weigh(&[seen(1, first), seen(2, second)], &ride(&path, s, v));
            let left = counsel.stop_at.map_or(f64::INFINITY, |stop| (stop - 0.05 - s).max(0.0));
            let wanted = counsel.speed_cap.unwrap_or(1.5).min((2.0 * 0.5 * left).sqrt());
            let hardest = if v * v > 2.0 * 0.55 * left { 0.9 } else { 0.5 };
            v = (v + (wanted - v).clamp(-hardest * dt, 0.3 * dt)).max(0.0);
            s += v * dt;
            for mover in [first, second] {
                let p = at(mover);
                // The capsule from 0.04 behind to 1.16 ahead of the rear contact, 0.3 about it.
                let dx = (s - 0.04 - p.x).max(p.x - s - 1.16).max(0.0);
                let gap = dx.hypot(p.y) - 0.3 - 0.3;
                let is_run_into = v < 0.02;
                prop_assert!(gap > 0.0 || is_run_into, "{gap} m at {t} s, s {s}, v {v}");
            }
        }
    }
}
