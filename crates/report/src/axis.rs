//! Axes with ticks at 1, 2 and 5, and the frames that turn metres and seconds into pixels.

use bikebot_geometry::{FergusonCurve, Point2};
use bikebot_world::Bounds;

use crate::drawing::{Anchor, Area, Drawing, Item, Label, Outline, Pixel, Style};
use crate::label;
use crate::palette;

/// Size of the numbers at the ticks, px.
const TICK_SIZE: f64 = 11.5;
/// Size of names of axes, px.
const NAME_SIZE: f64 = 12.5;

/// One axis: a range of values and where they come to lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Axis {
    /// Equal steps are equally long.
    Linear {
        /// Value at its beginning.
        min: f64,
        /// Value at its end.
        max: f64,
    },
    /// Each power of ten is equally long.
    Decades {
        /// Power of ten at its beginning.
        first: i32,
        /// Power of ten at its end.
        last: i32,
    },
}

impl Axis {
    /// From `min` to `max`; a range without extent gets one.
    #[must_use]
    pub fn linear(min: f64, max: f64) -> Self {
        let (min, max) = if min.is_finite() && max.is_finite() {
            (min.min(max), min.max(max))
        } else {
            (0.0, 1.0)
        };
        let least = 1e-9 * min.abs().max(max.abs()).max(1e-9);
        if max - min > least {
            Self::Linear { min, max }
        } else {
            let half = 0.5 * min.abs().max(1.0);
            Self::Linear {
                min: min - half,
                max: max + half,
            }
        }
    }

    /// Around all `values`, with a margin of `share` of their range on both sides.
    pub fn around(values: impl IntoIterator<Item = f64>, share: f64) -> Self {
        let (min, max) = values
            .into_iter()
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), value| {
                (min.min(value), max.max(value))
            });
        let margin = share * (max - min);
        Self::linear(min - margin, max + margin)
    }

    /// Whole powers of ten around all positive `values`.
    pub fn decades(values: impl IntoIterator<Item = f64>) -> Self {
        let logs = values
            .into_iter()
            .filter(|value| value.is_finite() && *value > 0.0)
            .map(f64::log10);
        let (min, max) = logs.fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), log| {
            (min.min(log), max.max(log))
        });
        if min > max {
            return Self::Decades { first: 0, last: 1 };
        }
        let first = min.floor() as i32;
        Self::Decades {
            first,
            last: (max.ceil() as i32).max(first + 1),
        }
    }

    /// Where `value` lies, 0 at the beginning and 1 at the end; what is not positive lies at the
    /// beginning of a logarithmic axis.
    #[must_use]
    pub fn share(&self, value: f64) -> f64 {
        match *self {
            Self::Linear { min, max } => (value - min) / (max - min),
            Self::Decades { first, last } => {
                let log = if value > 0.0 {
                    value.log10()
                } else {
                    f64::from(first)
                };
                ((log - f64::from(first)) / f64::from(last - first)).clamp(0.0, 1.0)
            }
        }
    }

    /// Values at the ticks, with what is written there: about `count` of them.
    #[must_use]
    pub fn ticks(&self, count: usize) -> Vec<(f64, String)> {
        match *self {
            Self::Linear { min, max } => {
                let step = tick_step((max - min) / count.max(1) as f64);
                let decimals = (-step.log10().floor()).clamp(0.0, 12.0) as usize;
                let slack = 1e-9 * (max - min);
                let first = ((min - slack) / step).ceil();
                (0..=2 * count)
                    .map(|i| (first + i as f64) * step)
                    .take_while(|value| *value <= max + slack)
                    .map(|value| {
                        // No tick at minus zero.
                        let value = if value.abs() < slack { 0.0 } else { value };
                        (value, format!("{value:.decimals$}").replace('-', "−"))
                    })
                    .collect()
            }
            Self::Decades { first, last } => {
                let every = ((last - first) as usize).div_ceil(count.max(1)).max(1);
                (first..=last)
                    .step_by(every)
                    .map(|power| (10_f64.powi(power), power.to_string()))
                    .collect()
            }
        }
    }
}

/// The smallest of 1, 2, 5 times a power of ten that is not below `least`.
fn tick_step(least: f64) -> f64 {
    if !(least.is_finite() && least > 0.0) {
        return 1.0;
    }
    let power = 10_f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|factor| factor * power)
        .find(|step| *step >= least * (1.0 - 1e-9))
        .unwrap_or(10.0 * power)
}

/// A span of time in words: `10 ms`.
#[must_use]
pub fn duration(seconds: f64) -> String {
    let (factor, unit) = match seconds {
        s if s >= 0.9995 => (1.0, "s"),
        s if s >= 0.999_5e-3 => (1e3, "ms"),
        s if s >= 0.999_5e-6 => (1e6, "µs"),
        _ => (1e9, "ns"),
    };
    format!("{} {unit}", significant(seconds * factor, 3))
}

/// `value` with `digits` significant digits, without idle zeros.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    if value == 0.0 || !value.is_finite() {
        return "0".into();
    }
    let magnitude = value.abs().log10().floor() as i32;
    if magnitude < -4 {
        return format!("{value:.*e}", digits.saturating_sub(1)).replace('-', "−");
    }
    let decimals = (digits as i32 - 1 - magnitude).max(0) as usize;
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    };
    text.replace('-', "−")
}

/// Two axes and the area between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chart {
    /// Where it lies on the sheet.
    pub area: Area,
    /// The axis to the right.
    pub x: Axis,
    /// The axis upwards.
    pub y: Axis,
}

impl Chart {
    /// Where the values come to lie.
    #[must_use]
    pub fn at(&self, x: f64, y: f64) -> Pixel {
        [
            self.area.left + self.x.share(x) * self.area.width,
            self.area.bottom() - self.y.share(y) * self.area.height,
        ]
    }

    /// Ground and rules, to lie below the data.
    pub fn ground(&self, drawing: &mut Drawing, x_ticks: usize, y_ticks: usize) {
        drawing.shape(Outline::rectangle(self.area), Style::fill(palette::PAPER));
        let mut rules = Outline::new();
        let Area { left, top, .. } = self.area;
        for (value, _) in self.x.ticks(x_ticks) {
            let x = left + self.x.share(value) * self.area.width;
            rules.add_line([[x, top], [x, self.area.bottom()]]);
        }
        for (value, _) in self.y.ticks(y_ticks) {
            let [_, y] = self.at(0.0, value);
            rules.add_line([[left, y], [self.area.right(), y]]);
        }
        drawing.shape(rules, Style::line(palette::RULE, 1.0));
    }

    /// Frame, ticks, numbers and the name of the x axis, to lie above the data.
    pub fn frame(&self, drawing: &mut Drawing, x_ticks: usize, y_ticks: usize, x_name: &str) {
        let Area { left, .. } = self.area;
        let bottom = self.area.bottom();
        let mut lines = Outline::rectangle(self.area);
        for (value, text) in self.x.ticks(x_ticks) {
            let x = left + self.x.share(value) * self.area.width;
            lines.add_line([[x, bottom], [x, bottom + 4.0]]);
            let text = match self.x {
                Axis::Linear { .. } => text,
                Axis::Decades { .. } => duration(value),
            };
            drawing.label(
                Label::new(text, [x, bottom + 17.0], TICK_SIZE, palette::GREY)
                    .anchored(Anchor::Middle),
            );
        }
        for (value, text) in self.y.ticks(y_ticks) {
            let [_, y] = self.at(0.0, value);
            lines.add_line([[left - 4.0, y], [left, y]]);
            drawing.label(
                Label::new(text, [left - 7.0, y + 4.0], TICK_SIZE, palette::GREY)
                    .anchored(Anchor::End),
            );
        }
        drawing.shape(lines, Style::line(palette::GREY, 1.0));
        drawing.label(
            Label::new(
                x_name,
                [left + self.area.width / 2.0, bottom + 35.0],
                NAME_SIZE,
                palette::INK,
            )
            .anchored(Anchor::Middle),
        );
    }

    /// The name of what goes up, above the upper left corner, and a remark above the right one as far as there is room.
    pub fn heading(&self, drawing: &mut Drawing, name: &str, remark: &str) {
        let y = self.area.top - 9.0;
        drawing.label(Label::new(
            name,
            [self.area.left, y],
            NAME_SIZE,
            palette::INK,
        ));
        let room = self.area.width - label::width(name, NAME_SIZE) - 12.0;
        if !remark.is_empty() && room > 0.0 {
            let text = label::fitted(remark, TICK_SIZE, room);
            drawing.label(
                Label::new(text, [self.area.right(), y], TICK_SIZE, palette::GREY)
                    .anchored(Anchor::End),
            );
        }
    }

    /// A line through values of growing `x`, thinned to what can be seen; a gap where a value is not finite.
    pub fn curve(&self, values: impl IntoIterator<Item = [f64; 2]>) -> Outline {
        let mut outline = Outline::new();
        let mut piece: Vec<Pixel> = Vec::new();
        for [x, y] in values {
            if x.is_finite() && y.is_finite() {
                piece.push(self.at(x, y));
            } else {
                outline.add_line(thinned(&piece));
                piece.clear();
            }
        }
        outline.add_line(thinned(&piece));
        outline
    }

    /// Puts data on the drawing; what leaves the frame is cut off.
    pub fn data(&self, drawing: &mut Drawing, items: Vec<Item>) {
        if !items.is_empty() {
            drawing.items.push(Item::Window(self.area, items));
        }
    }
}

/// Of all points in one quarter of a pixel's column the first, lowest, highest and last.
fn thinned(points: &[Pixel]) -> Vec<Pixel> {
    let column = |point: &Pixel| (4.0 * point[0]).floor();
    let mut kept = Vec::new();
    for group in points.chunk_by(|a, b| column(a) == column(b)) {
        let extreme = |sign: f64| {
            (0..group.len()).max_by(|&a, &b| (sign * group[a][1]).total_cmp(&(sign * group[b][1])))
        };
        let mut indices: Vec<usize> = [
            Some(0),
            extreme(1.0),
            extreme(-1.0),
            group.len().checked_sub(1),
        ]
        .into_iter()
        .flatten()
        .collect();
        indices.sort_unstable();
        indices.dedup();
        kept.extend(indices.into_iter().map(|index| group[index]));
    }
    kept
}

/// A map on the sheet: a metre is equally long in both directions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapFrame {
    /// Where the field lies.
    pub area: Area,
    bounds: Bounds,
    /// px/m.
    scale: f64,
}

impl MapFrame {
    /// As large as fits into `room`, in its upper left corner.
    #[must_use]
    pub fn fitting(bounds: Bounds, room: Area) -> Self {
        let scale = (room.width / bounds.width()).min(room.height / bounds.height());
        Self {
            area: Area::new(
                room.left,
                room.top,
                scale * bounds.width(),
                scale * bounds.height(),
            ),
            bounds,
            scale,
        }
    }

    /// Where a point of the world comes to lie.
    #[must_use]
    pub fn at(&self, point: Point2) -> Pixel {
        [
            self.area.left + self.scale * (point.x - self.bounds.min.x),
            self.area.top + self.scale * (self.bounds.max.y - point.y),
        ]
    }

    /// How long `metres` are, px.
    #[must_use]
    pub fn length(&self, metres: f64) -> f64 {
        self.scale * metres
    }

    /// What is shown of the world, m.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The field's axes.
    #[must_use]
    pub fn chart(&self) -> Chart {
        let Bounds { min, max } = self.bounds;
        Chart {
            area: self.area,
            x: Axis::linear(min.x, max.x),
            y: Axis::linear(min.y, max.y),
        }
    }

    /// Adds `curve` to `outline` as the cubic Bézier curve it is; a piece that begins where the last one ended
    /// (`joined`) continues it.
    ///
    /// The handles of a Ferguson-Coons curve are `x0 + v0/3` and `x1 − v1/3`.
    pub fn add_curve(&self, outline: &mut Outline, curve: &FergusonCurve, joined: bool) {
        if !joined {
            outline.move_to(self.at(curve.start_point()));
        }
        outline.cubic_to(
            self.at(curve.start_point() + curve.start_tangent() / 3.0),
            self.at(curve.end_point() - curve.end_tangent() / 3.0),
            self.at(curve.end_point()),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::Step;
    use bikebot_geometry::{ParametricCurve, Vector2};
    use proptest::prelude::*;

    #[test]
    fn ticks_stand_at_ones_twos_and_fives() {
        let texts = |axis: Axis, count| {
            let ticks = axis.ticks(count);
            ticks.into_iter().map(|tick| tick.1).collect::<Vec<_>>()
        };
        assert_eq!(
            texts(Axis::linear(0.0, 10.0), 5),
            ["0", "2", "4", "6", "8", "10"]
        );
        assert_eq!(
            texts(Axis::linear(-0.12, 0.12), 5),
            ["−0.10", "−0.05", "0.00", "0.05", "0.10"]
        );
        assert_eq!(texts(Axis::linear(3.0, 1003.0), 4), ["500", "1000"]);
        assert_eq!(
            texts(Axis::decades([2e-3, 0.5]), 4),
            ["-3", "-2", "-1", "0"]
        );
    }

    #[test]
    fn a_range_without_extent_gets_one() {
        for axis in [
            Axis::linear(2.0, 2.0),
            Axis::linear(f64::NAN, 1.0),
            Axis::around([], 0.1),
            Axis::around([f64::NAN, 5.0], 0.1),
            Axis::decades([]),
            Axis::decades([0.0, -1.0]),
            Axis::decades([1.0]),
        ] {
            assert!(axis.share(5.0).is_finite(), "{axis:?}");
            assert!(!axis.ticks(5).is_empty(), "{axis:?}");
        }
    }

    #[test]
    fn numbers_for_people_have_no_idle_digits() {
        assert_eq!(significant(180.957, 4), "181");
        assert_eq!(significant(0.0140, 3), "0.014");
        assert_eq!(significant(5.963e-6, 2), "6.0e−6");
        assert_eq!(significant(-2.5, 3), "−2.5");
        assert_eq!(significant(1500.0, 2), "1500");
        assert_eq!(duration(0.154), "154 ms");
        assert_eq!(duration(1e-4), "100 µs");
        assert_eq!(duration(10.0), "10 s");
    }

    #[test]
    fn a_map_keeps_its_proportions() {
        let bounds = Bounds::new(-10.0, 0.0, 10.0, 5.0);
        let frame = MapFrame::fitting(bounds, Area::new(50.0, 20.0, 400.0, 400.0));
        assert_eq!(frame.area, Area::new(50.0, 20.0, 400.0, 100.0));
        assert_eq!(frame.at(Point2::new(-10.0, 0.0)), [50.0, 120.0]);
        assert_eq!(frame.at(Point2::new(10.0, 5.0)), [450.0, 20.0]);
        assert_eq!(frame.length(1.0), 20.0);
        let [x, y] = frame.chart().at(0.0, 1.0);
        assert_eq!([x, y], frame.at(Point2::new(0.0, 1.0)));
    }

    proptest! {
        #[test]
        fn a_ferguson_curve_is_drawn_exactly(
            n in prop::array::uniform8(-20.0..20.0_f64), t in 0.0..1.0_f64,
        ) {
            let curve = FergusonCurve::from_ends(
                Point2::new(n[0], n[1]), Vector2::new(n[2], n[3]), Point2::new(n[4], n[5]), Vector2::new(n[6], n[7]),
            );
            let frame = MapFrame::fitting(Bounds::new(-20.0, -20.0, 20.0, 20.0), Area::new(0.0, 0.0, 800.0, 800.0));
            let mut outline = Outline::new();
            frame.add_curve(&mut outline, &curve, false);
            let [Step::Move(p0), Step::Cubic(p1, p2, p3)] = *outline.steps() else { panic!("{outline:?}") };
            let u = 1.0 - t;
            let weights = [u * u * u, 3.0 * u * u * t, 3.0 * u * t * t, t * t * t];
            let wanted = frame.at(curve.point(t));
            for axis in 0..2 {
                let drawn: f64 = weights.iter().zip([p0, p1, p2, p3]).map(|(w, p)| w * p[axis]).sum();
                // Rounding of numbers up to 1e3.
                prop_assert!((drawn - wanted[axis]).abs() < 1e-9, "{drawn} {}", wanted[axis]);
            }
        }

        #[test]
        fn thinning_keeps_the_extremes(ys in prop::collection::vec(-5.0..5.0_f64, 1..300)) {
            let points: Vec<Pixel> = ys.iter().enumerate().map(|(i, y)| [i as f64 * 0.01, *y]).collect();
            let kept = thinned(&points);
            let max = |points: &[Pixel]| points.iter().map(|p| p[1]).fold(f64::MIN, f64::max);
            let min = |points: &[Pixel]| points.iter().map(|p| p[1]).fold(f64::MAX, f64::min);
            prop_assert_eq!(max(&kept), max(&points));
            prop_assert_eq!(min(&kept), min(&points));
            prop_assert_eq!(kept[0], points[0]);
            prop_assert_eq!(kept[kept.len() - 1], points[points.len() - 1]);
            prop_assert!(kept.len() <= 4 * (1 + ys.len() / 25));
        }
    }
}
