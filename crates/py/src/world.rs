//! `World`: the field and what stands in it.

use std::path::Path;
use std::sync::Arc;

use bikebot_geometry::{Point2, Pose2};
use bikebot_report::{Ground, ground_figure, svg};
use bikebot_sim::Setup;
use bikebot_world::formats::{self, MapOptions, MapPose};
use bikebot_world::{Bounds, Cell, Obstacle, OccupancyGrid, World};
use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple, PyType};

use crate::arguments::{self, number, numbers, positive, type_name};
use crate::errors::{self, kind, value};
use crate::files;
use crate::work;

/// From this probability in percent a cell is occupied, and up to this one free: the thresholds of `map_server`.
const OCCUPIED_FROM: i8 = 65;
const FREE_TO: i8 = 19;

/// Most shapes of one kind.
const MAX_SHAPES: usize = 1_000_000;

/// Who holds the world.
#[derive(Clone)]
enum Holder {
    Own(Arc<World>),
    Scenario(Arc<Setup>),
}

/// A world with its name, shared by all that plan on it.
#[derive(Clone)]
pub struct Field {
    holder: Holder,
    name: Option<Arc<str>>,
    start: Option<MapPose>,
    goal: Option<MapPose>,
}

impl Field {
    fn own(world: World, name: Option<String>) -> Self {
        Self {
            holder: Holder::Own(Arc::new(world)),
            name: name.map(Arc::from),
            start: None,
            goal: None,
        }
    }

    /// The world of a scenario, if it has one.
    pub fn of_scenario(setup: &Arc<Setup>, name: Option<String>) -> Option<Self> {
        setup.world.as_ref()?;
        Some(Self {
            holder: Holder::Scenario(setup.clone()),
            name: name.map(Arc::from),
            start: None,
            goal: None,
        })
    }

    /// The world.
    #[expect(
        clippy::expect_used,
        reason = "the constructor checks that there is one"
    )]
    pub fn world(&self) -> &World {
        match &self.holder {
            Holder::Own(world) => world,
            Holder::Scenario(setup) => setup
                .world
                .as_ref()
                .expect("a field is made only of a scenario that has a world"),
        }
    }

    /// What plan files call it.
    pub fn name(&self) -> Option<&str> {
        self.name.as_deref()
    }

    /// The name without folder and ending, for titles.
    pub fn title(&self) -> String {
        let stem = self.name().and_then(|name| Path::new(name).file_stem());
        stem.map_or_else(
            || "world".into(),
            |stem| stem.to_string_lossy().into_owned(),
        )
    }
}

/// A bounded field with solid obstacles: a grid of cells, shapes, or both.
///
/// Made by `World.load`, `World.from_array`, `World.from_shapes` or `World.from_text`; it never changes, may be
/// used from any thread, and pickles. x points right, y up, lengths are metres, angles radians counter-clockwise from +x.
/// The edge of the field is a wall.
///
/// >>> world = World.from_shapes((0, 0, 10, 10), discs=[(5, 5, 2)])
/// >>> world.bounds
/// (0.0, 0.0, 10.0, 10.0)
/// >>> world.clearance([[5.0, 1.0], [5.0, 5.0]])
/// array([ 1., -2.])
#[pyclass(name = "World", module = "bikebot", frozen)]
pub struct PyWorld {
    pub field: Field,
    warnings: Vec<String>,
}

impl From<Field> for PyWorld {
    fn from(field: Field) -> Self {
        Self {
            field,
            warnings: Vec::new(),
        }
    }
}

fn build(
    py: Python<'_>,
    bounds: Bounds,
    obstacles: Vec<Obstacle>,
    grid: Option<OccupancyGrid>,
    name: Option<String>,
) -> PyResult<Field> {
    let world = work::here(py, move |watch| {
        World::build_unless(bounds, obstacles, grid, &|| watch.is_stopped())
    })?
    .map_err(|error| errors::bad_world(py, &error.to_string()))?
    .ok_or_else(|| errors::bikebot(py, "stopped while the world was built"))?;
    Ok(Field::own(world, name))
}

/// Cells of an array, bottom row first.
fn cells(grid: &Bound<'_, PyAny>) -> PyResult<(usize, usize, Vec<Cell>)> {
    const FORMS: &str = "bool (True is occupied) or int8 as in nav_msgs/OccupancyGrid (0 to 100 is the probability in percent, -1 unknown)";
    let array = grid.cast::<PyUntypedArray>().map_err(|_| {
        kind(format!(
            "grid takes a two-dimensional numpy array, not {}: use np.asarray(grid, dtype=bool)",
            type_name(grid)
        ))
    })?;
    let &[height, width] = array.shape() else {
        return Err(value(format!(
            "grid has {} dimensions: it takes two, (rows, columns)",
            array.ndim()
        )));
    };
    if width == 0 || height == 0 {
        return Err(value(format!(
            "grid is empty: its shape is ({height}, {width})"
        )));
    }
    let dtype = array.dtype().to_string();
    match dtype.as_str() {
        "bool" => {
            // As bytes: a bool that was made of another number is no bool to Rust.
            let bytes = grid.call_method1("view", ("uint8",))?;
            let bytes: PyReadonlyArray2<'_, u8> = bytes.extract()?;
            let cells = bytes
                .as_array()
                .iter()
                .map(|&byte| match byte {
                    0 => Cell::Free,
                    _ => Cell::Occupied,
                })
                .collect();
            Ok((width, height, cells))
        }
        "int8" => {
            let percent: PyReadonlyArray2<'_, i8> = grid.extract()?;
            let mut cells = Vec::with_capacity(width * height);
            for &percent in percent.as_array() {
                cells.push(match percent {
                    -1 => Cell::Unknown,
                    OCCUPIED_FROM..=100 => Cell::Occupied,
                    0..=FREE_TO => Cell::Free,
                    20..OCCUPIED_FROM => Cell::Unknown,
                    other => {
                        return Err(value(format!(
                            "grid holds {other}: int8 cells are -1 (unknown) or 0 to 100 (percent)"
                        )));
                    }
                });
            }
            Ok((width, height, cells))
        }
        other => Err(kind(format!(
            "grid has dtype {other}: it takes {FORMS}; for others say what is occupied, such as grid > 0.5 or grid != 0"
        ))),
    }
}

fn pose(name: &str, object: Option<&Bound<'_, PyAny>>) -> PyResult<Pose2> {
    let Some(object) = object else {
        return Ok(Pose2::new(0.0, 0.0, 0.0));
    };
    let end = arguments::end(name, object)?;
    Ok(Pose2 {
        position: end.position,
        heading: end.heading.unwrap_or(0.0),
    })
}

type Triple = (f64, f64, Option<f64>);

fn triple(pose: Option<MapPose>) -> Option<Triple> {
    pose.map(|pose| (pose.position.x, pose.position.y, pose.heading))
}

fn map_pose(triple: Option<Triple>) -> Option<MapPose> {
    triple.map(|(x, y, heading)| MapPose {
        position: Point2::new(x, y),
        heading,
    })
}

fn list<'py>(
    object: Option<&Bound<'py, PyAny>>,
    name: &str,
    form: &str,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let Some(object) = object else {
        return Ok(Vec::new());
    };
    let refuse = || {
        kind(format!(
            "{name} takes a list of {form}, not {}",
            type_name(object)
        ))
    };
    if object.is_instance_of::<pyo3::types::PyString>() {
        return Err(refuse());
    }
    let mut found = Vec::new();
    for item in object.try_iter().map_err(|_| refuse())? {
        found.push(item?);
        if found.len() > MAX_SHAPES {
            return Err(value(format!("{name} holds more than {MAX_SHAPES} {form}")));
        }
    }
    Ok(found)
}

#[pymethods]
impl PyWorld {
    /// Reads a map file.
    ///
    /// `path` names a map_server `.yaml` with its image, a bare PNG, PGM or BMP, a MovingAI `.map`, a polygon scene
    /// `.json`, or a picture of characters `.txt`. `meters_per_cell` is the side of a cell in metres where the format does
    /// not say it; `scale` stretches the map about its origin; `unknown_is_free` reads unknown cells as free instead of
    /// solid.
    ///
    /// Raises `MapError` for a map that cannot be used (with `.file`, `.line` and `.key` where there are any), `OSError` for
    /// a file that cannot be read.
    #[staticmethod]
    #[pyo3(signature = (path, *, meters_per_cell=None, scale=None, unknown_is_free=false))]
    fn load(
        py: Python<'_>,
        path: &Bound<'_, PyAny>,
        meters_per_cell: Option<&Bound<'_, PyAny>>,
        scale: Option<&Bound<'_, PyAny>>,
        unknown_is_free: bool,
    ) -> PyResult<Self> {
        let path = arguments::path("path", path)?;
        let options = MapOptions {
            meters_per_cell: meters_per_cell
                .map(|it| positive("meters_per_cell", it))
                .transpose()?,
            scale: scale.map_or(Ok(1.0), |it| positive("scale", it))?,
            unknown_is_free,
        };
        let bytes = files::read(&path)?;
        let name = path.display().to_string();
        let folder = path.parent().map(Path::to_owned).unwrap_or_default();
        let loaded = work::here(py, |_| {
            let mut read =
                |inner: &str| std::fs::read(folder.join(inner)).map_err(|error| error.to_string());
            formats::load(&name, &bytes, &options, &mut read)
        })?
        .map_err(|error| errors::map(py, &error))?;
        Ok(Self {
            field: Field {
                start: loaded.start,
                goal: loaded.goal,
                ..Field::own(loaded.world, Some(name))
            },
            warnings: loaded.warnings,
        })
    }

    /// The world that a grid describes.
    ///
    /// `grid` is a numpy array of shape (rows, columns), of any strides: bool, where True is occupied, or int8 as in
    /// nav_msgs/OccupancyGrid, where 0 to 100 is the probability of an obstacle in percent (65 and more is occupied, less than 20
    /// free) and -1 unknown. Row 0 is the lowest y, as in `imshow(origin="lower")`; `rows="top_first"` says that row 0 is
    /// the top, as in pictures. `resolution` is the side of a cell in metres, `origin` the lower left corner of the grid as (x, y) in
    /// metres or (x, y, yaw).
    ///
    /// Raises `TypeError` for another dtype, `ValueError` for another shape or an empty grid, `MapError` for one too large.
    ///
    /// >>> import numpy as np
    /// >>> grid = np.zeros((40, 60), dtype=bool)
    /// >>> grid[10:, 30] = True
    /// >>> World.from_array(grid, resolution=0.25)
    /// World(15 x 10 m, 60 x 40 cells of 0.25 m)
    #[staticmethod]
    #[pyo3(signature = (grid, *, resolution, origin=None, rows="bottom_first", unknown_is_free=false, name=None))]
    fn from_array(
        py: Python<'_>,
        grid: &Bound<'_, PyAny>,
        resolution: &Bound<'_, PyAny>,
        origin: Option<&Bound<'_, PyAny>>,
        rows: &str,
        unknown_is_free: bool,
        name: Option<String>,
    ) -> PyResult<Self> {
        let (width, height, mut cells) = cells(grid)?;
        match rows {
            "bottom_first" => {}
            "top_first" => {
                cells = cells.chunks(width).rev().flatten().copied().collect();
            }
            other => {
                return Err(value(format!(
                    "rows is {other:?}: it takes \"bottom_first\" or \"top_first\""
                )));
            }
        }
        let resolution = positive("resolution", resolution)?;
        let origin = pose("origin", origin)?;
        let mut grid = OccupancyGrid::new(width, height, resolution, origin, cells)
            .map_err(|error| errors::bad_world(py, &error.to_string()))?;
        if unknown_is_free {
            grid = grid.with_unknown_as(Cell::Free);
        }
        let field = build(py, grid.bounds(), Vec::new(), Some(grid), name)?;
        Ok(field.into())
    }

    /// A field with shapes in it.
    ///
    /// `bounds` is (min x, min y, max x, max y); `discs` are (x, y, radius), `boxes` (min x, min y, max x, max y), `polygons`
    /// lists of vertices [[x, y], …]; all in metres. Shapes may overlap and stick out of the field.
    ///
    /// Raises `ValueError` or `TypeError` naming the argument, `MapError` for shapes that are none.
    ///
    /// >>> World.from_shapes((0, 0, 10, 10), boxes=[(4, 0, 5, 7)], polygons=[[(7, 4), (9, 4), (8, 6)]])
    /// World(10 x 10 m, 2 shapes)
    #[staticmethod]
    #[pyo3(signature = (bounds, *, discs=None, boxes=None, polygons=None, name=None))]
    fn from_shapes(
        py: Python<'_>,
        bounds: &Bound<'_, PyAny>,
        discs: Option<&Bound<'_, PyAny>>,
        boxes: Option<&Bound<'_, PyAny>>,
        polygons: Option<&Bound<'_, PyAny>>,
        name: Option<String>,
    ) -> PyResult<Self> {
        const BOUNDS: &str = "(min x, min y, max x, max y) in metres";
        let [x0, y0, x1, y1] = numbers("bounds", bounds, BOUNDS)?;
        let mut obstacles = Vec::new();
        let form = "(x, y, radius) in metres";
        for (index, disc) in list(discs, "discs", form)?.iter().enumerate() {
            let [x, y, radius] = numbers(&format!("discs[{index}]"), disc, form)?;
            obstacles.push(Obstacle::Disc {
                center: Point2::new(x, y),
                radius,
            });
        }
        for (index, block) in list(boxes, "boxes", BOUNDS)?.iter().enumerate() {
            let [x0, y0, x1, y1] = numbers(&format!("boxes[{index}]"), block, BOUNDS)?;
            obstacles.push(Obstacle::Block {
                min: Point2::new(x0, y0),
                max: Point2::new(x1, y1),
            });
        }
        let form = "polygons [[x, y], …]";
        for (index, polygon) in list(polygons, "polygons", form)?.iter().enumerate() {
            let vertices = arguments::points(&format!("polygons[{index}]"), polygon)?;
            obstacles.push(Obstacle::Polygon { vertices });
        }
        let field = build(py, Bounds::new(x0, y0, x1, y1), obstacles, None, name)?;
        Ok(field.into())
    }

    /// A world out of a picture made of characters: one is one cell, the first line the top row.
    ///
    /// `#` is occupied, `.` free, `?` unknown; `S` and `G` mark start and goal on free cells.
    ///
    /// >>> world = World.from_text("....\n.##.\nS..G", meters_per_cell=2.0)
    /// >>> world.start, world.goal
    /// ((1.0, 1.0, None), (7.0, 1.0, None))
    #[staticmethod]
    #[pyo3(signature = (text, *, meters_per_cell=None, unknown_is_free=false, name=None))]
    fn from_text(
        py: Python<'_>,
        text: &str,
        meters_per_cell: Option<&Bound<'_, PyAny>>,
        unknown_is_free: bool,
        name: Option<String>,
    ) -> PyResult<Self> {
        let options = MapOptions {
            meters_per_cell: Some(
                meters_per_cell.map_or(Ok(1.0), |it| positive("meters_per_cell", it))?,
            ),
            scale: 1.0,
            unknown_is_free,
        };
        let loaded = work::here(py, |_| {
            formats::load("<text>.txt", text.as_bytes(), &options, &mut |_| {
                Err("a picture names no files".into())
            })
        })?
        .map_err(|error| errors::map(py, &error))?;
        Ok(Self {
            field: Field {
                start: loaded.start,
                goal: loaded.goal,
                ..Field::own(loaded.world, name)
            },
            warnings: loaded.warnings,
        })
    }

    /// What the world is called: the path it was loaded from, the name given, or None.
    #[getter]
    fn name(&self) -> Option<&str> {
        self.field.name()
    }

    /// The field as (min x, min y, max x, max y), m.
    #[getter]
    fn bounds(&self) -> (f64, f64, f64, f64) {
        let b = self.field.world().bounds();
        (b.min.x, b.min.y, b.max.x, b.max.y)
    }

    /// Side of a cell, m; None without a grid.
    #[getter]
    fn resolution(&self) -> Option<f64> {
        self.field.world().grid().map(|grid| grid.resolution)
    }

    /// Lower left corner and yaw of the grid as (x, y, yaw), m and rad; None without a grid.
    #[getter]
    fn origin(&self) -> Option<(f64, f64, f64)> {
        let origin = self.field.world().grid()?.origin;
        Some((origin.position.x, origin.position.y, origin.heading))
    }

    /// The start that the map names, as (x, y, heading); None if it names none.
    #[getter]
    fn start(&self) -> Option<Triple> {
        triple(self.field.start)
    }

    /// The goal that the map names, as (x, y, heading); None if it names none.
    #[getter]
    fn goal(&self) -> Option<Triple> {
        triple(self.field.goal)
    }

    /// What a user should know of the map file: what was assumed, or looks wrong.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// The cells as `World.from_array` takes them: int8 of shape (rows, columns), 100 occupied, 0 free, -1 unknown, bottom row
    /// first. A copy; None without a grid.
    fn to_array<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<i8>>>> {
        let Some(grid) = self.field.world().grid() else {
            return Ok(None);
        };
        let percent = grid.cells.iter().map(|cell| match cell {
            Cell::Free => 0,
            Cell::Occupied => 100,
            Cell::Unknown => -1,
        });
        let flat = PyArray1::from_iter(py, percent);
        Ok(Some(flat.reshape([grid.height, grid.width])?))
    }

    /// The obstacles that are not cells, as `from_shapes` takes them: a dict of "discs" (n, 3) with x, y, radius, "boxes" (n, 4) with the
    /// least and the greatest x and y, and "polygons", a list of arrays (k, 2); m.
    #[getter]
    fn shapes<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (mut discs, mut boxes, mut polygons) = (Vec::new(), Vec::new(), Vec::new());
        for obstacle in self.field.world().obstacles() {
            match obstacle {
                Obstacle::Disc { center, radius } => discs.extend([center.x, center.y, *radius]),
                Obstacle::Block { min, max } => boxes.extend([min.x, min.y, max.x, max.y]),
                Obstacle::Polygon { vertices } => {
                    let flat: Vec<f64> = vertices.iter().flat_map(|v| [v.x, v.y]).collect();
                    polygons.push(PyArray1::from_vec(py, flat).reshape([vertices.len(), 2])?);
                }
            }
        }
        let rows = |flat: Vec<f64>, columns: usize| {
            let count = flat.len() / columns;
            PyArray1::from_vec(py, flat).reshape([count, columns])
        };
        let shapes = PyDict::new(py);
        shapes.set_item("discs", rows(discs, 3)?)?;
        shapes.set_item("boxes", rows(boxes, 4)?)?;
        shapes.set_item("polygons", polygons)?;
        Ok(shapes)
    }

    /// Signed distance from each point to the nearest obstacle or the edge of the field, m: negative inside of one.
    ///
    /// `points` is an array of shape (n, 2) or a list of (x, y), m; the result has shape (n,).
    fn clearance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let points: Vec<Point2> = match points.extract::<PyReadonlyArray2<'_, f64>>() {
            Ok(array) => {
                let &[_, 2] = array.shape() else {
                    return Err(value(format!(
                        "points has shape {:?}: it takes (n, 2)",
                        array.shape()
                    )));
                };
                let view = array.as_array();
                view.rows()
                    .into_iter()
                    .map(|row| Point2::new(row[0], row[1]))
                    .collect()
            }
            Err(_) => arguments::points("points", points)?,
        };
        if points.iter().any(|p| !(p.x.is_finite() && p.y.is_finite())) {
            return Err(value("points holds a number that is not finite"));
        }
        let field = &self.field;
        let distances = work::here(py, move |watch| {
            let mut distances = Vec::with_capacity(points.len());
            for chunk in points.chunks(4096) {
                if watch.is_stopped() {
                    break;
                }
                distances.extend(chunk.iter().map(|p| field.world().clearance(*p)));
            }
            distances
        })?;
        Ok(PyArray1::from_vec(py, distances))
    }

    /// Makes now what plans on this world would make as they come by. No answer depends on it, only how long the first one takes.
    fn prepare(&self, py: Python<'_>) -> PyResult<()> {
        let field = &self.field;
        work::here(py, |watch| {
            field.world().prepare(&|| watch.is_stopped());
        })
    }

    /// The map as an SVG picture.
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        let field = &self.field;
        work::here(py, |_| {
            svg::write(&ground_figure(Ground::from(field.world()), field.title()))
        })
    }

    fn _repr_svg_(&self, py: Python<'_>) -> PyResult<String> {
        self.svg(py)
    }

    fn __repr__(&self) -> String {
        let world = self.field.world();
        let bounds = world.bounds();
        let mut text = format!(
            "World({} x {} m",
            tidy(bounds.width()),
            tidy(bounds.height())
        );
        if let Some(grid) = world.grid() {
            text.push_str(&format!(
                ", {} x {} cells of {} m",
                grid.width,
                grid.height,
                tidy(grid.resolution)
            ));
        }
        match world.obstacles().len() {
            0 => {}
            1 => text.push_str(", 1 shape"),
            many => text.push_str(&format!(", {many} shapes")),
        }
        if let Some(name) = self.field.name() {
            text.push_str(&format!(", {name:?}"));
        }
        text.push(')');
        text
    }

    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let world = self.field.world();
        let state = PyDict::new(py);
        state.set_item("bounds", self.bounds())?;
        let shapes: Vec<Vec<f64>> = world
            .obstacles()
            .iter()
            .map(|obstacle| match obstacle {
                Obstacle::Disc { center, radius } => vec![center.x, center.y, *radius],
                Obstacle::Block { min, max } => vec![min.x, min.y, max.x, max.y, 0.0],
                Obstacle::Polygon { vertices } => {
                    vertices.iter().flat_map(|v| [v.x, v.y]).collect()
                }
            })
            .collect();
        state.set_item("shapes", shapes)?;
        if let Some(grid) = world.grid() {
            state.set_item("cells", self.to_array(py)?)?;
            state.set_item("resolution", grid.resolution)?;
            state.set_item("origin", self.origin())?;
        }
        state.set_item("name", self.name())?;
        state.set_item("start", self.start())?;
        state.set_item("goal", self.goal())?;
        state.set_item("warnings", self.warnings())?;
        let restore = py.get_type::<Self>().getattr("_restore")?;
        Ok((restore, (state,).into_pyobject(py)?))
    }

    /// What pickling calls.
    #[classmethod]
    fn _restore(_class: &Bound<'_, PyType>, state: &Bound<'_, PyDict>) -> PyResult<Self> {
        let py = state.py();
        let item = |key: &str| {
            state
                .get_item(key)?
                .ok_or_else(|| value(format!("a pickled World without {key}")))
        };
        let (x0, y0, x1, y1) = item("bounds")?.extract()?;
        let shapes: Vec<Vec<f64>> = item("shapes")?.extract()?;
        let mut obstacles = Vec::with_capacity(shapes.len());
        for shape in shapes {
            obstacles.push(match shape[..] {
                [x, y, radius] => Obstacle::Disc {
                    center: Point2::new(x, y),
                    radius,
                },
                [x0, y0, x1, y1, _] => Obstacle::Block {
                    min: Point2::new(x0, y0),
                    max: Point2::new(x1, y1),
                },
                ref flat if flat.len() % 2 == 0 => Obstacle::Polygon {
                    vertices: flat.chunks(2).map(|v| Point2::new(v[0], v[1])).collect(),
                },
                _ => return Err(value("a pickled World with a shape that is none")),
            });
        }
        let grid = match state.get_item("cells")? {
            Some(array) => {
                let (width, height, cells) = cells(&array)?;
                let resolution = number("resolution", &item("resolution")?)?;
                let origin = pose("origin", Some(&item("origin")?))?;
                let grid = OccupancyGrid::new(width, height, resolution, origin, cells);
                Some(grid.map_err(|error| errors::bad_world(py, &error.to_string()))?)
            }
            None => None,
        };
        let name = item("name")?.extract()?;
        let field = build(py, Bounds::new(x0, y0, x1, y1), obstacles, grid, name)?;
        Ok(Self {
            field: Field {
                start: map_pose(item("start")?.extract()?),
                goal: map_pose(item("goal")?.extract()?),
                ..field
            },
            warnings: item("warnings")?.extract()?,
        })
    }
}

/// Up to six digits.
pub fn tidy(number: f64) -> String {
    let text = format!("{number:.6}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}
