use super::*;
use proptest::prelude::*;

fn tree_of(points: &[Point2]) -> KdTree {
    let mut tree = KdTree::new();
    for (id, &point) in points.iter().enumerate() {
        assert!(tree.insert(point, id as u32));
    }
    tree
}

/// All neighbours by a linear scan, nearest first, ties by id.
fn scan(points: &[Point2], query: Point2) -> Vec<Neighbor> {
    let mut all: Vec<_> = points
        .iter()
        .enumerate()
        .map(|(id, p)| Neighbor {
            id: id as u32,
            distance_squared: squared(query.x - p.x, query.y - p.y),
        })
        .collect();
    all.sort_by(Neighbor::order);
    all
}

fn agrees_with_the_scan(points: &[Point2], queries: &[Point2], radius: f64) {
    let tree = tree_of(points);
    assert_eq!(tree.len(), points.len());
    let mut found = Vec::new();
    for &query in queries {
        let expected = scan(points, query);
        assert_eq!(tree.nearest(query), expected.first().copied());
        let inside: Vec<_> = expected
            .iter()
            .copied()
            .filter(|n| n.distance_squared <= radius * radius)
            .collect();
        tree.within(query, radius, &mut found);
        found.sort_by(Neighbor::order);
        assert_eq!(found, inside);
        for limit in [1, 7, 40] {
            tree.nearest_within(query, limit, f64::INFINITY, &mut found);
            assert_eq!(found, expected[..limit.min(expected.len())]);
            tree.nearest_within(query, limit, radius, &mut found);
            assert_eq!(found, inside[..limit.min(inside.len())]);
        }
    }
}

fn logarithmic(points: usize) -> usize {
    2 * (points.max(2) as f64 / 6.0).log2().ceil() as usize + 4
}

proptest! {
    #[test]
    fn finds_what_a_linear_scan_finds(
        points in prop::collection::vec((0.0..100.0f64, 0.0..100.0f64), 1..400),
        queries in prop::collection::vec((-20.0..120.0f64, -20.0..120.0f64), 1..8),
        radius in 0.0..60.0f64,
    ) {
        let points: Vec<_> = points.into_iter().map(|(x, y)| Point2::new(x, y)).collect();
        let queries: Vec<_> = queries.into_iter().map(|(x, y)| Point2::new(x, y)).collect();
        agrees_with_the_scan(&points, &queries, radius);
    }

    /// Small integers: most coordinates and many distances are equal, so ties decide.
    #[test]
    fn finds_the_same_among_equal_coordinates(
        points in prop::collection::vec((0..6i32, 0..6i32), 1..400),
        queries in prop::collection::vec((-1..7i32, -1..7i32), 1..8),
        radius in 0..4i32,
    ) {
        let at = |(x, y): (i32, i32)| Point2::new(f64::from(x), f64::from(y));
        let points: Vec<_> = points.into_iter().map(at).collect();
        let queries: Vec<_> = queries.into_iter().map(at).collect();
        agrees_with_the_scan(&points, &queries, f64::from(radius));
    }
}

fn orders(n: usize) -> Vec<(&'static str, Vec<Point2>)> {
    let along = |i: usize| i as f64 / n as f64;
    vec![
        (
            "rising",
            (0..n).map(|i| Point2::new(along(i), along(i))).collect(),
        ),
        (
            "falling",
            (0..n)
                .map(|i| Point2::new(-along(i), 0.5 * along(i)))
                .collect(),
        ),
        (
            "along x only",
            (0..n).map(|i| Point2::new(along(i), 3.0)).collect(),
        ),
        (
            "inward spiral",
            (0..n)
                .map(|i| {
                    let r = 1.0 - along(i);
                    Point2::new(r * (40.0 * r).cos(), r * (40.0 * r).sin())
                })
                .collect(),
        ),
        (
            "halving towards a point",
            (0..n)
                .map(|i| Point2::new(0.5f64.powi((i % 1000) as i32), along(i)))
                .collect(),
        ),
        (
            "two alternating ends",
            (0..n)
                .map(|i| Point2::new(if i % 2 == 0 { along(i) } else { -along(i) }, 0.0))
                .collect(),
        ),
        ("one point only", vec![Point2::new(1.0, 2.0); n]),
        (
            "few columns",
            (0..n)
                .map(|i| Point2::new((i % 5) as f64, along(i)))
                .collect(),
        ),
    ]
}

#[test]
fn adversarial_orders_agree_with_the_scan() {
    for (_, points) in orders(1500) {
        let queries: Vec<_> = (0..20)
            .map(|i| Point2::new(f64::from(i) * 0.1 - 0.9, f64::from(i % 7) * 0.3))
            .collect();
        agrees_with_the_scan(&points, &queries, 0.3);
    }
}

#[test]
fn stays_logarithmically_deep_for_sorted_inserts() {
    for n in [1_000, 30_000, 200_000] {
        for (name, points) in orders(n) {
            let depth = tree_of(&points).depth();
            assert!(depth <= logarithmic(n), "{name}, {n} points: depth {depth}");
        }
    }
}

#[test]
fn separates_a_point_from_a_crowd_of_equals() {
    let mut points = vec![Point2::new(1.0, 1.0); 100];
    points.push(Point2::new(1.0, 1.5));
    points.extend(vec![Point2::new(1.0, 1.0); 100]);
    points.push(Point2::new(0.5, 1.0));
    agrees_with_the_scan(
        &points,
        &[Point2::new(1.0, 1.4), Point2::new(0.0, 1.0)],
        0.5,
    );
}

#[test]
fn negative_zero_is_zero() {
    let mut points = vec![Point2::new(-0.0, 0.0), Point2::new(0.0, -0.0)];
    points.extend(
        (0..60).map(|i| Point2::new(if i % 2 == 0 { 0.0 } else { -0.0 }, f64::from(i % 3))),
    );
    agrees_with_the_scan(&points, &[Point2::new(-0.0, -0.0)], 1.0);
}

#[test]
fn refuses_what_is_not_finite_and_answers_nothing_to_nonsense() {
    let mut tree = KdTree::with_capacity(10);
    assert!(tree.nearest(Point2::origin()).is_none());
    assert!(!tree.insert(Point2::new(f64::NAN, 0.0), 0));
    assert!(!tree.insert(Point2::new(0.0, f64::INFINITY), 0));
    assert!(tree.is_empty());
    assert!(tree.insert(Point2::origin(), 7));
    assert!(tree.nearest(Point2::new(f64::NAN, 0.0)).is_none());
    let mut found = vec![];
    tree.within(Point2::origin(), f64::NAN, &mut found);
    assert!(found.is_empty());
    tree.within(Point2::new(f64::NAN, 0.0), 1.0, &mut found);
    assert!(found.is_empty());
}

#[test]
fn huge_coordinates_do_not_overflow_the_split() {
    let points: Vec<_> = (0..100)
        .map(|i| Point2::new(if i % 2 == 0 { f64::MAX } else { f64::MIN }, f64::from(i)))
        .collect();
    assert_eq!(tree_of(&points).len(), 100);
}
