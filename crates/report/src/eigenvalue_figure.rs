//! The figure of a bicycle's eigenvalues: growth and frequency of its modes over speed.

use bikebot_dynamics::whipple::{CriticalSpeeds, Mode, Modes};

use crate::axis::{Axis, Chart, significant};
use crate::drawing::{Anchor, Area, Drawing, Item, Label, Outline, Style};
use crate::label;
use crate::legend::{Legend, Swatch};
use crate::palette;
use crate::sheet::headed;

/// The charts, px: the upper one shows real, the lower one imaginary parts.
const LEFT: f64 = 78.0;
const WIDTH: f64 = 1098.0;
const GROWTH: Area = Area::new(LEFT, 122.0, WIDTH, 330.0);
const FREQUENCY: Area = Area::new(LEFT, 528.0, WIDTH, 190.0);
const LEGEND_TOP: f64 = 780.0;
/// Ticks along the axes.
const SPEED_TICKS: usize = 11;
const GROWTH_TICKS: usize = 8;
const FREQUENCY_TICKS: usize = 5;

/// Each mode has a colour and a dash of its own: either tells them apart.
const WEAVE: Style = Style::line(palette::BLUE, 2.6);
const CAPSIZE: Style = Style::line(palette::VERMILION, 2.6).dashed(&[11.0, 5.0]);
const CASTER: Style = Style::line(palette::PURPLE, 3.2).dashed(&[2.0, 6.0]);
/// In the order they are drawn: the slow ones lie on top.
const MODES: [(Mode, Style); 3] = [
    (Mode::Caster, CASTER),
    (Mode::Capsize, CAPSIZE),
    (Mode::Weave, WEAVE),
];
const STABLE: Style = Style::fill(palette::GREEN).faint(0.16);
const CRITICAL: Style = Style::line(palette::INK, 1.0).dashed(&[4.0, 4.0]);

/// A bicycle's modes over speed.
#[derive(Debug)]
pub struct EigenvalueFigure<'a> {
    curves: &'a [Modes],
    critical: &'a CriticalSpeeds,
    title: String,
    facts: String,
}

impl<'a> EigenvalueFigure<'a> {
    /// Of `curves`, in the order of growing speed, under a title and a line of facts.
    pub fn new(
        curves: &'a [Modes],
        critical: &'a CriticalSpeeds,
        title: impl Into<String>,
        facts: impl Into<String>,
    ) -> Self {
        Self {
            curves,
            critical,
            title: title.into(),
            facts: facts.into(),
        }
    }

    /// Draws it.
    #[must_use]
    pub fn draw(&self) -> Drawing {
        let legend = legend();
        let height = LEGEND_TOP + legend.height(4) + 18.0;
        let mut drawing = headed(
            [LEFT + WIDTH + 24.0, height],
            LEFT,
            &self.title,
            &self.facts,
            format!("{}: {}", self.title, self.facts),
        );
        let speeds = self.curves.iter().map(|modes| modes.speed);
        let x = Axis::around(speeds, 0.0);
        self.growth(&mut drawing, x);
        self.frequency(&mut drawing, x);
        legend.draw(
            &mut drawing,
            Area::new(LEFT, LEGEND_TOP, WIDTH, legend.height(4)),
            4,
        );
        drawing
    }

    /// Real parts: below zero a disturbance dies away.
    fn growth(&self, drawing: &mut Drawing, x: Axis) {
        // The caster decays ever faster with speed; the axis is made for the other two, whose sign changes.
        let slow = self
            .curves
            .iter()
            .flat_map(|modes| [modes.weave[0].re, modes.weave[1].re, modes.capsize.re]);
        let most = slow.fold(1e-3_f64, |most, re| most.max(re.abs()));
        let chart = Chart {
            area: GROWTH,
            x,
            y: Axis::linear(-1.6 * most, 1.15 * most),
        };
        chart.ground(drawing, SPEED_TICKS, GROWTH_TICKS);
        let mut items = self.background(&chart);
        for (mode, style) in MODES {
            for branch in 0..if mode == Mode::Weave { 2 } else { 1 } {
                let values = self.curves.iter().map(|modes| {
                    let mut of_mode = modes.iter().filter(|(name, _)| *name == mode);
                    [
                        modes.speed,
                        of_mode.nth(branch).map_or(f64::NAN, |(_, value)| value.re),
                    ]
                });
                items.push(Item::Shape(chart.curve(values), style));
            }
        }
        chart.data(drawing, items);
        self.mark_critical(drawing, &chart);
        chart.frame(drawing, SPEED_TICKS, GROWTH_TICKS, "speed, m/s");
        let remark = match self.curves.last() {
            Some(last) if last.caster.re < -1.6 * most => format!(
                "off the chart: caster, {} 1/s at {} m/s",
                significant(last.caster.re, 3),
                significant(last.speed, 3)
            ),
            _ => String::new(),
        };
        chart.heading(
            drawing,
            "growth (above 0) or decay (below): real part, 1/s",
            &remark,
        );
    }

    /// Imaginary parts of what oscillates.
    fn frequency(&self, drawing: &mut Drawing, x: Axis) {
        let most = self
            .curves
            .iter()
            .flat_map(|modes| modes.iter().map(|(_, value)| value.im))
            .fold(1.0_f64, f64::max);
        let chart = Chart {
            area: FREQUENCY,
            x,
            y: Axis::linear(0.0, 1.1 * most),
        };
        chart.ground(drawing, SPEED_TICKS, FREQUENCY_TICKS);
        let mut items = self.background(&chart);
        for (mode, style) in MODES {
            let values = self.curves.iter().map(|modes| {
                let of_mode = modes.iter().filter(|(name, _)| *name == mode);
                let frequency = of_mode.map(|(_, value)| value.im.abs()).fold(0.0, f64::max);
                let shown = if frequency > 0.0 { frequency } else { f64::NAN };
                [modes.speed, shown]
            });
            let curve = chart.curve(values);
            if !curve.is_empty() {
                items.push(Item::Shape(curve, style));
            }
        }
        chart.data(drawing, items);
        chart.frame(drawing, SPEED_TICKS, FREQUENCY_TICKS, "speed, m/s");
        let remark = "2π rad/s are one swing a second";
        chart.heading(drawing, "frequency: imaginary part, rad/s", remark);
    }

    /// Stable speeds, critical speeds, and zero, to lie below the curves.
    fn background(&self, chart: &Chart) -> Vec<Item> {
        let Area { top, height, .. } = chart.area;
        let across = |speed: f64| chart.at(speed, 0.0)[0];
        let (left, right) = (chart.area.left, chart.area.right());
        let mut items = Vec::new();
        for range in &self.critical.stable {
            let from = across(range.from_mps).clamp(left, right);
            let to = range.to_mps.map_or(right, across).clamp(left, right);
            if to > from {
                let band = Area::new(from, top, to - from, height);
                items.push(Item::Shape(Outline::rectangle(band), STABLE));
            }
        }
        for (_, speed) in self.named_speeds() {
            let x = across(speed);
            items.push(Item::Shape(
                Outline::through([[x, top], [x, chart.area.bottom()]]),
                CRITICAL,
            ));
        }
        let [_, zero] = chart.at(0.0, 0.0);
        items.push(Item::Shape(
            Outline::through([[left, zero], [right, zero]]),
            Style::line(palette::INK, 1.2),
        ));
        items
    }

    /// Weave and capsize speed as far as they lie on the chart.
    fn named_speeds(&self) -> Vec<(&'static str, f64)> {
        let (Some(first), Some(last)) = (self.curves.first(), self.curves.last()) else {
            return Vec::new();
        };
        [
            ("weave", self.critical.weave),
            ("capsize", self.critical.capsize),
        ]
        .into_iter()
        .filter_map(|(name, speed)| Some((name, speed?)))
        .filter(|(_, speed)| (first.speed..=last.speed).contains(speed))
        .collect()
    }

    /// What the vertical lines are, beside them, on the side away from each other.
    fn mark_critical(&self, drawing: &mut Drawing, chart: &Chart) {
        const SIZE: f64 = 12.0;
        let named = self.named_speeds();
        let lowest = named
            .iter()
            .map(|(_, speed)| *speed)
            .fold(f64::INFINITY, f64::min);
        for (name, speed) in named {
            let text = format!("{name} speed {speed:.4} m/s");
            let [x, _] = chart.at(speed, 0.0);
            let width = label::width(&text, SIZE) + 8.0;
            // To the left of the lower speed, to the right of the higher one, wherever there is room.
            let is_left =
                (speed <= lowest && x - width > chart.area.left) || x + width > chart.area.right();
            let (at, anchor) = if is_left {
                (x - 7.0, Anchor::End)
            } else {
                (x + 7.0, Anchor::Start)
            };
            let place = [at, chart.area.top + 17.0];
            drawing.label(Label::new(text, place, SIZE, palette::INK).anchored(anchor));
        }
    }
}

fn legend() -> Legend {
    let mut legend = Legend::default();
    legend.row(Swatch::Line(WEAVE), "weave: steers and leans to and fro");
    legend.row(Swatch::Line(CAPSIZE), "capsize: a slow lean");
    legend.row(Swatch::Line(CASTER), "caster: the fork falls in line");
    legend.row(Swatch::Patch(STABLE), "stable hands off");
    legend
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::golden::assert_is_as_kept;
    use crate::svg;
    use bikebot_dynamics::{Whipple, WhippleParams};

    fn drawn(to: f64, count: usize) -> Drawing {
        let bicycle = Whipple::new(&WhippleParams::benchmark()).unwrap();
        let curves = bicycle.mode_curves(0.0, to, count).unwrap();
        let critical = bicycle.critical_speeds();
        EigenvalueFigure::new(&curves, &critical, "benchmark", "stable in between").draw()
    }

    #[test]
    fn the_benchmark_is_drawn_as_it_always_was() {
        let now = svg::write(&drawn(10.0, 41));
        assert_eq!(now, svg::write(&drawn(10.0, 41)), "the same bytes again");
        assert_is_as_kept(&now, "eigenvalues.svg");
    }

    #[test]
    fn everything_lies_on_the_sheet_whatever_the_speeds() {
        // A range that ends between the critical speeds, one far beyond them, one before both.
        for to in [0.5, 5.0, 40.0] {
            let drawing = drawn(to, 50);
            let area = drawing.extent().unwrap();
            assert!(area.left >= 0.0 && area.top >= 0.0, "{area:?}");
            assert!(
                area.right() <= drawing.width && area.bottom() <= drawing.height,
                "{area:?}"
            );
        }
    }

    #[test]
    fn critical_speeds_are_named_only_where_they_lie_on_the_chart() {
        let text = |to| svg::write(&drawn(to, 20));
        assert!(text(10.0).contains("weave speed 4.2924 m/s"));
        assert!(text(10.0).contains("capsize speed 6.0243 m/s"));
        assert!(!text(5.0).contains("capsize speed"));
        assert!(!text(4.0).contains("weave speed"));
    }
}
