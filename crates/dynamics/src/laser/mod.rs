//! A laser scanner on the leaning, turning, moving bike.
//!
//! The mount rolls with the bike about the line through the wheel contacts, and the plane of the beams with it. Each beam
//! is a ray in space: it meets prisms on the ground, passes over their tops, or meets the ground itself. The beams of a
//! scan are fired one after another, each from where the bike is at its own time.
//!
//! | file | holds |
//! |---|---|
//! | `params` | [`LaserParams`]: beams, mount, errors; where a mount cannot be |
//! | `scan` | [`LaserScan`]: what one turn of the scanner says |
//! | `ray` | [`Ray`] and [`RayScene`], whatever rays can be cast through |
//! | `scanner` | [`LaserScanner`]: from bike to beams and back, one scan at a time |
//! | `sweep` | [`SweepingLaser`]: scan after scan along a ride, handed out late |
//!
//! Frames and signs: `docs/frames.md`.

mod params;
mod ray;
mod scan;
mod scanner;
mod sweep;

pub use params::{LaserParams, NoReturn};
pub use ray::{Prisms, Ray, RayScene};
pub use scan::LaserScan;
pub use scanner::LaserScanner;
pub use sweep::SweepingLaser;

#[cfg(test)]
mod tests;
