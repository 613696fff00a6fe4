//! The path to ride: planned, given, or none.

use super::{MAX_PATH_LENGTH, PathSource, Resolver, SetupError};
use crate::path_file::{self, PathFileError};
use crate::refit::refit;
use crate::scenario::{PathSection, PlantModel};
use bikebot_control::FollowedPath;
use bikebot_geometry::{CurvePath, FergusonCurve, Pose2};

impl Resolver<'_> {
    pub(super) fn path(&mut self) -> Result<PathSource, SetupError> {
        let scenario = self.scenario;
        let Some(section) = &scenario.path else {
            if scenario.plant.model == PlantModel::TwoLink {
                if scenario.goal.is_some() {
                    self.warnings.push(
                        "[goal] has no effect: `plant.model` = \"two_link\" stands still".into(),
                    );
                }
                return Ok(PathSource::Standing);
            }
            if scenario.map.is_none() {
                return self.refuse(
                    "name",
                    "the scenario has neither [map] nor [path], so there is nothing to ride",
                    "add [map] and [goal] to plan a path, or [path] to give one",
                );
            }
            return Ok(PathSource::Planned);
        };
        if scenario.plant.model == PlantModel::TwoLink {
            return self.refuse(
                "path",
                "[path] is given, but `plant.model` = \"two_link\" stands still",
                "remove [path], or choose plant.model = \"bike3d\"",
            );
        }
        let curves = match (&section.waypoints, &section.file) {
            (Some(waypoints), None) => self.through(waypoints, section)?,
            (None, Some(name)) => self.read_path(&name.clone(), section)?,
            (Some(_), Some(_)) => {
                return self.refuse(
                    "path.file",
                    "[path] has both `waypoints` and `file`",
                    "keep one of the two",
                );
            }
            (None, None) => {
                return self.refuse(
                    "path",
                    "[path] has neither `waypoints` nor `file`",
                    "add `waypoints = [[x_m, y_m, heading_deg], …]` or `file = \"plan.json\"`",
                );
            }
        };
        let key = if section.file.is_some() {
            "path.file"
        } else {
            "path.waypoints"
        };
        let path = CurvePath::new(curves).and_then(|path| match section.refit_spacing_m {
            Some(spacing) if path.length() <= MAX_PATH_LENGTH => refit(&path, spacing),
            _ => Ok(path),
        });
        match path {
            Ok(path) if path.length() < FollowedPath::MIN_LENGTH => self.refuse(
                key,
                format!("`{key}`: the path is {} m long", path.length()),
                format!("a path to ride has at least {} m", FollowedPath::MIN_LENGTH),
            ),
            Ok(path) if path.length() <= MAX_PATH_LENGTH => Ok(PathSource::Given(path)),
            Ok(path) => self.refuse(
                key,
                format!("`{key}`: the path is {:.0} m long", path.length()),
                format!(
                    "a path to ride has at most {MAX_PATH_LENGTH} m; are its points in metres?"
                ),
            ),
            Err(error) => self.refuse(
                key,
                format!("`{key}`: {error}"),
                "neighbouring points must differ",
            ),
        }
    }

    fn through(
        &self,
        waypoints: &[[f64; 3]],
        section: &PathSection,
    ) -> Result<Vec<FergusonCurve>, SetupError> {
        let factor = section.tangent_per_chord.unwrap_or(1.2);
        let mut curves = Vec::with_capacity(waypoints.len());
        for (index, pair) in waypoints.windows(2).enumerate() {
            let pose = |p: [f64; 3]| Pose2::new(p[0], p[1], p[2].to_radians());
            let (from, to) = (pose(pair[0]), pose(pair[1]));
            let chord = (to.position - from.position).norm();
            if chord < 1e-6 {
                return self.refuse(
                    &format!("path.waypoints.{}", index + 1),
                    format!(
                        "way points {} and {} of `path.waypoints` are the same point",
                        index + 1,
                        index + 2
                    ),
                    "neighbouring way points must differ",
                );
            }
            curves.push(FergusonCurve::between(from, to, factor * chord));
        }
        Ok(curves)
    }

    fn read_path(
        &mut self,
        name: &str,
        section: &PathSection,
    ) -> Result<Vec<FergusonCurve>, SetupError> {
        let bytes = match (self.read)(name) {
            Ok(bytes) => bytes,
            Err(reason) => {
                return self.refuse(
                    "path.file",
                    format!("path file `{name}`: {reason}"),
                    "the path is relative to the scenario file",
                );
            }
        };
        if section.tangent_per_chord.is_some() && name.to_ascii_lowercase().ends_with(".json") {
            return self.refuse(
                "path.tangent_per_chord",
                format!("`path.tangent_per_chord` has no effect on `{name}`: a plan carries its own curves"),
                "remove it; it is for way points and centre lines",
            );
        }
        match path_file::parse(name, &bytes, section.tangent_per_chord.unwrap_or(1.0)) {
            Ok(curves) => {
                self.files.push((name.to_owned(), bytes));
                Ok(curves)
            }
            Err(PathFileError {
                message,
                line,
                help,
            }) => {
                let place = line.map_or(String::new(), |line| format!(":{line}"));
                self.refuse(
                    "path.file",
                    format!("path file `{name}{place}`: {message}"),
                    help,
                )
            }
        }
    }
}
