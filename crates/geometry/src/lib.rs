//! Plane geometry and curves of the bike robot.
