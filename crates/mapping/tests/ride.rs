//! A weaving, leaning ride among obstacles with everything a little wrong: what the belief is worth then.

use bikebot_dynamics::laser::Prisms;
use bikebot_dynamics::{LaserParams, LaserScanner};
use bikebot_geometry::{Point2, Pose2};
use bikebot_mapping::{BeliefGrid, Mapper, MapperParams};
use bikebot_world::{Bounds, Cell, Footprint, Obstacle, World};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const HALF: f64 = 15.0;

fn uniform(rng: &mut ChaCha8Rng) -> f64 {
    (rng.next_u64() >> 11) as f64 * 2.0_f64.powi(-53)
}

/// Twelve uniform numbers make a normal one.
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| uniform(rng)).sum::<f64>() - 6.0
}

fn bounds(half: f64) -> Bounds {
    Bounds {
        min: Point2::new(-half, -half),
        max: Point2::new(half, half),
    }
}

/// Where the bike is at a time: on a wavy circle, a round in half a minute, leaning up to 15° into its bends.
fn motion(t: f64) -> (Pose2, f64) {
    let phase = 0.2 * t;
    let radius = 6.0 + 0.8 * (5.0 * phase).sin();
    let (sin, cos) = phase.sin_cos();
    let (dr, r) = (4.0 * (5.0 * phase).cos(), radius);
    let heading = (r * cos + dr * sin).atan2(dr * cos - r * sin);
    let roll = -0.1 - 0.16 * (5.0 * phase).sin();
    (Pose2::new(r * cos, r * sin, heading), roll)
}

/// Posts and blocks, none within a metre of the way.
fn field(rng: &mut ChaCha8Rng) -> Vec<Obstacle> {
    let mut obstacles = Vec::new();
    while obstacles.len() < 14 {
        let mut coordinate = || (2.0 * uniform(rng) - 1.0) * (HALF - 2.0);
        let (x, y) = (coordinate(), coordinate());
        let size = 0.2 + uniform(rng);
        let is_clear = (0..400).all(|i| {
            let (pose, _) = motion(0.1 * f64::from(i));
            (pose.position - Point2::new(x, y)).norm() > 2.2 + size
        });
        if is_clear {
            obstacles.push(if obstacles.len() % 2 == 0 {
                Obstacle::Disc {
                    center: Point2::new(x, y),
                    radius: size,
                }
            } else {
                Obstacle::Block {
                    min: Point2::new(x - size, y - 0.5 * size),
                    max: Point2::new(x + size, y + 0.5 * size),
                }
            });
        }
    }
    obstacles
}

#[test]
fn a_noisy_leaning_ride_leaves_nothing_solid_free_and_flips_few_cells() {
    for seed in 0..3 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let obstacles = field(&mut rng);
        let world = World::new(bounds(HALF), obstacles.clone()).expect("a field");
        let alone = World::new(bounds(100.0), obstacles).expect("a field");
        let laser = LaserParams {
            range_sigma: 0.02,
            range_sigma_per_range: 0.001,
            dropout_probability: 0.02,
            ..LaserParams::default()
        };
        let scanner = LaserScanner::new(&laser).expect("a laser");
        let params = MapperParams::default();
        let belief = BeliefGrid::over(bounds(HALF), params.cell).expect("a grid");
        let mut mapper =
            Mapper::new(&params, &laser, Some(&Footprint::bike()), belief).expect("a mapper");
        let scene = Prisms {
            world: &world,
            height: laser.obstacle_height,
        };
        let (mut flips, mut deepest, mut false_hits) = (0, 0.0_f64, 0);
        for scan in 0..600 {
            let start = 0.05 * f64::from(scan);
            let sweep = scanner.sweep(&scene, start, motion, &mut rng);
            // Errors of the pose and the roll last for a scan.
            let (dx, dy) = (0.02 * normal(&mut rng), 0.02 * normal(&mut rng));
            let dh = 0.2_f64.to_radians() * normal(&mut rng);
            let da = 0.3_f64.to_radians() * normal(&mut rng);
            let changes = mapper
                .insert(&sweep, |t| {
                    let (pose, roll) = motion(t);
                    let p = pose.position;
                    (Pose2::new(p.x + dx, p.y + dy, pose.heading + dh), roll + da)
                })
                .expect("a scan");
            if scan >= 300 {
                flips += changes.len();
            }
        }
        let grid = mapper.belief().grid();
        let (mut free, mut solid) = (0, 0);
        for y in 0..grid.height {
            for x in 0..grid.width {
                let centre = grid.cell_centre(x, y);
                let clearance = alone.clearance(centre);
                match grid.cells[y * grid.width + x] {
                    Cell::Free => {
                        free += 1;
                        deepest = deepest.max(-clearance);
                    }
                    Cell::Occupied => {
                        solid += 1;
                        // To the nearest surface, of an obstacle or of the field's wall.
                        let off = clearance.abs().min(world.clearance(centre).abs());
                        false_hits += usize::from(off > 0.3);
                    }
                    Cell::Unknown => {}
                }
            }
        }
        // Most of the field is seen to be free, and obstacles are there.
        assert!(free > 280_000, "seed {seed}: {free} free");
        assert!(solid > 3000, "seed {seed}: {solid} solid");
        // The ground never becomes an obstacle: cells stand out by no more than three deviations of pose and range (6 cm for the
        // position, 16 cm for the heading at 15 m, 10 cm for the range) and a cell.
        assert_eq!(false_hits, 0, "seed {seed}");
        // No centre of a free cell lies inside anything by much more than the deviation of the position.
        assert!(deepest < 0.03, "seed {seed}: {deepest} m deep");
        // Once half a round is done, a scan changes a few of 360 000 cells.
        assert!(
            flips < 300 * 100,
            "seed {seed}: {flips} changes in 300 scans"
        );
    }
}
