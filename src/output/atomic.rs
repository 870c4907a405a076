//! Files written whole or not at all.
//!
//! The bytes go to a temporary file in the target's own directory (a rename within one file
//! system is a single step), are forced to the disk and then renamed over the target. Whatever
//! fails on the way, the temporary file is removed and what stood at the target is unharmed.
//! Only a process killed outright can leave a file `.lumel-PID-N.tmp` behind.
//!
//! A target that exists and is no regular file (`/dev/null`, `/dev/stdout`, a pipe) has nothing
//! to lose and must not be replaced by a file: it is written to directly.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::{Error, Result};

/// Writes `bytes` to `target`, replacing what is there, in one step.
///
/// A symbolic link is followed: the file that it points to is replaced, not the link. The new
/// file keeps the permissions of the old one.
pub fn write_whole(target: &Path, bytes: &[u8]) -> Result<()> {
    replace(target, bytes).map_err(|e| unwritable(target, e))
}

/// Writes several files that belong together, the last one last.
///
/// All are written whole under temporary names first; only then are they put in their places, one
/// after the other. Whatever fails before that (a full disk, a directory that is gone) leaves all old
/// files as they were. `go_on` is asked once between the two: an error of its ends the writing.
pub fn write_together(
    files: &[(PathBuf, Vec<u8>)],
    go_on: impl FnOnce() -> Result<()>,
) -> Result<()> {
    let mut ready = vec![];
    for (target, bytes) in files {
        ready.push((target, prepare(target, bytes).map_err(|e| unwritable(target, e))?));
    }
    go_on()?;
    for (target, prepared) in ready {
        prepared.put_in_place().map_err(|e| unwritable(target, e))?;
    }
    Ok(())
}

/// Checks, before long work begins, that `target` can be written later.
///
/// Refused are: a directory, a file that is read-only, a directory that does not exist or takes
/// no new file, and any file of `inputs` (the same file under another name included), which
/// writing would destroy. The check makes and removes one empty temporary file.
pub fn check_writable(target: &Path, inputs: &[&Path]) -> Result<()> {
    if target.as_os_str().is_empty() {
        return Err(Error::Usage("the name of the output file is empty".into()));
    }
    if let Some(input) = inputs.iter().find(|input| same_file(target, input)) {
        return Err(unwritable(
            target,
            format!("it is also an input ({}); give the output another name", input.display()),
        ));
    }
    match fs::metadata(target) {
        Ok(found) if found.is_dir() => {
            return Err(unwritable(target, "it is a directory; name a file in it"));
        }
        Ok(found) if !found.is_file() => return Ok(()),
        Ok(found) if found.permissions().readonly() => {
            return Err(unwritable(target, "the file there is read-only"));
        }
        _ => {}
    }
    let place = resolved(target);
    let directory = directory_of(&place);
    if !directory.is_dir() {
        return Err(unwritable(
            target,
            format!("the directory {} does not exist; make it first", directory.display()),
        ));
    }
    Temporary::create(directory)
        .map(drop)
        .map_err(|e| unwritable(target, format!("no file can be made in its directory: {e}")))
}

/// Whether both paths lead to one file, which may not exist yet.
pub fn same_file(a: &Path, b: &Path) -> bool {
    #[cfg(unix)]
    if let (Ok(a), Ok(b)) = (fs::metadata(a), fs::metadata(b)) {
        use std::os::unix::fs::MetadataExt;
        return a.dev() == b.dev() && a.ino() == b.ino();
    }
    match (absolute(a), absolute(b)) {
        (Some(a), Some(b)) => a == b,
        _ => a == b,
    }
}

fn unwritable(target: &Path, reason: impl ToString) -> Error {
    Error::Unwritable { path: target.to_path_buf(), reason: reason.to_string() }
}

fn replace(target: &Path, bytes: &[u8]) -> io::Result<()> {
    prepare(target, bytes)?.put_in_place()
}

/// A file that is ready to be put in its place.
enum Prepared<'a> {
    /// Written under a temporary name.
    Temporary(Temporary, PathBuf),
    /// Written directly when its time comes.
    Special(File, &'a [u8]),
}

fn prepare<'a>(target: &Path, bytes: &'a [u8]) -> io::Result<Prepared<'a>> {
    let found = fs::metadata(target).ok();
    if found.as_ref().is_some_and(|found| !found.is_file() && !found.is_dir()) {
        return Ok(Prepared::Special(OpenOptions::new().write(true).open(target)?, bytes));
    }
    let place = resolved(target);
    let mut temporary = Temporary::create(directory_of(&place))?;
    temporary.file.write_all(bytes)?;
    if let Some(found) = found {
        temporary.file.set_permissions(found.permissions())?;
    }
    temporary.file.sync_all()?;
    Ok(Prepared::Temporary(temporary, place))
}

impl Prepared<'_> {
    fn put_in_place(self) -> io::Result<()> {
        let (temporary, place) = match self {
            Prepared::Special(mut special, bytes) => {
                special.write_all(bytes)?;
                return special.flush();
            }
            Prepared::Temporary(temporary, place) => (temporary, place),
        };
        temporary.rename(&place)?;
        // The data are safe; that the *name* survives a power cut too is worth a try, no more: not
        // every file system lets a directory be synchronised.
        if let Ok(directory) = File::open(directory_of(&place)) {
            let _ = directory.sync_all();
        }
        Ok(())
    }
}

/// The file that a chain of symbolic links leads to; the path itself where there is none.
fn resolved(target: &Path) -> PathBuf {
    fs::canonicalize(target).unwrap_or_else(|_| target.to_path_buf())
}

fn directory_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// An absolute name without links, of a file that need not exist in a directory that does.
fn absolute(path: &Path) -> Option<PathBuf> {
    fs::canonicalize(path).ok().or_else(|| {
        let directory = fs::canonicalize(directory_of(path)).ok()?;
        Some(directory.join(path.file_name()?))
    })
}

/// A file that removes itself unless it was renamed.
struct Temporary {
    path: PathBuf,
    file: File,
    renamed: bool,
}

impl Temporary {
    /// A new file in `directory` with a name of its own: process, then a running number. One
    /// left over by a killed process of the same number is stepped over, never reused.
    fn create(directory: &Path) -> io::Result<Temporary> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        loop {
            let number = NEXT.fetch_add(1, Ordering::Relaxed);
            let path = directory.join(format!(".lumel-{}-{number}.tmp", std::process::id()));
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(file) => return Ok(Temporary { path, file, renamed: false }),
                Err(e) if e.kind() == io::ErrorKind::AlreadyExists => continue,
                Err(e) => return Err(e),
            }
        }
    }

    fn rename(mut self, target: &Path) -> io::Result<()> {
        fs::rename(&self.path, target)?;
        self.renamed = true;
        Ok(())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if !self.renamed {
            let _ = fs::remove_file(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names_in(directory: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(directory)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn writes_and_replaces_and_leaves_nothing_else() {
        let room = tempfile::tempdir().unwrap();
        let target = room.path().join("a.csv");
        write_whole(&target, b"first").unwrap();
        write_whole(&target, b"second").unwrap();
        assert_eq!(fs::read(&target).unwrap(), b"second");
        assert_eq!(names_in(room.path()), ["a.csv"]);
    }

    #[test]
    fn a_failed_write_leaves_the_old_content_and_no_temporary_file() {
        let room = tempfile::tempdir().unwrap();
        let target = room.path().join("taken");
        fs::create_dir(&target).unwrap();
        fs::write(target.join("precious"), b"old").unwrap();
        // The bytes reach the temporary file; the rename over a directory then fails.
        let failure = write_whole(&target, b"new").unwrap_err();
        assert!(matches!(failure, Error::Unwritable { .. }), "{failure}");
        assert_eq!(fs::read(target.join("precious")).unwrap(), b"old");
        assert_eq!(names_in(room.path()), ["taken"]);
    }

    #[test]
    fn a_directory_that_is_missing_is_an_error_before_and_at_writing() {
        let room = tempfile::tempdir().unwrap();
        let target = room.path().join("no/such/file.png");
        let message = check_writable(&target, &[]).unwrap_err().to_string();
        assert!(message.contains("does not exist"), "{message}");
        assert!(write_whole(&target, b"x").is_err());
    }

    #[test]
    fn the_check_refuses_directories_inputs_and_read_only_files() {
        let room = tempfile::tempdir().unwrap();
        let input = room.path().join("scene.gltf");
        fs::write(&input, b"{}").unwrap();
        assert!(check_writable(room.path(), &[]).is_err());
        assert!(check_writable(&input, &[&input]).is_err());
        let roundabout = room.path().join("../").join(room.path().file_name().unwrap());
        assert!(check_writable(&roundabout.join("scene.gltf"), &[&input]).is_err());
        assert!(check_writable(&room.path().join("out.png"), &[&input]).is_ok());
        let mut permissions = fs::metadata(&input).unwrap().permissions();
        permissions.set_readonly(true);
        fs::set_permissions(&input, permissions).unwrap();
        assert!(check_writable(&input, &[]).unwrap_err().to_string().contains("read-only"));
        assert!(check_writable(Path::new(""), &[]).is_err());
        assert_eq!(names_in(room.path()), ["scene.gltf"], "the check leaves nothing behind");
    }

    #[test]
    fn files_that_belong_together_are_all_written_or_none() {
        let room = tempfile::tempdir().unwrap();
        let at = |name: &str| room.path().join(name);
        fs::write(at("a"), b"old").unwrap();
        let files = |second: &str| vec![(at("a"), b"new".to_vec()), (at(second), b"b".to_vec())];
        // The second has no directory to go to; then somebody interrupts.
        assert!(write_together(&files("no/b"), || Ok(())).is_err());
        assert!(write_together(&files("b"), || Err(Error::Interrupted)).is_err());
        assert_eq!(
            (fs::read(at("a")).unwrap(), names_in(room.path())),
            (b"old".into(), vec!["a".into()])
        );
        write_together(&files("b"), || Ok(())).unwrap();
        assert_eq!(fs::read(at("a")).unwrap(), b"new");
        assert_eq!(names_in(room.path()), ["a", "b"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_and_hard_links_known_as_one_file() {
        let room = tempfile::tempdir().unwrap();
        let (real, soft, hard) =
            (room.path().join("real"), room.path().join("soft"), room.path().join("hard"));
        fs::write(&real, b"old").unwrap();
        std::os::unix::fs::symlink(&real, &soft).unwrap();
        fs::hard_link(&real, &hard).unwrap();
        assert!(same_file(&real, &soft) && same_file(&real, &hard));
        write_whole(&soft, b"new").unwrap();
        assert!(fs::symlink_metadata(&soft).unwrap().file_type().is_symlink());
        assert_eq!(fs::read(&real).unwrap(), b"new");
    }

    #[cfg(unix)]
    #[test]
    fn a_device_is_written_to_and_not_replaced() {
        let null = Path::new("/dev/null");
        check_writable(null, &[]).unwrap();
        write_whole(null, b"gone").unwrap();
        assert!(!fs::metadata(null).unwrap().is_file());
    }

    #[cfg(unix)]
    #[test]
    fn permissions_of_the_old_file_are_kept() {
        use std::os::unix::fs::PermissionsExt;
        let room = tempfile::tempdir().unwrap();
        let target = room.path().join("shared");
        fs::write(&target, b"old").unwrap();
        fs::set_permissions(&target, fs::Permissions::from_mode(0o640)).unwrap();
        write_whole(&target, b"new").unwrap();
        assert_eq!(fs::metadata(&target).unwrap().permissions().mode() & 0o777, 0o640);
    }

    #[test]
    fn files_that_do_not_exist_yet_are_compared_by_place() {
        let room = tempfile::tempdir().unwrap();
        assert!(same_file(&room.path().join("x"), &room.path().join("./x")));
        assert!(!same_file(&room.path().join("x"), &room.path().join("y")));
    }
}
