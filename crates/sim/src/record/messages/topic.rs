//! The topics, their schemas, and the messages that are ours alone.

use foxglove::Encode;
use foxglove::messages::{
    FrameTransforms, Grid, JointStates, LaserScan, Log, PoseInFrame, PosesInFrame, SceneUpdate,
};

use super::super::event::{BikeState, ControlDebug, PathSample};
use crate::clock::SimTime;

/// A topic of the recording; the order is that of the channels in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::record) enum Topic {
    Frames,
    Map,
    Occupancy,
    PlanPath,
    PlanScene,
    PlanSamples,
    Followed,
    Pose,
    Joints,
    State,
    Control,
    Footprint,
    Obstacles,
    Scan,
    Belief,
    Events,
    Log,
    Model,
}

impl Topic {
    pub(in crate::record) const ALL: [Self; 18] = [
        Self::Frames,
        Self::Map,
        Self::Occupancy,
        Self::PlanPath,
        Self::PlanScene,
        Self::PlanSamples,
        Self::Followed,
        Self::Pose,
        Self::Joints,
        Self::State,
        Self::Control,
        Self::Footprint,
        Self::Obstacles,
        Self::Scan,
        Self::Belief,
        Self::Events,
        Self::Log,
        Self::Model,
    ];

    pub(in crate::record) const fn name(self) -> &'static str {
        match self {
            Self::Frames => "/tf",
            Self::Map => "/map",
            Self::Occupancy => "/map/occupancy",
            Self::PlanPath => "/plan/path",
            Self::PlanScene => "/plan/scene",
            Self::PlanSamples => "/plan/samples",
            Self::Followed => "/plan/followed",
            Self::Pose => "/bike/pose",
            Self::Joints => "/bike/joints",
            Self::State => "/bike/state",
            Self::Control => "/control/debug",
            Self::Footprint => "/bike/footprint",
            Self::Obstacles => "/obstacles",
            Self::Scan => "/scan",
            Self::Belief => "/belief",
            Self::Events => "/events",
            Self::Log => "/log",
            Self::Model => "/bike/model",
        }
    }

    /// Whether its messages are placed in the world, other than saying where frames are.
    pub(in crate::record) const fn is_framed(self) -> bool {
        matches!(
            self,
            Self::Map
                | Self::Occupancy
                | Self::PlanPath
                | Self::PlanScene
                | Self::PlanSamples
                | Self::Followed
                | Self::Pose
                | Self::Footprint
                | Self::Obstacles
                | Self::Scan
                | Self::Belief
                | Self::Model
        )
    }

    /// Whether its last message stays true until the next: whoever comes later needs it.
    #[cfg(feature = "live")]
    pub(in crate::record) const fn stands(self) -> bool {
        matches!(
            self,
            Self::Map
                | Self::Occupancy
                | Self::PlanPath
                | Self::PlanScene
                | Self::PlanSamples
                | Self::Followed
                | Self::Obstacles
                | Self::Belief
                | Self::Model
        )
    }

    /// The schema of the topic's messages and their encoding.
    pub(in crate::record) fn schema(self) -> (Option<foxglove::Schema>, String) {
        fn of<M: Encode>() -> (Option<foxglove::Schema>, String) {
            (M::get_schema(), M::get_message_encoding())
        }
        match self {
            Self::Frames => of::<FrameTransforms>(),
            Self::Map | Self::Occupancy | Self::Belief => of::<Grid>(),
            Self::PlanPath => of::<PosesInFrame>(),
            Self::PlanScene | Self::Footprint | Self::Obstacles | Self::Model => {
                of::<SceneUpdate>()
            }
            Self::PlanSamples | Self::Followed => of::<PathTable>(),
            Self::Pose => of::<PoseInFrame>(),
            Self::Joints => of::<JointStates>(),
            Self::State => of::<BikeState>(),
            Self::Control => of::<ControlDebug>(),
            Self::Scan => of::<LaserScan>(),
            Self::Events => of::<RunEvent>(),
            Self::Log => of::<Log>(),
        }
    }
}

/// A path as columns, with what a pose cannot carry.
#[derive(foxglove::Encode)]
pub(in crate::record) struct PathTable {
    time_s: f64,
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    heading_rad: Vec<f64>,
    curvature_per_m: Vec<f64>,
    s_m: Vec<f64>,
    speed_mps: Vec<f64>,
}

/// Something a program may want to find.
#[derive(foxglove::Encode)]
pub(in crate::record) struct RunEvent {
    pub(in crate::record) time_s: f64,
    pub(in crate::record) kind: String,
    pub(in crate::record) text: String,
    pub(in crate::record) value: f64,
}

pub(in crate::record) fn path_table(time: SimTime, path: &[PathSample]) -> PathTable {
    let column = |value: fn(&PathSample) -> f64| path.iter().map(value).collect();
    PathTable {
        time_s: time.seconds(),
        x_m: column(|it| it.x),
        y_m: column(|it| it.y),
        heading_rad: column(|it| it.heading),
        curvature_per_m: column(|it| it.curvature),
        s_m: column(|it| it.s),
        speed_mps: column(|it| it.speed),
    }
}
