//! The field: a map file, shapes of the scenario, or both.

use super::{Resolver, SetupError};
use bikebot_geometry::Point2;
use bikebot_world::formats::{self, MapOptions, MapPose};
use bikebot_world::{Bounds, Obstacle, OccupancyGrid, World, WorldError};

/// A map with the ends it may name.
#[derive(Default)]
pub(super) struct Field {
    pub world: Option<World>,
    pub start: Option<MapPose>,
    pub goal: Option<MapPose>,
}

impl Resolver<'_> {
    pub(super) fn field(&mut self) -> Result<Field, SetupError> {
        let Some(map) = &self.scenario.map else {
            return Ok(Field::default());
        };
        let mut field = Field::default();
        if let Some(name) = &map.file {
            let loaded = self.load_map(name)?;
            field.start = loaded.start;
            field.goal = loaded.goal;
            field.world = Some(loaded.world);
        } else if let Some(key) = (map.meters_per_cell.map(|_| "map.meters_per_cell"))
            .or(map.unknown_is_free.then_some("map.unknown_is_free"))
        {
            return self.refuse(
                key,
                format!("`{key}` is given without `map.file`"),
                "remove it, or name a map file",
            );
        }
        let shapes = self.shapes();
        if shapes.is_empty() && map.bounds_m.is_none() {
            if field.world.is_none() {
                return self.refuse(
                    "map",
                    "[map] has neither a file nor shapes",
                    "add `file = \"maps/…\"`, or `bounds_m = [min x, min y, max x, max y]` with [[map.disc]], [[map.polygon]] or [[map.box]]",
                );
            }
            return Ok(field);
        }
        let scale = if map.file.is_none() {
            map.scale.unwrap_or(1.0)
        } else {
            1.0
        };
        let (mut obstacles, grid, file_bounds): (
            Vec<Obstacle>,
            Option<OccupancyGrid>,
            Option<Bounds>,
        ) = match field.world.take() {
            Some(world) => (
                world.obstacles().to_vec(),
                world.grid().cloned(),
                Some(world.bounds()),
            ),
            None => (Vec::new(), None, None),
        };
        let bounds = match (map.bounds_m, file_bounds) {
            (Some([x0, y0, x1, y1]), _) => Bounds {
                min: Point2::new(x0 * scale, y0 * scale),
                max: Point2::new(x1 * scale, y1 * scale),
            },
            (None, Some(bounds)) => bounds,
            (None, None) => {
                return self.refuse(
                    "map",
                    "[map] has shapes but no field",
                    "add `bounds_m = [min x, min y, max x, max y]`",
                );
            }
        };
        if bounds.min.x >= bounds.max.x || bounds.min.y >= bounds.max.y {
            return self.refuse(
                "map.bounds_m",
                "`map.bounds_m` is empty: its second corner is not above and right of its first",
                "write it as [min x, min y, max x, max y]",
            );
        }
        obstacles.extend(
            shapes
                .into_iter()
                .map(|(_, obstacle)| obstacle.scaled(scale)),
        );
        match World::build(bounds, obstacles, grid) {
            Ok(world) => field.world = Some(world),
            Err(error) => return self.refuse_world(&error),
        }
        Ok(field)
    }

    fn shapes(&self) -> Vec<(String, Obstacle)> {
        let Some(map) = &self.scenario.map else {
            return Vec::new();
        };
        let point = |p: [f64; 2]| Point2::new(p[0], p[1]);
        let discs = map.disc.iter().enumerate().map(|(i, disc)| {
            (
                format!("map.disc.{i}"),
                Obstacle::Disc {
                    center: point(disc.center_m),
                    radius: disc.radius_m,
                },
            )
        });
        let polygons = map.polygon.iter().enumerate().map(|(i, polygon)| {
            (
                format!("map.polygon.{i}"),
                Obstacle::Polygon {
                    vertices: polygon.vertices_m.iter().copied().map(point).collect(),
                },
            )
        });
        let boxes = map.block.iter().enumerate().map(|(i, block)| {
            (
                format!("map.box.{i}"),
                Obstacle::Block {
                    min: point(block.min_m),
                    max: point(block.max_m),
                },
            )
        });
        discs.chain(polygons).chain(boxes).collect()
    }

    /// Names the shape a world would not take.
    fn refuse_world<T>(&self, error: &WorldError) -> Result<T, SetupError> {
        let field = Bounds {
            min: Point2::new(-1e9, -1e9),
            max: Point2::new(1e9, 1e9),
        };
        for (key, shape) in self.shapes() {
            if let Err(error) = World::build(field, vec![shape], None) {
                return self.refuse(
                    &key,
                    format!("`{key}`: {error}"),
                    "a shape has a positive area and does not cross itself",
                );
            }
        }
        self.refuse(
            "map",
            format!("[map]: {error}"),
            "see the shapes of the map",
        )
    }

    fn load_map(&mut self, name: &str) -> Result<formats::LoadedMap, SetupError> {
        let bytes = match (self.read)(name) {
            Ok(bytes) => bytes,
            Err(reason) => {
                return self.refuse(
                    "map.file",
                    format!("map file `{name}`: {reason}"),
                    "the path is relative to the scenario file",
                );
            }
        };
        let map = self.scenario.map.clone().unwrap_or_default();
        let options = MapOptions {
            meters_per_cell: map.meters_per_cell,
            scale: map.scale.unwrap_or(1.0),
            unknown_is_free: map.unknown_is_free,
        };
        self.files.push((name.to_owned(), bytes.clone()));
        let (read, files) = (&mut self.read, &mut self.files);
        // Files named inside a map are relative to the map.
        let folder = name
            .rsplit_once('/')
            .map_or(String::new(), |(folder, _)| format!("{folder}/"));
        let mut inner = |inside: &str| {
            let path = if inside.starts_with('/') {
                inside.to_owned()
            } else {
                format!("{folder}{inside}")
            };
            let bytes = read(&path)?;
            files.push((path, bytes.clone()));
            Ok(bytes)
        };
        let loaded =
            formats::load(name, &bytes, &options, &mut inner).map_err(|error| SetupError::Map {
                error: Box::new(error),
                key: "map.file",
            })?;
        // They name the file themselves.
        self.warnings.extend(loaded.warnings.iter().cloned());
        Ok(loaded)
    }
}
