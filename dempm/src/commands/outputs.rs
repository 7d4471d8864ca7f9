//! Default names of output files.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The input's name with another ending, in the current directory. Only the last suffix is replaced:
/// `a/cell-0.125.toml` and `.h5` give `cell-0.125.h5`.
pub(super) fn default_output(input: &Path, ending: &str) -> PathBuf {
    let mut name: OsString = input.file_stem().unwrap_or_default().to_owned();
    name.push(ending);
    PathBuf::from(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_whose_names_differ_after_a_dot_have_files_of_their_own() {
        let default = |scene| default_output(Path::new(scene), ".h5");
        assert_eq!(default("a/column.toml"), Path::new("column.h5"));
        assert_eq!(default("cell-0.125.toml"), Path::new("cell-0.125.h5"));
    }
}
