//! Outputs that would replace what they are made from.

use std::path::Path;

use miette::bail;

/// Refuses an output that is one of the inputs.
///
/// # Errors
/// If it is, by whatever path.
pub fn refuse_input(
    output: &Path,
    inputs: impl IntoIterator<Item = impl AsRef<Path>>,
) -> miette::Result<()> {
    if inputs.into_iter().any(|input| is_same(output, input.as_ref())) {
        bail!(
            help = "give -o another name",
            "{}: is what is read, and would be replaced",
            output.display()
        );
    }
    Ok(())
}

/// Whether two paths are of one file, which is there.
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
