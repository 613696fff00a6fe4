//! The bikebot command line.
fn main() {}
