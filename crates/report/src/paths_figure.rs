//! The figure of several paths on one field: what different methods make of the same question.

use bikebot_geometry::Point2;

use crate::axis::MapFrame;
use crate::drawing::{Area, Drawing, Item, Outline, Style};
use crate::legend::{Legend, Swatch};
use crate::palette;
use crate::scenery::{self, Ground};
use crate::sheet::{headed, put_map};

/// Each path has a colour and a dash of its own: either tells them apart. In the order of [`PathsFigure::new`]; more paths begin anew.
const STYLES: [Style; 6] = [
    Style::line(palette::ORANGE, 2.6).dashed(&[9.0, 4.0, 2.0, 4.0]),
    Style::line(palette::PURPLE, 2.2).dashed(&[1.0, 5.0]),
    Style::line(palette::GREEN, 2.2).dashed(&[8.0, 5.0]),
    Style::line(palette::SKY, 2.8).dashed(&[16.0, 6.0]),
    Style::line(palette::VERMILION, 3.2),
    Style::line(palette::BLUE, 1.8),
];

/// A path with its name.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedPath {
    /// What the legend calls it.
    pub name: String,
    /// Points along it, m.
    pub points: Vec<[f64; 2]>,
}

/// Paths between two ends.
#[derive(Debug)]
pub struct PathsFigure<'a> {
    paths: &'a [NamedPath],
    ground: Ground<'a>,
    ends: [(Point2, Option<f64>); 2],
    title: String,
    facts: String,
}

impl<'a> PathsFigure<'a> {
    /// Of `paths` on `ground`, from the first of `ends` (m, and rad where a heading is asked for) to the second, under a title and a line of facts.
    pub fn new(
        paths: &'a [NamedPath],
        ground: Ground<'a>,
        ends: [(Point2, Option<f64>); 2],
        title: impl Into<String>,
        facts: impl Into<String>,
    ) -> Self {
        Self {
            paths,
            ground,
            ends,
            title: title.into(),
            facts: facts.into(),
        }
    }

    /// Draws it.
    #[must_use]
    pub fn draw(&self) -> Drawing {
        let frame = MapFrame::fitting(self.ground.bounds, Area::new(62.0, 96.0, 738.0, 738.0));
        let mut legend = Legend::default();
        let mut items = self.ground.items(&frame);
        if !items.is_empty() {
            legend.row(Swatch::Patch(Style::fill(palette::OBSTACLE)), "obstacles");
        }
        for (path, style) in self.paths.iter().zip(STYLES.iter().cycle()) {
            let points = path.points.iter();
            let line = Outline::through(points.map(|&[x, y]| frame.at(Point2::new(x, y))));
            // A pale rim keeps crossing lines apart.
            let rim = Style::line(palette::PAPER, style.width + 2.0).faint(0.6);
            items.push(Item::Shape(line.clone(), rim));
            items.push(Item::Shape(line, *style));
            legend.row(Swatch::Line(*style), path.name.as_str());
        }
        for (index, (place, heading)) in self.ends.into_iter().enumerate() {
            items.extend(scenery::pose_mark(
                place,
                heading,
                index == 1,
                palette::INK,
                &frame,
            ));
        }
        legend.row(Swatch::Dot(Style::fill(palette::INK)), "start");
        legend.row(
            Swatch::Dot(Style::fill(palette::PAPER).edged(palette::INK, 2.6)),
            "goal",
        );
        let left = frame.area.right() + 40.0;
        let width = 336.0;
        let bottom = (frame.area.bottom() + 52.0).max(96.0 + legend.height(1) + 20.0);
        let mut drawing = headed(
            [left + width + 24.0, bottom],
            62.0,
            &self.title,
            &self.facts,
            format!("{}: {}", self.title, self.facts),
        );
        put_map(&mut drawing, &frame, items);
        let room = Area::new(left, 96.0, width, legend.height(1));
        legend.draw(&mut drawing, room, 1);
        drawing
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::golden::assert_is_as_kept;
    use crate::svg;
    use bikebot_world::{Bounds, Obstacle};

    fn drawn(count: usize) -> Drawing {
        let block = Obstacle::Block {
            min: Point2::new(4.0, 0.0),
            max: Point2::new(5.0, 6.0),
        };
        let paths: Vec<NamedPath> = (0..count)
            .map(|index| NamedPath {
                name: format!("way {index}, {}.5 m", 12 + index),
                points: vec![[1.0, 1.0], [4.5, 6.4 + 0.4 * index as f64], [9.0, 1.0]],
            })
            .collect();
        let ground = Ground {
            bounds: Bounds::new(0.0, 0.0, 10.0, 10.0),
            obstacles: &[block],
            grid: None,
        };
        let ends = [
            (Point2::new(1.0, 1.0), Some(0.0)),
            (Point2::new(9.0, 1.0), None),
        ];
        PathsFigure::new(&paths, ground, ends, "ways around a block", "made by hand").draw()
    }

    #[test]
    fn paths_are_drawn_as_they_always_were() {
        assert_is_as_kept(&svg::write(&drawn(3)), "paths.svg");
    }

    #[test]
    fn everything_lies_on_the_sheet_however_many_paths_there_are() {
        for count in [0, 1, 6, 40] {
            let drawing = drawn(count);
            let area = drawing.extent().unwrap();
            assert!(area.left >= 0.0 && area.top >= 0.0, "{area:?}");
            assert!(
                area.right() <= drawing.width && area.bottom() <= drawing.height,
                "{count}: {area:?} on {} x {}",
                drawing.width,
                drawing.height
            );
        }
    }

    #[test]
    fn no_two_paths_look_alike() {
        for (index, style) in STYLES.iter().enumerate() {
            for other in &STYLES[index + 1..] {
                assert!(style.stroke != other.stroke);
                assert!(style.dash != other.dash || style.width != other.width);
            }
        }
    }
}
