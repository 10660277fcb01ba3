//! Files of a run besides the recording: the figure and the summary.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::failure::{Failure, FailureKind};
use crate::balance::perceive;
use crate::character::CharacterModel;
use crate::dynamics::{Engine, GroundSurface, standing_pose};
use crate::report::Summary;
use crate::runtime::CoreSettings;

/// Names of the files in the result folder.
const FIGURE: &str = "figure.svg";
const SUMMARY: &str = "summary.json";

/// Files of a run besides the recording.
pub(super) struct Outputs {
    folder: Option<PathBuf>,
}

impl Outputs {
    /// Makes sure, before the run costs time, that nothing is overwritten unasked. `record` is the recording the run
    /// will write. Leaves no trace on the disk.
    pub(super) fn claim(folder: Option<&Path>, record: Option<&Path>, force: bool) -> Result<Self, Failure> {
        if let Some(folder) = folder.filter(|folder| folder.exists() && !folder.is_dir()) {
            return Err(Failure::usage(format!(
                "{}: this is a file, --out needs a folder\n\nhint: choose another name",
                folder.display()
            )));
        }
        let in_folder = folder.into_iter().flat_map(|folder| [FIGURE, SUMMARY].map(|name| folder.join(name)));
        let taken = in_folder.chain(record.map(Path::to_owned)).find(|path| path.exists());
        if let (Some(path), false) = (taken, force) {
            return Err(Failure::usage(format!(
                "{}: the file exists already\n\nhint: choose another name or folder, or overwrite it with --force",
                path.display()
            )));
        }
        Ok(Self { folder: folder.map(Path::to_owned) })
    }

    /// Makes the folder.
    pub(super) fn make_folder(&self) -> Result<(), Failure> {
        let Some(folder) = &self.folder else { return Ok(()) };
        std::fs::create_dir_all(folder).map_err(|error| {
            Failure::usage(format!(
                "{}: cannot make this folder: {error}\n\nhint: choose another with --out",
                folder.display()
            ))
        })
    }

    /// Writes figure and summary and enters the figure's name into the summary.
    pub(super) fn write(&self, summary: &mut Summary, figure: &str) -> Result<(), Failure> {
        let Some(folder) = &self.folder else { return Ok(()) };
        let write = |name: &str, text: &str| {
            let path = folder.join(name);
            std::fs::write(&path, text).map(|()| path.clone()).map_err(|error| {
                Failure::new(
                    FailureKind::Failed,
                    format!(
                        "{}: cannot write it: {error}\n\nhint: check permissions and free space",
                        path.display()
                    ),
                )
            })
        };
        summary.figure = Some(write(FIGURE, figure)?.display().to_string());
        let text = serde_json::to_string_pretty(&summary).unwrap_or_default();
        write(SUMMARY, &text)?;
        Ok(())
    }
}

/// Corners of the support polygon around its centroid in the standing pose, m: for the figure.
pub(super) fn support_outline(
    settings: &CoreSettings,
    model: &CharacterModel,
) -> Result<Vec<[f64; 2]>, Failure> {
    let state = standing_pose(model, &settings.pose).map_err(|error| Failure::usage(error.to_string()))?;
    let engine = Engine::new(Arc::new(model.clone()), settings.contact, state);
    let ground = GroundSurface::level(model.friction);
    let support = perceive(&engine, &ground, &model.gravity).support;
    let centre = support.centroid_world.xy();
    Ok(support.corners().iter().map(|corner| [corner.x - centre.x, corner.y - centre.y]).collect())
}
