//! Colours: those of Okabe and Ito, which people with any kind of colour vision tell apart, and greys.

/// A colour, as `#rrggbb`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour(pub &'static str);

/// The sheet.
pub const PAPER: Colour = Colour("#ffffff");
/// Ground that may be ridden on.
pub const FIELD: Colour = Colour("#fafaf7");
/// Obstacles.
pub const OBSTACLE: Colour = Colour("#6f7a83");
/// Cells nobody has seen.
pub const UNKNOWN: Colour = Colour("#ccd1d4");
/// Text and frames.
pub const INK: Colour = Colour("#22282c");
/// Less important text.
pub const GREY: Colour = Colour("#5f686e");
/// Lines behind the data.
pub const RULE: Colour = Colour("#e2e4e2");
/// Blue: the search tree.
pub const BLUE: Colour = Colour("#0072b2");
/// Sky blue: the corridor.
pub const SKY: Colour = Colour("#56b4e9");
/// Vermilion: the path.
pub const VERMILION: Colour = Colour("#d55e00");
/// Bluish green: the guide.
pub const GREEN: Colour = Colour("#009e73");
/// Reddish purple: the coarse path.
pub const PURPLE: Colour = Colour("#cc79a7");
/// Orange: the outline of the robot.
pub const ORANGE: Colour = Colour("#e69f00");

/// The colours by the names that pages know them by.
pub const NAMED: [(&str, Colour); 13] = [
    ("blue", BLUE),
    ("sky", SKY),
    ("vermilion", VERMILION),
    ("green", GREEN),
    ("purple", PURPLE),
    ("orange", ORANGE),
    ("obstacle", OBSTACLE),
    ("unknown", UNKNOWN),
    ("field", FIELD),
    ("ink", INK),
    ("grey", GREY),
    ("rule", RULE),
    ("paper", PAPER),
];

/// From straight to the curvature limit, in seven steps: from blue over grey-violet to yellow-brown, ever
/// lighter, so that it can be read in grey as well.
pub const RAMP: [Colour; 7] = [
    Colour("#00306f"),
    Colour("#2c4a7c"),
    Colour("#575f79"),
    Colour("#7f7474"),
    Colour("#a98c62"),
    Colour("#d0a544"),
    Colour("#f0c419"),
];

/// Envelope maps: where the bike recovers.
pub const RECOVERED: Colour = Colour("#d7ecf8");
/// Envelope maps: what it fails for elsewhere, in the order of the legend. Each is darker than [`RECOVERED`].
pub const CAUSES: [(&str, Colour); 7] = [
    ("balancer_saturated", VERMILION),
    ("wheel_lift", BLUE),
    ("slip", PURPLE),
    ("roll", ORANGE),
    ("not_recovered", GREEN),
    ("obstacle", OBSTACLE),
    ("steering_stuck", Colour("#8a5a00")),
];
/// Envelope maps: causes that have no colour of their own share this.
pub const OTHER_CAUSE: Colour = INK;
