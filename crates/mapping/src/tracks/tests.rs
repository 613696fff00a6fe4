use super::*;
use crate::{BeliefGrid, MapperParams};
use bikebot_dynamics::{LaserParams, LaserScanner};
use bikebot_geometry::{Pose2, Vector2};
use bikebot_world::{Bounds, Footprint, Obstacle, World};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// A room with furniture, a bike that looks on from a place or along a way, and discs that move.
struct Scene {
    furniture: Vec<Obstacle>,
    scanner: LaserScanner,
    mapper: Mapper,
    tracker: Tracker,
    params: TrackerParams,
    rng: ChaCha8Rng,
    time: f64,
}

const HALF: f64 = 12.0;

fn bounds() -> Bounds {
    Bounds {
        min: Point2::new(-HALF, -HALF),
        max: Point2::new(HALF, HALF),
    }
}

impl Scene {
    fn new(seed: u64) -> Self {
        let laser = LaserParams {
            range_sigma: 0.02,
            range_sigma_per_range: 0.001,
            dropout_probability: 0.02,
            ..LaserParams::default()
        };
        let params = MapperParams::default();
        let belief = BeliefGrid::over(bounds(), params.cell).unwrap();
        let block = |x: f64, y: f64, w: f64, h: f64| Obstacle::Block {
            min: Point2::new(x, y),
            max: Point2::new(x + w, y + h),
        };
        Self {
            furniture: vec![
                block(5.0, 6.0, 2.0, 1.0),
                block(-6.0, -8.0, 1.0, 3.0),
                Obstacle::Disc {
                    center: Point2::new(7.0, -7.0),
                    radius: 0.8,
                },
            ],
            scanner: LaserScanner::new(&laser).unwrap(),
            mapper: Mapper::new(&params, &laser, Some(&Footprint::bike()), belief).unwrap(),
            tracker: Tracker::new(&params.tracker),
            params: params.tracker,
            rng: ChaCha8Rng::seed_from_u64(seed),
            time: 0.0,
        }
    }

    /// One scan, 50 ms after the last; the discs are (centre, radius). The poses told are as wrong as the parameters say.
    fn scan(&mut self, pose: Pose2, discs: &[(Point2, f64)]) {
        let mut obstacles = self.furniture.clone();
        obstacles.extend(discs.iter().map(|(center, radius)| Obstacle::Disc {
            center: *center,
            radius: *radius,
        }));
        let world = World::new(bounds(), obstacles).unwrap();
        let mut scan = self.scanner.scan(&world, &pose, 0.0, &mut self.rng);
        self.time += 0.05;
        scan.start = self.time;
        scan.beam_period = 0.0;
        let mut normal = || {
            // Twelve uniform numbers make a normal one.
            let uniform = |rng: &mut ChaCha8Rng| {
                use rand::Rng;
                (rng.next_u64() >> 11) as f64 * 2.0_f64.powi(-53)
            };
            (0..12).map(|_| uniform(&mut self.rng)).sum::<f64>() - 6.0
        };
        let measured = Pose2::new(
            pose.position.x + 0.01 * normal(),
            pose.position.y + 0.01 * normal(),
            pose.heading + 0.15_f64.to_radians() * normal(),
        );
        self.mapper.insert(&scan, |_| (measured, 0.0)).unwrap();
        self.tracker.update(&self.mapper);
    }

    /// Looks about for a second before anything moves.
    fn settle(&mut self, pose: Pose2) {
        for _ in 0..20 {
            self.scan(pose, &[]);
        }
    }
}

#[test]
fn a_walker_is_found_where_it_is_and_as_fast_as_it_is() {
    let pose = Pose2::new(-6.0, 0.0, 0.0);
    for (seed, velocity) in [
        (1, Vector2::new(0.0, 1.2)),
        (2, Vector2::new(-1.0, 0.3)),
        (3, Vector2::new(0.5, -1.5)),
    ] {
        let mut scene = Scene::new(seed);
        scene.settle(pose);
        let start = Point2::new(0.0, -2.0 * velocity.y);
        let (mut worst, mut worst_speed): (f64, f64) = (0.0, 0.0);
        let mut ids = Vec::new();
        for step in 0..80 {
            let centre = start + velocity * (0.05 * f64::from(step));
            scene.scan(pose, &[(centre, 0.3)]);
            if step < 20 {
                continue;
            }
            let tracks: Vec<_> = scene.tracker.tracks().copied().collect();
            assert_eq!(tracks.len(), 1, "seed {seed}, step {step}");
            let track = tracks[0];
            worst = worst.max((track.position_at(scene.time) - centre).norm());
            worst_speed = worst_speed.max((track.velocity() - velocity).norm());
            assert!((track.radius() - 0.3).abs() < 0.1, "{}", track.radius());
            assert!(track.age() > 0.5);
            ids.push(track.id());
        }
        ids.dedup();
        assert_eq!(ids.len(), 1, "the same one all the time: {ids:?}");
        // Under three standard deviations of what the filter says of itself, 0.03 m and 0.2 m/s; twice what is measured.
        assert!(worst < 0.08, "seed {seed}: {worst} m");
        assert!(worst_speed < 0.4, "seed {seed}: {worst_speed} m/s");
    }
}

#[test]
fn who_is_slow_is_found_once_he_has_gone_a_little() {
    // Slower than three standard deviations of the velocity, 0.7 m/s.
    let pose = Pose2::new(-6.0, 0.0, 0.0);
    for seed in 0..4 {
        let mut scene = Scene::new(seed);
        scene.settle(pose);
        let found = (0..60).find(|step| {
            let y = -1.0 + 0.5 * 0.05 * f64::from(*step);
            scene.scan(pose, &[(Point2::new(0.0, y), 0.3)]);
            scene.tracker.tracks().count() == 1
        });
        // A quarter of a metre takes half a second.
        assert!(
            found.is_some_and(|step| step <= 20),
            "seed {seed}: {found:?}"
        );
    }
}

#[test]
fn nothing_moves_in_a_noisy_room_that_stands_still() {
    // 600 scans of 1081 beams from a bike that rides about: half a minute.
    let mut scene = Scene::new(7);
    for step in 0..600 {
        let t = 0.05 * f64::from(step);
        let (sin, cos) = (0.25 * t).sin_cos();
        scene.scan(Pose2::new(4.0 * cos, 4.0 * sin, 0.25 * t + 1.6), &[]);
        assert_eq!(scene.tracker.tracks().count(), 0, "a ghost at {t} s");
    }
}

#[test]
fn walkers_that_cross_keep_their_names() {
    let pose = Pose2::new(-7.0, 0.0, 0.0);
    let mut swapped = 0;
    for seed in 0..8 {
        let mut scene = Scene::new(seed);
        scene.settle(pose);
        let at = |step: u32| {
            let t = 0.05 * f64::from(step) - 2.5;
            [
                Point2::new(0.0, 1.2 * t),
                Point2::new(1.0 + 0.1 * t, -1.2 * t),
            ]
        };
        let mut names = [None; 2];
        for step in 0..100 {
            let centres = at(step);
            scene.scan(pose, &centres.map(|centre| (centre, 0.3)));
            if step == 30 || step == 99 {
                let near = centres.map(|centre| {
                    scene
                        .tracker
                        .tracks()
                        .min_by(|a, b| {
                            let off =
                                |track: &Track| (track.position_at(scene.time) - centre).norm();
                            off(a).total_cmp(&off(b))
                        })
                        .filter(|track| (track.position_at(scene.time) - centre).norm() < 0.5)
                        .map(Track::id)
                });
                assert!(
                    near[0].is_some() && near[1].is_some(),
                    "seed {seed}: {near:?}"
                );
                assert_ne!(near[0], near[1]);
                if step == 30 {
                    names = near;
                } else if near == [names[1], names[0]] {
                    swapped += 1;
                }
            }
        }
    }
    assert_eq!(swapped, 0, "of 8 crossings");
}

#[test]
fn what_stops_becomes_a_part_of_the_map() {
    let pose = Pose2::new(-6.0, 0.0, 0.0);
    let mut scene = Scene::new(4);
    scene.settle(pose);
    let at = |t: f64| Point2::new(0.0, -2.0 + 1.2 * t.min(2.0));
    for step in 0..140 {
        scene.scan(pose, &[(at(0.05 * f64::from(step)), 0.3)]);
        if step == 35 {
            assert_eq!(scene.tracker.tracks().count(), 1);
        }
    }
    // 5 s after it stopped: settled for 3, forgotten after one more.
    assert_eq!(scene.tracker.tracks().count(), 0);
    let surface = Point2::new(-0.28, 0.4);
    assert_eq!(
        scene.mapper.belief().at(surface),
        Some(bikebot_world::Cell::Occupied)
    );
}

#[test]
fn one_out_of_sight_is_expected_where_it_was_going_and_then_forgotten() {
    let pose = Pose2::new(-6.0, 0.0, 0.0);
    let mut scene = Scene::new(5);
    scene.settle(pose);
    for step in 0..40 {
        let centre = Point2::new(0.0, -2.0 + 0.06 * f64::from(step));
        scene.scan(pose, &[(centre, 0.3)]);
    }
    for _ in 0..10 {
        scene.scan(pose, &[]);
    }
    let track = *scene.tracker.tracks().next().expect("not given up yet");
    let expected = Point2::new(0.0, -2.0 + 0.06 * 49.0);
    assert!((track.position_at(scene.time) - expected).norm() < 0.3);
    assert!(track.position_sigma_at(scene.time, &scene.params) > 2.0 * track.position_sigma());
    for _ in 0..15 {
        scene.scan(pose, &[]);
    }
    assert_eq!(scene.tracker.tracks().count(), 0);
}

#[test]
fn equal_rides_give_equal_tracks() {
    let ride = || {
        let pose = Pose2::new(-6.0, 0.0, 0.0);
        let mut scene = Scene::new(9);
        scene.settle(pose);
        for step in 0..30 {
            scene.scan(
                pose,
                &[(Point2::new(0.0, -1.0 + 0.05 * f64::from(step)), 0.3)],
            );
        }
        scene.tracker.tracks().copied().collect::<Vec<_>>()
    };
    let first = ride();
    assert_eq!(first.len(), 1);
    assert_eq!(first, ride());
}
