//! What is to be planned: where, with which outline, from where to where, how tightly it may turn.

use crate::error::{End, PlanError};
use crate::motion::MotionChecker;
use bikebot_geometry::{Point2, Pose2};
use bikebot_world::{Footprint, World};

/// A position, with a heading or free to choose one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EndPose {
    /// Position of the footprint's reference point, m.
    pub position: Point2,
    /// Heading counter-clockwise from +x, rad; `None`: any.
    pub heading: Option<f64>,
    /// σ_0, 1/m, positive to the left: the curvature with which a path must begin there; `None`: any. For a start with a heading,
    /// where a steering angle that cannot jump is turned already. Heeded by [`Method::Full`](crate::Method::Full), whose paths have
    /// continuous curvature; those of the other methods begin with any.
    pub curvature: Option<f64>,
}

impl EndPose {
    /// An end with a heading (rad).
    #[must_use]
    pub fn pose(x: f64, y: f64, heading: f64) -> Self {
        Self {
            position: Point2::new(x, y),
            heading: Some(heading),
            curvature: None,
        }
    }

    /// An end with any heading.
    #[must_use]
    pub fn point(x: f64, y: f64) -> Self {
        Self {
            position: Point2::new(x, y),
            heading: None,
            curvature: None,
        }
    }

    /// The same end, with the curvature (σ_0, 1/m) with which a path must begin there.
    #[must_use]
    pub fn with_curvature(self, curvature: f64) -> Self {
        Self {
            curvature: Some(curvature),
            ..self
        }
    }
}

/// 𝒳_goal: the goal pose, and how near counts as there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GoalRegion {
    /// Position of the footprint's reference point, m.
    pub position: Point2,
    /// Heading counter-clockwise from +x, rad; `None`: any.
    pub heading: Option<f64>,
    /// The paper's `l`, m: radius of the ball in which a search to [`GoalMode::Ball`](crate::params::GoalMode)
    /// may end. Not used where the goal itself must be reached.
    pub tolerance: f64,
}

impl GoalRegion {
    /// The goal without its tolerance.
    #[must_use]
    pub fn end(&self) -> EndPose {
        EndPose {
            position: self.position,
            heading: self.heading,
            curvature: None,
        }
    }

    /// Whether `position` is within the tolerance of the goal's position.
    #[must_use]
    pub fn contains(&self, position: Point2) -> bool {
        (position - self.position).norm() <= self.tolerance
    }
}

/// One question to the planner. Borrows the world, which may be shared between many.
#[derive(Debug, Clone)]
pub struct PlanningProblem<'w> {
    /// 𝒳 and 𝒳_obst.
    pub world: &'w World,
    /// What must fit.
    pub footprint: Footprint,
    /// x_init.
    pub start: EndPose,
    /// 𝒳_goal.
    pub goal: GoalRegion,
    /// σ_MAX, 1/m, > 0.
    pub max_curvature: f64,
}

impl PlanningProblem<'_> {
    /// Checks that the question makes sense: finite numbers, a footprint that is a shape, ends on the map and `margin` (m) clear of obstacles.
    ///
    /// An end with a heading is checked for the whole footprint; one without, for the largest disc about the
    /// reference point that the footprint contains, since any heading will do.
    ///
    /// # Errors
    ///
    /// The first thing found wrong.
    pub fn check(&self, margin: f64) -> Result<(), PlanError> {
        let positive = |name, value: f64| {
            if value.is_finite() && value > 0.0 {
                Ok(())
            } else {
                Err(PlanError::InvalidParameter {
                    name,
                    value,
                    expected: "a finite number above 0",
                })
            }
        };
        positive("max_curvature_per_m", self.max_curvature)?;
        if !(self.goal.tolerance.is_finite() && self.goal.tolerance >= 0.0) {
            return Err(PlanError::InvalidParameter {
                name: "tolerance_m",
                value: self.goal.tolerance,
                expected: "a finite number, 0 or above",
            });
        }
        // A radius below zero would grow every clearance, and one that is not a number hide in a maximum.
        self.footprint.check()?;
        self.check_curvature()?;
        self.check_end(End::Start, &self.start, margin)?;
        self.check_end(End::Goal, &self.goal.end(), margin)
    }

    fn check_curvature(&self) -> Result<(), PlanError> {
        let Some(curvature) = self.start.curvature else {
            return Ok(());
        };
        let refused = |expected| {
            Err(PlanError::InvalidParameter {
                name: "start curvature_per_m",
                value: curvature,
                expected,
            })
        };
        if curvature.is_nan() || curvature.abs() > self.max_curvature {
            return refused("within the curvature limit");
        }
        if self.start.heading.is_none() {
            return refused("left out where the start has no heading");
        }
        Ok(())
    }

    fn check_end(&self, which: End, end: &EndPose, margin: f64) -> Result<(), PlanError> {
        let EndPose {
            position, heading, ..
        } = *end;
        for (name, value) in [
            ("x_m", position.x),
            ("y_m", position.y),
            ("heading_rad", heading.unwrap_or(0.0)),
        ] {
            if !value.is_finite() {
                return Err(PlanError::InvalidParameter {
                    name,
                    value,
                    expected: "a finite number",
                });
            }
        }
        if !self.world.is_inside(position) {
            let bounds = self.world.bounds();
            return Err(PlanError::OutsideMap {
                which,
                position,
                min: bounds.min,
                max: bounds.max,
            });
        }
        let checker = MotionChecker::new(self.world, &self.footprint, margin, 0.0);
        let clearance = match heading {
            Some(heading) => checker.pose_clearance(&Pose2 { position, heading }),
            None => checker.position_clearance(position),
        };
        // Not `<`: a clearance that is not a number is no clearance.
        if clearance > margin {
            return Ok(());
        }
        Err(match which {
            End::Start => PlanError::StartInObstacle {
                position,
                clearance,
                margin,
            },
            End::Goal => PlanError::GoalInObstacle {
                position,
                clearance,
                margin,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{block, room};

    fn problem(world: &World) -> PlanningProblem<'_> {
        PlanningProblem {
            world,
            footprint: Footprint::bike(),
            start: EndPose::pose(2.0, 2.0, 0.0),
            goal: GoalRegion {
                position: Point2::new(8.0, 8.0),
                heading: None,
                tolerance: 0.3,
            },
            max_curvature: 0.8,
        }
    }

    #[test]
    fn tells_which_end_makes_no_sense_and_why() {
        let world = room(10.0, vec![block(3.0, 1.0, 4.0, 3.0)]);
        // The bike's front, 1.46 m ahead of the rear contact, is in the block; without a heading its disc is not.
        let error = problem(&world).check(0.0).unwrap_err();
        assert!(matches!(error, PlanError::StartInObstacle { clearance, .. } if clearance < 0.0));
        let free = EndPose::point(2.0, 2.0);
        let start = |start| PlanningProblem {
            start,
            ..problem(&world)
        };
        assert_eq!(start(free).check(0.0), Ok(()));
        assert!(matches!(
            start(EndPose::point(2.0, -1.0)).check(0.0),
            Err(PlanError::OutsideMap {
                which: End::Start,
                ..
            })
        ));
        assert!(matches!(
            start(EndPose::point(f64::NAN, 1.0)).check(0.0),
            Err(PlanError::InvalidParameter { name: "x_m", .. })
        ));
        let mut other = start(free);
        other.goal.position = Point2::new(3.5, 2.0);
        assert!(matches!(
            other.check(0.0),
            Err(PlanError::GoalInObstacle { .. })
        ));
        let mut other = start(free);
        other.max_curvature = 0.0;
        assert!(matches!(
            other.check(0.0),
            Err(PlanError::InvalidParameter {
                name: "max_curvature_per_m",
                ..
            })
        ));
    }

    #[test]
    fn a_start_curvature_beyond_the_limit_or_without_a_heading_is_refused() {
        let world = room(10.0, vec![]);
        let with = |curvature| PlanningProblem {
            start: EndPose::pose(2.0, 2.0, 0.0).with_curvature(curvature),
            ..problem(&world)
        };
        for curvature in [0.0, 0.8, -0.8] {
            assert_eq!(with(curvature).check(0.0), Ok(()));
        }
        for curvature in [0.81, -0.81, f64::INFINITY, f64::NAN] {
            assert!(matches!(
                with(curvature).check(0.0),
                Err(PlanError::InvalidParameter {
                    expected: "within the curvature limit",
                    ..
                })
            ));
        }
        let free = PlanningProblem {
            start: EndPose::point(2.0, 2.0).with_curvature(0.1),
            ..problem(&world)
        };
        assert!(free.check(0.0).is_err());
    }

    #[test]
    fn an_outline_that_is_no_shape_is_refused_whatever_the_ends_say() {
        let world = room(10.0, vec![]);
        for footprint in [
            Footprint::Disc { radius: -1.0 },
            Footprint::Disc { radius: f64::NAN },
            // Without a heading only the inscribed disc is looked at, which a NaN does not reach.
            Footprint::Capsule {
                rear: f64::NAN,
                front: 1.0,
                radius: 0.3,
            },
            Footprint::Rectangle {
                rear: 1.0,
                front: -1.0,
                half_width: 0.3,
            },
        ] {
            let problem = PlanningProblem {
                footprint,
                start: EndPose::point(2.0, 2.0),
                ..problem(&world)
            };
            assert!(matches!(
                problem.check(0.0),
                Err(PlanError::InvalidFootprint(_))
            ));
        }
    }

    #[test]
    fn a_margin_is_asked_for_at_the_ends_too() {
        let world = room(10.0, vec![]);
        let near_edge = PlanningProblem {
            start: EndPose::pose(2.0, 0.5, 0.0),
            ..problem(&world)
        };
        assert_eq!(near_edge.check(0.1), Ok(()));
        assert!(matches!(
            near_edge.check(0.25),
            Err(PlanError::StartInObstacle { .. })
        ));
    }
}
