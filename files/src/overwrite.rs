//! Outputs that would replace their own input.

use std::path::{Path, PathBuf};

/// An output file that is one of the inputs.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("{}: the output would replace its own input", path.display())]
#[diagnostic(help("choose another name with -o"))]
pub struct ReplacesInput {
    /// The file that is both.
    pub path: PathBuf,
}

/// Refuses an output that is one of the inputs.
///
/// # Errors
/// If `output` is the same file as an input, by whatever path.
pub fn refuse_input(
    output: &Path,
    inputs: impl IntoIterator<Item = impl AsRef<Path>>,
) -> Result<(), ReplacesInput> {
    match inputs.into_iter().any(|input| is_same(output, input.as_ref())) {
        true => Err(ReplacesInput { path: output.to_owned() }),
        false => Ok(()),
    }
}

/// Whether two paths lead to the same existing file.
pub fn is_same(one: &Path, other: &Path) -> bool {
    one.canonicalize().is_ok_and(|one| other.canonicalize().is_ok_and(|other| one == other))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_is_known_by_any_path() {
        let folder = tempfile::tempdir().unwrap();
        let [scene, other] = ["scene.toml", "other.h5"].map(|name| folder.path().join(name));
        std::fs::write(&scene, "").unwrap();
        let around = folder.path().join(".").join("scene.toml");
        assert!(refuse_input(&around, [&other, &scene]).is_err());
        assert!(refuse_input(&other, [&scene]).is_ok());
        std::fs::write(&other, "").unwrap();
        assert!(refuse_input(&other, [&scene]).is_ok());
    }
}
