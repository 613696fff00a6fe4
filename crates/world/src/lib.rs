//! Obstacles, grids, and the questions one can ask them.
