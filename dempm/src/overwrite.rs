//! Outputs that would replace what they are made from.

use std::path::Path;

use miette::bail;

/// Refuses an output that is one of the inputs.
///
/// # Errors
/// If it is, by whatever path.
pub fn refuse_input(output: &Path, inputs: &[&Path]) -> miette::Result<()> {
    let Ok(target) = output.canonicalize() else { return Ok(()) };
    if inputs.iter().any(|input| input.canonicalize().is_ok_and(|input| input == target)) {
        bail!(
            help = "give -o another name",
            "{}: is what is read, and would be replaced",
            output.display()
        );
    }
    Ok(())
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
        assert!(refuse_input(&around, &[&other, &scene]).is_err());
        assert!(refuse_input(&other, &[&scene]).is_ok());
        std::fs::write(&other, "").unwrap();
        assert!(refuse_input(&other, &[&scene]).is_ok());
    }
}
