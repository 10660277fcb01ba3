//! Key poses as they stand in a file, and what is wrong with them.

use std::collections::BTreeMap;

use crate::dynamics::PoseError;

/// Names of the built-in motions: those of section 6.1 of the main paper.
pub const MOTION_NAMES: [&str; 3] = ["reach", "drink", "stand-up"];

/// The file of the built-in motion `name`, one of [`MOTION_NAMES`].
pub fn shipped_motion(name: &str) -> Option<&'static str> {
    match name {
        "reach" => Some(include_str!("../../configs/motions/reach.toml")),
        "drink" => Some(include_str!("../../configs/motions/drink.toml")),
        "stand-up" => Some(include_str!("../../configs/motions/stand-up.toml")),
        _ => None,
    }
}

/// A motion: the poses it passes through, at rest in each.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionSettings {
    /// Key poses in the order of their times. The first is where the character stands before the motion.
    #[serde(rename = "pose")]
    pub poses: Vec<KeyPose>,
}

/// One pose of a motion.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeyPose {
    /// When it is reached, s after the start of the motion.
    pub time_s: f64,
    /// Hinge angles by name, rad; hinges not named are as in the standing pose. The ankles lean in addition, so that the
    /// centre of mass stands over the feet.
    #[serde(default)]
    pub angles: BTreeMap<String, f64>,
}

/// Why a motion cannot be made. Poses count from 1.
#[derive(Debug, thiserror::Error)]
pub enum MotionError {
    /// Not TOML, or a key or value that does not belong there.
    #[error("{}", .0.to_string().trim_end())]
    Toml(#[from] toml::de::Error),
    /// Too few poses, or too many.
    #[error("key `pose` holds {got} poses, allowed are 2 to {MAX_POSES}")]
    Count {
        /// How many there are.
        got: usize,
    },
    /// A number out of range.
    #[error("pose {pose}: key `{key}` is {got}, allowed is {allowed}")]
    Range {
        /// Number of the pose.
        pose: usize,
        /// Name of the key.
        key: String,
        /// What was given.
        got: f64,
        /// Allowed range.
        allowed: String,
    },
    /// A hinge the model does not have.
    #[error("pose {pose}: the model has no hinge `{name}`\n\nhint: hinges are {known}")]
    UnknownJoint {
        /// Number of the pose.
        pose: usize,
        /// The name given.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A standing pose that the model cannot take.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// Feet that would have to leave the ground or slide.
    #[error(
        "on the way to pose {pose} a point of the feet is {} mm from where it stands in the standing pose, allowed are 5 mm\n\n\
         hint: the feet must stay where they are: thigh_y + shank_y + foot_y of each leg must add up to 0",
        (off * 1e4).round() / 10.0
    )]
    Feet {
        /// Number of the pose at the end of that way.
        pose: usize,
        /// How far off, m.
        off: f64,
    },
    /// A pose that the fall detector takes for a fall.
    #[error(
        "the centre of mass goes down to {height:.2} m, a character below fall.least_com_height = {least:.2} m counts as \
         fallen\n\nhint: bend the knees less, or lower core.fall.least_com_height"
    )]
    TooLow {
        /// The lowest height of the motion, m.
        height: f64,
        /// The limit, m.
        least: f64,
    },
}

/// Most poses of one motion.
const MAX_POSES: usize = 100;

impl MotionSettings {
    /// Parses and checks the text of a motion file.
    ///
    /// # Errors
    /// [`MotionError`] names the pose and the key.
    pub fn from_toml(text: &str) -> Result<Self, MotionError> {
        let motion: Self = toml::from_str(text)?;
        motion.check()?;
        Ok(motion)
    }

    /// Checks every number that needs no model to be checked.
    ///
    /// # Errors
    /// The first key outside its range.
    pub fn check(&self) -> Result<(), MotionError> {
        if !(2..=MAX_POSES).contains(&self.poses.len()) {
            return Err(MotionError::Count { got: self.poses.len() });
        }
        let mut earliest = 0.0;
        let mut latest = 0.0;
        for (index, pose) in self.poses.iter().enumerate() {
            let out_of_range = |key: &str, got: f64, allowed: String| {
                Err(MotionError::Range { pose: index + 1, key: key.to_owned(), got, allowed })
            };
            if !(earliest..=latest).contains(&pose.time_s) {
                let allowed = match index {
                    0 => "0 s: the motion starts in its first pose".to_owned(),
                    _ => format!("{earliest} to {latest} s: between 0.1 s and 60 s after the pose before"),
                };
                return out_of_range("time_s", pose.time_s, allowed);
            }
            (earliest, latest) = (pose.time_s + 0.1, pose.time_s + 60.0);
            if let Some((name, angle)) = pose.angles.iter().find(|(_, angle)| !(-3.2..=3.2).contains(*angle))
            {
                return out_of_range(&format!("angles.{name}"), *angle, "-3.2 to 3.2 rad".to_owned());
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_a_motion_and_nothing_else_is() {
        for name in MOTION_NAMES {
            MotionSettings::from_toml(shipped_motion(name).unwrap()).unwrap();
        }
        assert_eq!(shipped_motion("sleep"), None);
    }

    #[test]
    fn errors_name_pose_key_and_range() {
        for (text, parts) in [
            ("", &["missing field `pose`"][..]),
            ("pose = []", &["`pose` holds 0 poses", "2 to 100"]),
            ("[[pose]]\ntime_s = 0\n", &["holds 1 poses"]),
            ("[[pose]]\ntime_s = 0\ntime = 1", &["unknown field `time`", "line 3"]),
            ("[[pose]]\ntime_s = 1\n[[pose]]\ntime_s = 2", &["pose 1: key `time_s` is 1", "allowed is 0 s"]),
            (
                "[[pose]]\ntime_s = 0\n[[pose]]\ntime_s = 0.05",
                &["pose 2: key `time_s` is 0.05", "0.1 to 60 s"],
            ),
            ("[[pose]]\ntime_s = 0\n[[pose]]\ntime_s = nan", &["pose 2: key `time_s` is NaN"]),
            (
                "[[pose]]\ntime_s = 0\n[[pose]]\ntime_s = 1\nangles = { neck_y = -90 }",
                &["pose 2: key `angles.neck_y` is -90", "-3.2 to 3.2 rad"],
            ),
        ] {
            let error = MotionSettings::from_toml(text).unwrap_err().to_string();
            assert!(parts.iter().all(|part| error.contains(part)), "{text}: {error}");
        }
    }
}
