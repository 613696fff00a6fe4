//! The scenes of `scenarios/maps`, for the tests of this crate.

use bikebot_geometry::{Point2, Pose2};
use bikebot_world::{Bounds, Obstacle, World};

/// A world with the pose to start from and the pose to reach.
pub(crate) struct Scene {
    pub(crate) world: World,
    pub(crate) start: Pose2,
    pub(crate) goal: Pose2,
}

/// Reads `scenarios/maps/<name>.json`.
pub(crate) fn load(name: &str) -> Scene {
    let path = format!(
        "{}/../../scenarios/maps/{name}.json",
        env!("CARGO_MANIFEST_DIR")
    );
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let number = |v: &serde_json::Value| v.as_f64().unwrap();
    let pose = |key: &str| {
        let [x, y, degrees] = [0, 1, 2].map(|i| number(&json[key][i]));
        Pose2::new(x, y, degrees.to_radians())
    };
    let obstacles = json["obstacles"]
        .as_array()
        .unwrap()
        .iter()
        .map(|o| Obstacle::Polygon {
            vertices: o["polygon"]
                .as_array()
                .unwrap()
                .iter()
                .map(|p| Point2::new(number(&p[0]), number(&p[1])))
                .collect(),
        })
        .collect();
    let bounds = Bounds::new(0.0, 0.0, number(&json["width"]), number(&json["height"]));
    Scene {
        world: World::new(bounds, obstacles).unwrap(),
        start: pose("start"),
        goal: pose("goal"),
    }
}

/// A square room of the given size without obstacles but `obstacles`.
pub(crate) fn room(size: f64, obstacles: Vec<Obstacle>) -> World {
    World::new(Bounds::new(0.0, 0.0, size, size), obstacles).unwrap()
}

/// An axis-parallel block.
pub(crate) fn block(x0: f64, y0: f64, x1: f64, y1: f64) -> Obstacle {
    Obstacle::Block {
        min: Point2::new(x0, y0),
        max: Point2::new(x1, y1),
    }
}
