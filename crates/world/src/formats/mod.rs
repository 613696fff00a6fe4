//! Map files: bytes in, a world or a located error out.

mod error;

pub use error::{MapError, MapProblem};
