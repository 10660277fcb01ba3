//! Files of a run besides the recording: the figure and the summary.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use super::failure::{Failure, FailureKind};
use crate::report::Summary;

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
        claim(folder, &[FIGURE, SUMMARY], record, force)?;
        Ok(Self { folder: folder.map(Path::to_owned) })
    }

    /// Makes the folder.
    pub(super) fn make_folder(&self) -> Result<(), Failure> {
        self.folder.as_deref().map_or(Ok(()), make_folder)
    }

    /// Writes figure and summary and enters the figure's name into the summary.
    pub(super) fn write(&self, summary: &mut Summary, figure: &str) -> Result<(), Failure> {
        let Some(folder) = &self.folder else { return Ok(()) };
        let write = |name: &str, text: &str| {
            let path = folder.join(name);
            write_file(&path, text).map(|()| path)
        };
        summary.figure = Some(write(FIGURE, figure)?.display().to_string());
        let text = serde_json::to_string_pretty(&summary).unwrap_or_default();
        write(SUMMARY, &text)?;
        Ok(())
    }
}

/// Refuses to overwrite, unasked, the files `names` in `folder` or the file `other`.
pub(super) fn claim(
    folder: Option<&Path>,
    names: &[&str],
    other: Option<&Path>,
    force: bool,
) -> Result<(), Failure> {
    folder.map_or(Ok(()), refuse_file)?;
    let in_folder = folder.into_iter().flat_map(|folder| names.iter().map(|name| folder.join(name)));
    match in_folder.chain(other.map(Path::to_owned)).find(|path| path.exists()) {
        Some(path) if !force => Err(Failure::usage(format!(
            "{}: the file exists already\n\nhint: choose another name or folder, or overwrite it with --force",
            path.display()
        ))),
        _ => Ok(()),
    }
}

/// Refuses a file where a folder is needed.
pub(super) fn refuse_file(folder: &Path) -> Result<(), Failure> {
    if folder.exists() && !folder.is_dir() {
        return Err(Failure::usage(format!(
            "{}: this is a file, --out needs a folder\n\nhint: choose another name",
            folder.display()
        )));
    }
    Ok(())
}

/// Makes a folder, with those it lies in.
pub(super) fn make_folder(folder: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(folder).map_err(|error| {
        Failure::usage(format!(
            "{}: cannot make this folder: {error}\n\nhint: choose another with --out",
            folder.display()
        ))
    })
}

/// Writes a whole file, or leaves none.
pub(super) fn write_file(path: &Path, text: &str) -> Result<(), Failure> {
    let written = File::create(path).and_then(|mut file| {
        file.write_all(text.as_bytes()).inspect_err(|_| {
            // Half a file is worth nothing; one that will not go is no worse than one that could not be written.
            let _gone = std::fs::remove_file(path);
        })
    });
    written.map_err(|error| {
        Failure::new(
            FailureKind::Failed,
            format!("{}: cannot write it: {error}\n\nhint: check permissions and free space", path.display()),
        )
    })
}
