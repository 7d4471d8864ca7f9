//! What the targets share.

use std::path::Path;

/// Calls `read` with a file that holds these bytes.
///
/// # Panics
/// If the file cannot be written.
pub fn with_file<T>(bytes: &[u8], name: &str, read: impl FnOnce(&Path) -> T) -> T {
    let folder = Path::new("/dev/shm");
    let folder = if folder.exists() { tempfile::tempdir_in(folder) } else { tempfile::tempdir() };
    let folder = folder.expect("a temporary folder");
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("a temporary file");
    read(&path)
}
