//! What a map picture shows besides curves: ground, obstacles, poses, the outline of the robot.

use bikebot_geometry::{Point2, Pose2};
use bikebot_world::{Bounds, Cell, Footprint, Obstacle, OccupancyGrid, World};
use std::f64::consts::{FRAC_PI_2, PI};

use crate::axis::MapFrame;
use crate::drawing::{Item, Outline, Style};
use crate::grid_outline;
use crate::palette::{self, Colour};

/// The ground a picture is drawn on.
#[derive(Debug, Clone, Copy)]
pub struct Ground<'a> {
    /// The field, m.
    pub bounds: Bounds,
    /// Obstacles that are not cells.
    pub obstacles: &'a [Obstacle],
    /// Cells.
    pub grid: Option<&'a OccupancyGrid>,
}

impl<'a> From<&'a World> for Ground<'a> {
    fn from(world: &'a World) -> Self {
        Self {
            bounds: world.bounds(),
            obstacles: world.obstacles(),
            grid: world.grid(),
        }
    }
}

impl Ground<'_> {
    /// The rims of obstacles and occupied cells, to lie above what was believed of them.
    pub(crate) fn rims(&self, frame: &MapFrame, style: Style) -> Vec<Item> {
        let cells = self.grid.map(|grid| cells_of(grid, Cell::Occupied, frame));
        let obstacles = self.obstacles.iter().map(|it| outline_of(it, frame));
        cells
            .into_iter()
            .chain(obstacles)
            .map(|outline| Item::Shape(outline, style))
            .collect()
    }

    /// Obstacles and unknown cells. Each kind is one area, however many pieces it has.
    pub(crate) fn items(&self, frame: &MapFrame) -> Vec<Item> {
        let mut items = Vec::new();
        if let Some(grid) = self.grid {
            for (wanted, colour) in [
                (Cell::Unknown, palette::UNKNOWN),
                (Cell::Occupied, palette::OBSTACLE),
            ] {
                let outline = cells_of(grid, wanted, frame);
                if !outline.is_empty() {
                    items.push(Item::Shape(outline, Style::fill(colour)));
                }
            }
        }
        // One by one: where two overlap, even-odd filling of both at once would open a hole.
        items.extend(self.obstacles.iter().map(|obstacle| {
            Item::Shape(outline_of(obstacle, frame), Style::fill(palette::OBSTACLE))
        }));
        items
    }
}

/// The cells of one kind as one area.
fn cells_of(grid: &OccupancyGrid, wanted: Cell, frame: &MapFrame) -> Outline {
    let mut outline = Outline::new();
    for rim in grid_outline::rims(grid, |cell| cell == wanted) {
        outline.append(Outline::polygon(rim.into_iter().map(|[x, y]| {
            frame.at(grid.from_cell_coordinates(bikebot_geometry::Vector2::new(x, y)))
        })));
    }
    outline
}

/// The rim of an obstacle on the sheet.
pub(crate) fn outline_of(obstacle: &Obstacle, frame: &MapFrame) -> Outline {
    match obstacle {
        Obstacle::Disc { center, radius } => {
            Outline::circle(frame.at(*center), frame.length(*radius))
        }
        Obstacle::Polygon { vertices } => {
            Outline::polygon(vertices.iter().map(|vertex| frame.at(*vertex)))
        }
        Obstacle::Block { min, max } => Outline::polygon(
            [
                (min.x, min.y),
                (max.x, min.y),
                (max.x, max.y),
                (min.x, max.y),
            ]
            .map(|(x, y)| frame.at(Point2::new(x, y))),
        ),
    }
}

/// The rim of a footprint in the body frame, m; empty for a point.
#[must_use]
pub fn footprint_outline(footprint: &Footprint) -> Outline {
    let mut outline = Outline::new();
    match footprint {
        Footprint::Point => {}
        Footprint::Disc { radius } => outline = Outline::circle([0.0, 0.0], *radius),
        Footprint::Capsule {
            rear,
            front,
            radius,
        } => {
            let (rear, front, radius) = (*rear, *front, *radius);
            outline.move_to([front, -radius]);
            outline.quarter_turn([front, 0.0], radius, -FRAC_PI_2);
            outline.quarter_turn([front, 0.0], radius, 0.0);
            outline.line_to([rear, radius]);
            outline.quarter_turn([rear, 0.0], radius, FRAC_PI_2);
            outline.quarter_turn([rear, 0.0], radius, PI);
            outline.close();
        }
        Footprint::Rectangle {
            rear,
            front,
            half_width,
        } => {
            let (rear, front, half_width) = (*rear, *front, *half_width);
            outline = Outline::polygon([
                [rear, -half_width],
                [front, -half_width],
                [front, half_width],
                [rear, half_width],
            ]);
        }
        Footprint::Polygon(polygon) => {
            outline = Outline::polygon(rounded(polygon.vertices(), polygon.rounding()));
        }
        // Shapes that `world` learns later are drawn as the discs that cover them.
        _ => {
            for disc in footprint.discs() {
                outline.append(Outline::circle([disc.offset, disc.lateral], disc.radius));
            }
        }
    }
    outline
}

/// The rim of all points within `by` (m) of a polygon given counter-clockwise: a pair of points for each side,
/// and an arc of short legs about each corner that points outwards.
pub(crate) fn rounded(vertices: &[Point2], by: f64) -> Vec<[f64; 2]> {
    const LEGS: usize = 6;
    if by <= 0.0 {
        return vertices.iter().map(|vertex| [vertex.x, vertex.y]).collect();
    }
    let count = vertices.len();
    let mut rim = Vec::new();
    for i in 0..count {
        let (before, here, after) = (
            vertices[(i + count - 1) % count],
            vertices[i],
            vertices[(i + 1) % count],
        );
        let (into, out) = (here - before, after - here);
        // Outwards is to the right of each side.
        let from = into.y.atan2(into.x) - FRAC_PI_2;
        let turn = into.perp(&out).atan2(into.dot(&out));
        let legs = if turn > 0.0 { LEGS } else { 1 };
        for leg in 0..=legs {
            let (sin, cos) = (from + turn * leg as f64 / legs as f64).sin_cos();
            rim.push([here.x + by * cos, here.y + by * sin]);
        }
    }
    rim
}

/// Length of a footprint from its rearmost to its foremost point, m.
pub(crate) fn footprint_length(outline: &Outline) -> f64 {
    outline.extent().map_or(0.0, |area| area.width)
}

/// An outline of the body frame (m) carried to `pose`.
pub(crate) fn carried(outline: &Outline, pose: Pose2, frame: &MapFrame) -> Outline {
    let (sin, cos) = pose.heading.sin_cos();
    outline.mapped(|[x, y]| {
        frame.at(Point2::new(
            pose.position.x + cos * x - sin * y,
            pose.position.y + sin * x + cos * y,
        ))
    })
}

/// Length of the arrow of a pose, px.
const ARROW: f64 = 26.0;

/// An arrow along `heading`, and a mark at its foot: full for a start, a ring for a goal.
pub(crate) fn pose_mark(
    at: Point2,
    heading: Option<f64>,
    is_goal: bool,
    colour: Colour,
    frame: &MapFrame,
) -> Vec<Item> {
    let foot = frame.at(at);
    let mut items = Vec::new();
    if let Some(heading) = heading {
        let (sin, cos) = heading.sin_cos();
        // The sheet's y points down.
        let to = |along: f64, left: f64| {
            [
                foot[0] + along * cos - left * sin,
                foot[1] - along * sin - left * cos,
            ]
        };
        let head = Outline::polygon([
            to(ARROW, 0.0),
            to(ARROW - 10.0, 5.0),
            to(ARROW - 7.5, 0.0),
            to(ARROW - 10.0, -5.0),
        ]);
        let shaft = Outline::through([foot, to(ARROW - 8.0, 0.0)]);
        // A pale rim keeps it apart from whatever lies below.
        for outline in [&shaft, &head] {
            items.push(Item::Shape(
                outline.clone(),
                Style::line(palette::PAPER, 5.5).faint(0.85),
            ));
        }
        items.push(Item::Shape(shaft, Style::line(colour, 2.2)));
        items.push(Item::Shape(head, Style::fill(colour).edged(colour, 1.0)));
    }
    let style = if is_goal {
        Style::fill(palette::PAPER).edged(colour, 2.6)
    } else {
        Style::fill(colour).edged(palette::PAPER, 1.2)
    };
    items.push(Item::Shape(Outline::circle(foot, 5.2), style));
    items
}

/// The smallest of 1, 2, 5, 10, … m that is not below `least`: how far apart outlines are drawn.
pub(crate) fn stride(least: f64) -> f64 {
    let power = 10_f64.powf(least.max(1e-6).log10().floor());
    [1.0, 2.0, 5.0]
        .into_iter()
        .map(|factor| factor * power)
        .find(|step| *step >= least)
        .unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::Area;

    #[test]
    fn a_capsule_is_as_long_and_wide_as_it_is() {
        let outline = footprint_outline(&Footprint::bike());
        let area = outline.extent().unwrap();
        // Axis from −0.04 to 1.16 m, radius 0.30 m; handles of the quarter turns lie on the rim's tangents.
        for (found, wanted) in [
            (area.left, -0.34),
            (area.right(), 1.46),
            (area.top, -0.30),
            (area.bottom(), 0.30),
        ] {
            assert!((found - wanted).abs() < 1e-12, "{found} {wanted}");
        }
    }

    #[test]
    fn a_turned_footprint_points_where_the_heading_says() {
        let frame = MapFrame::fitting(
            Bounds::new(0.0, 0.0, 10.0, 10.0),
            Area::new(0.0, 0.0, 100.0, 100.0),
        );
        let square = footprint_outline(&Footprint::Rectangle {
            rear: 0.0,
            front: 2.0,
            half_width: 0.5,
        });
        let area = carried(&square, Pose2::new(5.0, 5.0, FRAC_PI_2), &frame)
            .extent()
            .unwrap();
        // Heading north: from y = 5 to 7 m, which is from 50 up to 30 px.
        assert!((area.top - 30.0).abs() < 1e-9 && (area.bottom() - 50.0).abs() < 1e-9);
        assert!((area.left - 45.0).abs() < 1e-9 && (area.right() - 55.0).abs() < 1e-9);
    }

    #[test]
    fn strides_are_round() {
        for (least, wanted) in [
            (0.7, 1.0),
            (1.0, 1.0),
            (1.1, 2.0),
            (4.0, 5.0),
            (7.0, 10.0),
            (0.03, 0.05),
        ] {
            assert!((stride(least) - wanted).abs() < 1e-12, "{least}");
        }
    }
}
