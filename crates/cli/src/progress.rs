//! How far the work has come, on standard error and only where somebody watches: while planning the stage and the best
//! length, while riding the simulated time, while working through rows how many are done and how long the rest takes.
//!
//! The work leaves numbers for the display, which draws them at most twenty times a second, and five times a second from
//! a thread of its own where none come.

use std::time::Duration;

use bikebot_planner::Stage;
use indicatif::{ProgressBar, ProgressStyle};

use crate::render::significant;

/// How often the display is drawn anew.
const TICK: Duration = Duration::from_millis(200);
/// Steps of a ride's bar.
const STEPS: f64 = 1000.0;
const ROWS: &str = "{msg:10} [{bar:18}] {pos}/{len}, {elapsed_precise} gone, {eta_precise} to go";
const SEARCH: &str = "{spinner} {msg}, {elapsed_precise}";
const RIDE: &str = "riding     [{bar:24}] {msg}";

/// Work in rows: plans, runs, claims. Hidden it costs a counter.
#[derive(Debug)]
pub struct Rows(ProgressBar);

impl Rows {
    /// Over `count` rows; `what` says what is done with them.
    pub fn begin(is_watched: bool, count: u64, what: &'static str) -> Self {
        let bar = begin(is_watched, ProgressBar::new(count).with_message(what), ROWS);
        Self(bar)
    }

    /// One more is done.
    pub fn done(&self) {
        self.0.inc(1);
    }

    /// One more is done, and this comes next.
    pub fn done_before(&self, what: &'static str) {
        self.0.set_message(what);
        self.0.inc(1);
    }

    /// Does `print` where the display does not stand in its way.
    pub fn aside<T>(&self, print: impl FnOnce() -> T) -> T {
        self.0.suspend(print)
    }
}

/// Takes the display away.
impl Drop for Rows {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// One search for a path, and the ride on it.
#[derive(Debug)]
pub struct Ride {
    bar: ProgressBar,
    is_riding: bool,
}

impl Ride {
    /// Begins with a search.
    pub fn begin(is_watched: bool) -> Self {
        let bar = ProgressBar::new(STEPS as u64).with_message("planning");
        Self {
            bar: begin(is_watched, bar, SEARCH),
            is_riding: false,
        }
    }

    /// The search came forward: `length` m is what `stage` now has.
    pub fn searched(&mut self, stage: Stage, length: f64) {
        if !self.bar.is_hidden() {
            self.bar.set_message(search_line(stage, length));
        }
    }

    /// The bike is under way since `time` s, has come `distance` of `length` m, and at most `duration` s are ridden.
    pub fn riding(&mut self, time: f64, distance: f64, length: f64, duration: f64) {
        if self.bar.is_hidden() {
            return;
        }
        if !self.is_riding {
            self.is_riding = true;
            if let Ok(style) = style(RIDE) {
                self.bar.set_style(style);
            }
        }
        self.bar
            .set_position((share(time, distance, length, duration) * STEPS) as u64);
        self.bar.set_message(ride_line(time, distance, length));
    }
}

/// Takes the display away.
impl Drop for Ride {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

fn style(template: &str) -> Result<ProgressStyle, indicatif::style::TemplateError> {
    ProgressStyle::with_template(template).map(|style| style.progress_chars("=> "))
}

fn begin(is_watched: bool, bar: ProgressBar, template: &str) -> ProgressBar {
    if !is_watched {
        return ProgressBar::hidden();
    }
    if let Ok(style) = style(template) {
        bar.set_style(style);
    }
    bar.enable_steady_tick(TICK);
    bar
}

/// The part of a ride that is behind: of its way, or, standing, of its time.
fn share(time: f64, distance: f64, length: f64, duration: f64) -> f64 {
    let share = if length > 0.0 {
        distance / length
    } else {
        time / duration.max(f64::MIN_POSITIVE)
    };
    share.clamp(0.0, 1.0)
}

fn search_line(stage: Stage, length: f64) -> String {
    format!("planning: {}, best {} m", words(stage), significant(length))
}

fn ride_line(time: f64, distance: f64, length: f64) -> String {
    let way = if length > 0.0 {
        format!(", {distance:.1} of {length:.1} m")
    } else {
        String::new()
    };
    format!("{time:.1} s simulated{way}")
}

fn words(stage: Stage) -> &'static str {
    match stage {
        Stage::Rrt => "RRT",
        Stage::RrtStar => "RRT*",
        Stage::Birrt => "BiRRT",
        Stage::Guide => "clearance grid",
        Stage::Shortest => "shortest way",
        Stage::Shortcut => "shortcuts",
        Stage::Taut => "pulling tight",
        Stage::Corridor => "RRT* in the corridor",
        Stage::Grid => "potential or flow",
        Stage::Mpc => "predictive control",
        Stage::Refine => "smoothing",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use indicatif::{InMemoryTerm, ProgressDrawTarget, TermLike};

    /// What a terminal of 80 columns shows of a bar.
    fn shown(bar: ProgressBar, template: &str) -> String {
        let terminal = InMemoryTerm::new(4, 80);
        bar.set_style(style(template).unwrap());
        bar.set_draw_target(ProgressDrawTarget::term_like(Box::new(terminal.clone())));
        bar.tick();
        assert_eq!(terminal.width(), 80);
        terminal.contents()
    }

    #[test]
    fn rows_tell_how_many_are_done_and_what_time_is_left() {
        let bar = ProgressBar::new(1_000_000)
            .with_message("sweeping")
            .with_position(500_000);
        let line = shown(bar, ROWS);
        assert_eq!(line.lines().count(), 1, "{line}");
        for part in ["sweeping", "500000/1000000", "gone", "to go", "====>"] {
            assert!(line.contains(part), "{line}");
        }
    }

    #[test]
    fn a_search_tells_its_stage_and_the_best_length() {
        let text = search_line(Stage::Corridor, 23.456);
        let line = shown(ProgressBar::new(1).with_message(text), SEARCH);
        assert!(
            line.contains("planning: RRT* in the corridor, best 23.5 m, 00:00:0"),
            "{line}"
        );
    }

    #[test]
    fn a_ride_tells_the_simulated_time_and_the_way() {
        let text = ride_line(123.42, 1014.26, 2031.0);
        let line = shown(
            ProgressBar::new(10).with_position(5).with_message(text),
            RIDE,
        );
        assert!(
            line.contains("123.4 s simulated, 1014.3 of 2031.0 m"),
            "{line}"
        );
        assert_eq!(line.lines().count(), 1, "{line}");
        assert_eq!(ride_line(2.0, 0.0, 0.0), "2.0 s simulated");
    }

    #[test]
    fn a_share_is_of_the_way_or_else_of_the_time() {
        assert_eq!(share(1.0, 5.0, 10.0, 60.0), 0.5);
        assert_eq!(share(15.0, 0.0, 0.0, 60.0), 0.25);
        assert_eq!(share(1.0, 11.0, 10.0, 60.0), 1.0);
        assert_eq!(share(0.0, 0.0, 0.0, 0.0), 0.0);
    }

    #[test]
    fn nothing_is_drawn_where_nobody_watches() {
        assert!(Rows::begin(false, 3, "sweeping").0.is_hidden());
        let mut ride = Ride::begin(false);
        ride.searched(Stage::Birrt, 1.0);
        ride.riding(1.0, 1.0, 2.0, 3.0);
        assert!(ride.bar.is_hidden() && ride.bar.message().is_empty());
    }
}
