//! A file replaced atomically: a temporary file in the same folder, to the disk, then renamed.
//!
//! A crash at any instant leaves the old file or the new one, and at worst a temporary `.daymark.*.tmp` beside it.

use super::TableFileError;
use std::fs::{self, File, OpenOptions};
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Replaces the file at `path` by one that holds `bytes`, or makes it. Whatever happens, the file has its old content
/// or the new. A symbolic link is followed, and permissions are kept.
///
/// # Errors
///
/// [`TableFileError::Write`], [`TableFileError::NotAFile`] or [`TableFileError::Unconfirmed`].
pub fn replace_file(path: &Path, bytes: &[u8]) -> Result<(), TableFileError> {
    replace_with(path, |file| file.write_all(bytes))
}

fn replace_with(path: &Path, fill: impl FnOnce(&mut File) -> io::Result<()>) -> Result<(), TableFileError> {
    // Renaming would replace a device or a pipe as readily as a file.
    if path.exists() && !path.is_file() {
        return Err(TableFileError::NotAFile(path.to_owned()));
    }
    let (folder, target) =
        replace_in_folder(path, fill).map_err(|error| TableFileError::Write(path.to_owned(), error))?;
    match File::open(folder).and_then(|folder| folder.sync_all()) {
        // Some file systems, network shares among them, cannot sync a folder: there is nothing more to be done.
        Err(error) if !matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => {
            Err(TableFileError::Unconfirmed(target, error))
        }
        _ => Ok(()),
    }
}

/// Everything up to the renaming; returns the folder and the file that was replaced in it.
fn replace_in_folder(path: &Path, fill: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<(PathBuf, PathBuf)> {
    let target = if path.is_symlink() { fs::canonicalize(path)? } else { path.to_owned() };
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let (mut file, temporary) = Temporary::create(folder)?;
    fill(&mut file)?;
    if let Ok(old) = fs::metadata(&target) {
        file.set_permissions(old.permissions())?;
    }
    file.sync_all()?;
    temporary.rename_to(&target)?;
    Ok((folder.to_owned(), target))
}

/// A temporary file's name; dropping it removes the file, unless it was renamed.
struct Temporary(Option<PathBuf>);

impl Temporary {
    /// Makes a new file in `folder` under a name that nobody else has.
    fn create(folder: &Path) -> io::Result<(File, Self)> {
        for _ in 0..16 {
            // std's hash maps have random keys; that is random enough for a name that must be new anyway.
            let random = RandomState::new().build_hasher().finish();
            let path = folder.join(format!(".daymark.{random:016x}.tmp"));
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(file) => return Ok((file, Self(Some(path)))),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        Err(ErrorKind::AlreadyExists.into())
    }

    fn rename_to(mut self, target: &Path) -> io::Result<()> {
        let Some(path) = self.0.take() else { return Ok(()) };
        fs::rename(&path, target).inspect_err(|_| self.0 = Some(path))
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if let Some(path) = &self.0 {
            // The error that led here is the one to report.
            let _ = fs::remove_file(path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::{PermissionsExt, symlink};
    use std::os::unix::net::UnixListener;

    /// The names in `folder`: nothing temporary may stay.
    fn names(folder: &Path) -> Vec<String> {
        let name = |entry: io::Result<fs::DirEntry>| entry.expect("an entry").file_name().into_string().expect("UTF-8");
        let mut names: Vec<_> = fs::read_dir(folder).expect("a folder").map(name).collect();
        names.sort();
        names
    }

    #[test]
    fn saving_replaces_the_table_and_keeps_permissions_and_links() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("town.daymark");
        replace_file(&path, b"old").expect("saved");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).expect("permissions");
        let link = folder.path().join("link");
        symlink("town.daymark", &link).expect("a link");
        replace_file(&link, b"new").expect("saved");
        assert_eq!(fs::read(&path).expect("a file"), b"new");
        assert!(link.is_symlink());
        assert_eq!(fs::metadata(&path).expect("a file").permissions().mode() & 0o777, 0o640);
        assert_eq!(names(folder.path()), ["link", "town.daymark"]);
    }

    #[test]
    fn a_full_disk_leaves_the_old_table_and_nothing_else() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("town.daymark");
        replace_file(&path, b"old").expect("saved");
        let result = replace_with(&path, |file| {
            file.write_all(b"half a table")?;
            Err(ErrorKind::StorageFull.into())
        });
        let said = result.expect_err("full").to_string();
        assert!(said.contains("make room on the disk. A table that was there is unchanged"), "{said}");
        assert_eq!(fs::read(&path).expect("a file"), b"old");
        assert_eq!(names(folder.path()), ["town.daymark"]);
    }

    #[test]
    fn a_folder_that_cannot_be_written_to_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let missing = folder.path().join("missing").join("town.daymark");
        let said = replace_file(&missing, b"new").expect_err("no folder").to_string();
        assert!(said.starts_with(&format!("cannot write {}: ", missing.display())), "{said}");
        assert!(said.contains("make the folder first"), "{said}");

        let said = TableFileError::Write(missing, ErrorKind::PermissionDenied.into()).to_string();
        assert!(said.contains("the folder must be writable"), "{said}");
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o555)).expect("permissions");
        let result = replace_file(&folder.path().join("town.daymark"), b"new");
        // The superuser may write everywhere.
        if let Err(error) = result {
            assert!(error.to_string().contains("the folder must be writable"), "{error}");
            assert!(names(folder.path()).is_empty());
        }
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(0o755)).expect("permissions");
    }

    #[test]
    fn a_folder_or_a_socket_in_the_way_stays() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("town.daymark");
        fs::create_dir(&path).expect("a folder");
        let error = replace_file(&path, b"new").expect_err("a folder is there");
        assert!(matches!(error, TableFileError::NotAFile(_)), "{error}");
        // Also if it comes after the first look: the renaming fails, and what was written goes.
        assert!(replace_in_folder(&path, |file| file.write_all(b"table")).is_err());
        let socket = folder.path().join("socket");
        let _listener = UnixListener::bind(&socket).expect("a socket");
        assert!(matches!(replace_file(&socket, b"new"), Err(TableFileError::NotAFile(_))));
        assert_eq!(names(folder.path()), ["socket", "town.daymark"]);
    }
}
