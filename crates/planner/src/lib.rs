//! Curvature-bounded path planning: BiRRT, shortcutting, corridor RRT*.
