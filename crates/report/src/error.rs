//! Why there is no picture.

use thiserror::Error;

/// Why a picture could not be made.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ReportError {
    /// The text is no JSON.
    #[error("not JSON: {what}")]
    NotJson {
        /// What the reader met.
        what: String,
        /// Line of the file, from 1.
        line: usize,
    },
    /// It is JSON, but no plan file.
    #[error("not a plan file: {what}")]
    NotAPlan {
        /// What is missing or of another kind.
        what: String,
        /// Line of the file, from 1, where it is known.
        line: Option<usize>,
    },
    /// It is a plan without its curves.
    #[error("the plan has no `segments`: it was printed, not written by -o")]
    NoSegments,
    /// A number of the plan that no plan can have.
    #[error("{what} is {value:?}: {expected}")]
    Number {
        /// Which one.
        what: String,
        /// What was found.
        value: f64,
        /// What would do.
        expected: &'static str,
    },
    /// The plan's footprint cannot be read.
    #[error("problem.footprint: {what}")]
    Footprint {
        /// What is wrong with it.
        what: String,
    },
    /// The plan has more of something than is drawn.
    #[error("the plan has {count} {what}; at most {most} are drawn")]
    TooMany {
        /// How many it has.
        count: usize,
        /// Of what.
        what: &'static str,
        /// How many would do.
        most: usize,
    },
    /// The map is not the one the plan was made on.
    #[error(
        "the map's field is [{}], the plan's [{}] (min x, min y, max x, max y in m)",
        numbers(map),
        numbers(plan)
    )]
    OtherMap {
        /// The map's field, m.
        map: [f64; 4],
        /// The plan's field, m.
        plan: [f64; 4],
    },
    /// Nothing was ridden.
    #[error("the recording has no states: nothing was ridden")]
    NothingRidden,
    /// The image would be too small or too large.
    #[error("an image of {width} × {height} pixels cannot be made; 1 to 16384 a side can")]
    TooLarge {
        /// px.
        width: f64,
        /// px.
        height: f64,
    },
    /// The renderer refused.
    #[error("the picture could not be rendered: {what}")]
    Render {
        /// What it said.
        what: String,
    },
}

fn numbers(values: &[f64; 4]) -> String {
    values.map(|value| value.to_string()).join(", ")
}
