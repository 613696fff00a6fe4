//! Files that appear whole or not at all: written as `NAME.part`, renamed at
//! the end, and never over what is already there.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::mem;
use std::path::{Path, PathBuf};

use crate::diag::Diagnostic;
use crate::exit::{Failure, plain};

/// An output file on its way. Dropped before [`Output::finish`] it leaves its
/// `.part` behind when anything was written: what was recorded may be worth
/// saving (`bikebot log recover`). Where nothing was, nothing is left.
#[derive(Debug)]
pub struct Output {
    file: File,
    part: PathBuf,
    path: PathBuf,
    replace: bool,
    /// Whether nothing stands, or is to stand, under the `.part` name any more.
    is_settled: bool,
}

impl Output {
    /// Opens `path` for writing, under its `.part` name. Fails before any work
    /// is done where the result could not be put in place at the end.
    pub fn create(path: &Path, force: bool) -> Result<Self, Failure> {
        Self::create_as(path, ".part", force)
    }

    /// As [`Output::create`], with another ending for the name it has meanwhile: for
    /// what is made out of a `.part`.
    pub fn create_as(path: &Path, ending: &str, force: bool) -> Result<Self, Failure> {
        if path.is_dir() {
            return Err(Failure::io(
                Diagnostic::error(format!("cannot write {}: it is a folder", path.display()))
                    .help("name a file inside it"),
            ));
        }
        if !force && path.symlink_metadata().is_ok() {
            return Err(Failure::usage(
                Diagnostic::error(format!("{} already exists", path.display()))
                    .help("choose another name, or replace it with --force"),
            ));
        }
        if force && path.exists() && !path.is_file() {
            return Err(Failure::io(Diagnostic::error(format!(
                "cannot replace {}: it is not a regular file",
                path.display()
            ))));
        }
        let part = part_name(path, ending);
        match open(&part, force) {
            Ok(file) => Ok(Self {
                file,
                part,
                path: path.to_owned(),
                replace: force,
                is_settled: false,
            }),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                Err(Failure::usage(left_over(&part)))
            }
            Err(error) => Err(unwritable(path, &error)),
        }
    }

    /// Opens the first free name of `STEM.EXT`, `STEM.2.EXT`, `STEM.3.EXT`, … in
    /// `folder`. A name whose `.part` exists is taken too, so that two runs at
    /// once, or one after a crash, never write to the same file.
    pub fn numbered(folder: &Path, stem: &str, extension: &str) -> Result<Self, Failure> {
        for number in 1_u64.. {
            let name = match number {
                1 => format!("{stem}.{extension}"),
                n => format!("{stem}.{n}.{extension}"),
            };
            let path = folder.join(name);
            if path.symlink_metadata().is_ok() {
                continue;
            }
            let part = part_name(&path, ".part");
            match open(&part, false) {
                Ok(file) => {
                    return Ok(Self {
                        file,
                        part,
                        path,
                        replace: false,
                        is_settled: false,
                    });
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(unwritable(&path, &error)),
            }
        }
        unreachable!("some number below 2^64 is free")
    }

    /// The name it will have.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The name it has now.
    pub fn part(&self) -> &Path {
        &self.part
    }

    /// A second handle on the file, for a writer that owns what it writes to.
    pub fn handle(&self) -> Result<File, Failure> {
        self.file
            .try_clone()
            .map_err(|error| Failure::file("write", &self.path, &error))
    }

    /// Writes all of `bytes` and gives the file its name.
    pub fn write_all(mut self, bytes: &[u8]) -> Result<PathBuf, Failure> {
        if let Err(error) = self.file.write_all(bytes) {
            let failure = Failure::file("write", &self.path, &error);
            self.discard();
            return Err(failure);
        }
        self.finish()
    }

    /// Makes sure the bytes are on the disk and gives the file its name.
    pub fn finish(mut self) -> Result<PathBuf, Failure> {
        self.is_settled = true;
        let done = self.file.sync_all().and_then(|()| {
            if self.replace {
                fs::rename(&self.part, &self.path)
            } else {
                rename_new(&self.part, &self.path)
            }
        });
        match done {
            Ok(()) => Ok(mem::take(&mut self.path)),
            Err(error) => Err(Failure::io(
                Diagnostic::error(format!(
                    "cannot finish {}: {}",
                    self.path.display(),
                    plain(&error)
                ))
                .note(format!("what was written is in {}", self.part.display())),
            )),
        }
    }

    /// Removes what was begun.
    pub fn discard(mut self) {
        self.remove();
    }

    fn remove(&mut self) {
        self.is_settled = true;
        // Nothing more can be done about a file that cannot be removed.
        let _ = fs::remove_file(&self.part);
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        if !self.is_settled && self.file.metadata().is_ok_and(|facts| facts.len() == 0) {
            self.remove();
        }
    }
}

/// Makes `folder`, and those above it, where it is not there yet.
///
/// # Errors
///
/// [`Failure::Io`] when it cannot be made, as where a file has its name.
pub fn make_folder(folder: &Path) -> Result<(), Failure> {
    // A slash at the end would hide a file that bears the folder's name.
    let folder: PathBuf = folder.components().collect();
    // A file may bear that name, or that of a folder above.
    let is_other = |path: &&Path| path.exists() && !path.is_dir();
    if let Some(other) = folder.ancestors().find(is_other) {
        return Err(Failure::io(
            Diagnostic::error(format!(
                "cannot make the folder {}: {} is {}",
                folder.display(),
                other.display(),
                if other.is_file() {
                    "a file"
                } else {
                    "no folder"
                }
            ))
            .help("choose another folder"),
        ));
    }
    // A folder of no name is the one we are in.
    if folder.as_os_str().is_empty() {
        return Ok(());
    }
    fs::create_dir_all(&folder).map_err(|error| Failure::file("make the folder", &folder, &error))
}

/// Whether two names are of one file that is there.
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}

/// A file that cannot be made: mostly its folder is to blame.
fn unwritable(path: &Path, error: &io::Error) -> Failure {
    let folder = path
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    match folder {
        Some(folder) if error.kind() == io::ErrorKind::NotFound && !folder.exists() => Failure::io(
            Diagnostic::error(format!(
                "cannot write {}: there is no folder {}",
                path.display(),
                folder.display()
            ))
            .help("make it first, or choose another place"),
        ),
        _ => Failure::file("write", path, error),
    }
}

/// `NAME` + `ending` beside `path`.
fn part_name(path: &Path, ending: &str) -> PathBuf {
    let mut name: OsString = path.as_os_str().to_owned();
    name.push(ending);
    PathBuf::from(name)
}

fn open(part: &Path, replace: bool) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(true);
    if replace {
        options.create(true).truncate(true);
    } else {
        options.create_new(true);
    }
    options.open(part)
}

/// Renames without replacing: a hard link refuses an existing target, where
/// the file system knows links.
fn rename_new(from: &Path, to: &Path) -> io::Result<()> {
    match fs::hard_link(from, to) {
        Ok(()) => fs::remove_file(from),
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Err(error),
        Err(_) => fs::rename(from, to),
    }
}

fn left_over(part: &Path) -> Diagnostic {
    Diagnostic::error(format!("{} already exists", part.display()))
        .note("another run is writing it, or one was cut off")
        .help(format!(
            "`bikebot log recover {}` saves what a cut recording holds; --force replaces it",
            part.display()
        ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(result: Result<Output, Failure>) -> String {
        match result {
            Ok(_) => panic!("it was opened"),
            Err(failure) => failure
                .diagnostic()
                .map_or_else(String::new, |d| d.message().into()),
        }
    }

    #[test]
    fn nothing_has_the_final_name_before_the_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let output = Output::create(&path, false).unwrap();
        assert!(!path.exists() && output.part().exists());
        output.write_all(b"x\n").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"x\n");
        assert!(!part_name(&path, ".part").exists());
    }

    #[test]
    fn what_was_begun_is_left_and_what_was_not_is_gone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let part = part_name(&path, ".part");
        drop(Output::create(&path, false).unwrap());
        assert!(!part.exists());
        let output = Output::create(&path, false).unwrap();
        output.handle().unwrap().write_all(b"half").unwrap();
        drop(output);
        assert_eq!(fs::read(&part).unwrap(), b"half");
    }

    #[test]
    fn an_existing_file_needs_force() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        fs::write(&path, b"old").unwrap();
        assert!(message(Output::create(&path, false)).ends_with("a.csv already exists"));
        Output::create(&path, true)
            .unwrap()
            .write_all(b"new")
            .unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn a_file_that_appeared_meanwhile_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let output = Output::create(&path, false).unwrap();
        fs::write(&path, b"theirs").unwrap();
        assert!(output.write_all(b"ours").is_err());
        assert_eq!(fs::read(&path).unwrap(), b"theirs");
        assert_eq!(fs::read(part_name(&path, ".part")).unwrap(), b"ours");
    }

    #[test]
    fn a_part_left_by_a_crash_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        fs::write(part_name(&path, ".part"), b"half").unwrap();
        assert!(message(Output::create(&path, false)).ends_with("a.mcap.part already exists"));
        let next = Output::numbered(folder.path(), "a", "mcap").unwrap();
        assert_eq!(next.path(), folder.path().join("a.2.mcap"));
    }

    #[test]
    fn a_folder_is_made_unless_a_file_has_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let deep = folder.path().join("a/b");
        for _ in 0..2 {
            make_folder(&deep).unwrap();
            assert!(deep.is_dir());
        }
        make_folder(Path::new("")).unwrap();
        fs::write(folder.path().join("a/file"), b"").unwrap();
        for name in ["a/file", "a/file/below/it"] {
            let failure = make_folder(&folder.path().join(name)).unwrap_err();
            let message = failure.diagnostic().unwrap().message();
            assert!(message.ends_with("a/file is a file"), "{message}");
        }
    }

    #[test]
    fn names_are_numbered_on() {
        let folder = tempfile::tempdir().unwrap();
        for expected in ["fig7-1.mcap", "fig7-1.2.mcap", "fig7-1.3.mcap"] {
            let output = Output::numbered(folder.path(), "fig7-1", "mcap").unwrap();
            assert_eq!(output.path(), folder.path().join(expected));
            output.write_all(b"").unwrap();
        }
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("no/where.csv");
        assert!(message(Output::create(&path, false)).contains("there is no folder"));
    }
}
