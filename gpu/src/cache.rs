//! The folder for results that are kept between runs.

use std::path::PathBuf;

/// The cache: `DEMPM_CACHE_DIR`, else `dempm` in the user's cache directory (`XDG_CACHE_HOME`, else
/// `~/.cache`). `None` without a home directory.
pub fn cache_directory() -> Option<PathBuf> {
    let variable = |name| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    variable("DEMPM_CACHE_DIR")
        .or_else(|| Some(variable("XDG_CACHE_HOME")?.join("dempm")))
        .or_else(|| Some(variable("HOME")?.join(".cache").join("dempm")))
}
