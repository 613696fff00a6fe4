//! What a picture is made of: lines and areas in pixels, labels, and parts cut out of the sheet.
//!
//! Pixels run right and down from the upper left corner. Nothing here knows metres; the frames that
//! turn metres into pixels are in [`crate::axis`].

use crate::label;
use crate::palette::Colour;

/// A place on the sheet, px: right, down.
pub type Pixel = [f64; 2];

/// A cubic closer to a quarter circle of radius 1 than 3e-4 has its handles this far from its ends.
const QUARTER: f64 = 0.552_284_749_830_793_4;

/// One step of an outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Step {
    /// Begins a new piece.
    Move(Pixel),
    /// A straight leg.
    Line(Pixel),
    /// A cubic Bézier curve: two handles and where it ends.
    Cubic(Pixel, Pixel, Pixel),
    /// Back to the beginning of the piece.
    Close,
}

/// Pieces of line, straight or cubic, open or closed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outline {
    steps: Vec<Step>,
}

impl Outline {
    /// Nothing yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Straight legs through `points`.
    #[must_use]
    pub fn through(points: impl IntoIterator<Item = Pixel>) -> Self {
        let mut outline = Self::new();
        outline.add_line(points);
        outline
    }

    /// The closed polygon with corners `points`.
    #[must_use]
    pub fn polygon(points: impl IntoIterator<Item = Pixel>) -> Self {
        let mut outline = Self::through(points);
        outline.close();
        outline
    }

    /// A rectangle.
    #[must_use]
    pub fn rectangle(area: Area) -> Self {
        let Area { left, top, .. } = area;
        Self::polygon([
            [left, top],
            [area.right(), top],
            [area.right(), area.bottom()],
            [left, area.bottom()],
        ])
    }

    /// A circle, as four cubics.
    #[must_use]
    pub fn circle(center: Pixel, radius: f64) -> Self {
        let [x, y] = center;
        let (r, h) = (radius, QUARTER * radius);
        let mut circle = Self::new();
        circle.move_to([x + r, y]);
        circle.cubic_to([x + r, y + h], [x + h, y + r], [x, y + r]);
        circle.cubic_to([x - h, y + r], [x - r, y + h], [x - r, y]);
        circle.cubic_to([x - r, y - h], [x - h, y - r], [x, y - r]);
        circle.cubic_to([x + h, y - r], [x + r, y - h], [x + r, y]);
        circle.close();
        circle
    }

    /// Begins a new piece at `to`.
    pub fn move_to(&mut self, to: Pixel) {
        self.steps.push(Step::Move(to));
    }

    /// A straight leg to `to`.
    pub fn line_to(&mut self, to: Pixel) {
        self.steps.push(Step::Line(to));
    }

    /// A quarter of a circle about `center`, counter-clockwise where y points up, from the angle `from` (rad);
    /// the outline is there already.
    pub(crate) fn quarter_turn(&mut self, center: Pixel, radius: f64, from: f64) {
        let (sin, cos) = from.sin_cos();
        let at = |x: f64, y: f64| {
            [
                center[0] + radius * (cos * x - sin * y),
                center[1] + radius * (sin * x + cos * y),
            ]
        };
        self.cubic_to(at(1.0, QUARTER), at(QUARTER, 1.0), at(0.0, 1.0));
    }

    /// A cubic with handles `a` and `b` to `to`.
    pub fn cubic_to(&mut self, a: Pixel, b: Pixel, to: Pixel) {
        self.steps.push(Step::Cubic(a, b, to));
    }

    /// Closes the piece.
    pub fn close(&mut self) {
        if !self.steps.is_empty() {
            self.steps.push(Step::Close);
        }
    }

    /// A new piece of straight legs through `points`.
    pub fn add_line(&mut self, points: impl IntoIterator<Item = Pixel>) {
        for (index, point) in points.into_iter().enumerate() {
            self.steps.push(if index == 0 {
                Step::Move(point)
            } else {
                Step::Line(point)
            });
        }
    }

    /// All of `other` as well.
    pub fn append(&mut self, other: Self) {
        self.steps.extend(other.steps);
    }

    /// The same with every point moved by `place`; exact for curves where `place` is affine.
    #[must_use]
    pub fn mapped(&self, place: impl Fn(Pixel) -> Pixel) -> Self {
        let steps = self.steps.iter().map(|step| match *step {
            Step::Move(to) => Step::Move(place(to)),
            Step::Line(to) => Step::Line(place(to)),
            Step::Cubic(a, b, to) => Step::Cubic(place(a), place(b), place(to)),
            Step::Close => Step::Close,
        });
        Self {
            steps: steps.collect(),
        }
    }

    /// Its steps.
    #[must_use]
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// Whether there is nothing to draw.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// The rectangle around all points and handles: what is drawn lies inside.
    #[must_use]
    pub fn extent(&self) -> Option<Area> {
        let mut extent: Option<Area> = None;
        let mut add = |point: Pixel| {
            let here = Area::new(point[0], point[1], 0.0, 0.0);
            extent = Some(extent.map_or(here, |area| area.union(here)));
        };
        for step in &self.steps {
            match *step {
                Step::Move(to) | Step::Line(to) => add(to),
                Step::Cubic(a, b, to) => [a, b, to].into_iter().for_each(&mut add),
                Step::Close => {}
            }
        }
        extent
    }
}

/// A rectangle on the sheet, px.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Area {
    /// Its left side.
    pub left: f64,
    /// Its upper side.
    pub top: f64,
    /// How wide it is.
    pub width: f64,
    /// How high it is.
    pub height: f64,
}

impl Area {
    /// From its upper left corner and its size.
    #[must_use]
    pub const fn new(left: f64, top: f64, width: f64, height: f64) -> Self {
        Self {
            left,
            top,
            width,
            height,
        }
    }

    /// Its right side.
    #[must_use]
    pub fn right(&self) -> f64 {
        self.left + self.width
    }

    /// Its lower side.
    #[must_use]
    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }

    /// The smallest rectangle around both.
    #[must_use]
    pub fn union(&self, other: Self) -> Self {
        let (left, top) = (self.left.min(other.left), self.top.min(other.top));
        Self {
            left,
            top,
            width: self.right().max(other.right()) - left,
            height: self.bottom().max(other.bottom()) - top,
        }
    }

    /// What both cover; empty where they do not meet.
    #[must_use]
    pub fn intersection(&self, other: Self) -> Self {
        let (left, top) = (self.left.max(other.left), self.top.max(other.top));
        Self {
            left,
            top,
            width: (self.right().min(other.right()) - left).max(0.0),
            height: (self.bottom().min(other.bottom()) - top).max(0.0),
        }
    }

    /// Larger by `by` on every side.
    #[must_use]
    pub fn grown(&self, by: f64) -> Self {
        Self {
            left: self.left - by,
            top: self.top - by,
            width: self.width + 2.0 * by,
            height: self.height + 2.0 * by,
        }
    }
}

/// How an outline is drawn. Ends and corners of lines are round.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Style {
    /// Colour of the area, even-odd; `None` leaves it open.
    pub fill: Option<Colour>,
    /// Colour of the line; `None` draws none.
    pub stroke: Option<Colour>,
    /// Width of the line, px.
    pub width: f64,
    /// From 0, not seen, to 1, solid.
    pub opacity: f64,
    /// Lengths of dashes and gaps, px; empty for a solid line.
    pub dash: &'static [f64],
}

impl Style {
    /// An area.
    #[must_use]
    pub const fn fill(colour: Colour) -> Self {
        Self {
            fill: Some(colour),
            stroke: None,
            width: 0.0,
            opacity: 1.0,
            dash: &[],
        }
    }

    /// A line.
    #[must_use]
    pub const fn line(colour: Colour, width: f64) -> Self {
        Self {
            fill: None,
            stroke: Some(colour),
            width,
            opacity: 1.0,
            dash: &[],
        }
    }

    /// The same with a line round it.
    #[must_use]
    pub const fn edged(mut self, colour: Colour, width: f64) -> Self {
        self.stroke = Some(colour);
        self.width = width;
        self
    }

    /// The same, partly seen through.
    #[must_use]
    pub const fn faint(mut self, opacity: f64) -> Self {
        self.opacity = opacity;
        self
    }

    /// The same, dashed.
    #[must_use]
    pub const fn dashed(mut self, dash: &'static [f64]) -> Self {
        self.dash = dash;
        self
    }
}

/// Which point of a label its place names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// The left end of its base line.
    Start,
    /// The middle of its base line.
    Middle,
    /// The right end of its base line.
    End,
}

/// A line of text.
#[derive(Debug, Clone, PartialEq)]
pub struct Label {
    /// What it says.
    pub text: String,
    /// Where its anchor is, on the base line.
    pub at: Pixel,
    /// Height of an em, px.
    pub size: f64,
    /// Its colour.
    pub colour: Colour,
    /// Which point of it is at `at`.
    pub anchor: Anchor,
    /// Whether it reads upwards.
    pub upright: bool,
}

impl Label {
    /// A label that starts at `at`.
    pub fn new(text: impl Into<String>, at: Pixel, size: f64, colour: Colour) -> Self {
        Self {
            text: text.into(),
            at,
            size,
            colour,
            anchor: Anchor::Start,
            upright: false,
        }
    }

    /// The same with another anchor.
    #[must_use]
    pub fn anchored(mut self, anchor: Anchor) -> Self {
        self.anchor = anchor;
        self
    }

    /// The same, reading upwards.
    #[must_use]
    pub fn upwards(mut self) -> Self {
        self.upright = true;
        self
    }

    /// How far before its place it begins, px.
    pub(crate) fn lead(&self) -> f64 {
        let width = label::width(&self.text, self.size);
        match self.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => width / 2.0,
            Anchor::End => width,
        }
    }

    /// The rectangle it covers.
    #[must_use]
    pub fn extent(&self) -> Area {
        let (width, lead) = (label::width(&self.text, self.size), self.lead());
        let (above, below) = (0.78 * self.size, 0.24 * self.size);
        let [x, y] = self.at;
        if self.upright {
            Area::new(x - above, y + lead - width, above + below, width)
        } else {
            Area::new(x - lead, y - above, width, above + below)
        }
    }
}

/// One thing on the sheet; what comes later lies above.
#[derive(Debug, Clone, PartialEq)]
pub enum Item {
    /// A line or an area.
    Shape(Outline, Style),
    /// A text.
    Label(Label),
    /// Things of which only what lies inside the area is seen.
    Window(Area, Vec<Item>),
}

impl Item {
    /// The rectangle that what is seen of it lies in.
    #[must_use]
    pub fn extent(&self) -> Option<Area> {
        match self {
            Self::Shape(outline, style) => {
                let line = if style.stroke.is_some() {
                    style.width / 2.0
                } else {
                    0.0
                };
                outline.extent().map(|area| area.grown(line))
            }
            Self::Label(label) => Some(label.extent()),
            Self::Window(area, items) => extent(items).map(|inner| inner.intersection(*area)),
        }
    }
}

fn extent(items: &[Item]) -> Option<Area> {
    items
        .iter()
        .filter_map(Item::extent)
        .reduce(|all, one| all.union(one))
}

/// A sheet with things drawn on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    /// Width of the sheet, px.
    pub width: f64,
    /// Height of the sheet, px.
    pub height: f64,
    /// What it shows, for those who cannot see it.
    pub title: String,
    /// The things on it, from the lowest.
    pub items: Vec<Item>,
}

impl Drawing {
    /// An empty sheet.
    pub fn new(width: f64, height: f64, title: impl Into<String>) -> Self {
        Self {
            width,
            height,
            title: title.into(),
            items: Vec::new(),
        }
    }

    /// Puts a line or an area on top, unless it is empty.
    pub fn shape(&mut self, outline: Outline, style: Style) {
        if !outline.is_empty() {
            self.items.push(Item::Shape(outline, style));
        }
    }

    /// Puts a text on top.
    pub fn label(&mut self, label: Label) {
        self.items.push(Item::Label(label));
    }

    /// The rectangle that everything lies in.
    #[must_use]
    pub fn extent(&self) -> Option<Area> {
        extent(&self.items)
    }
}
