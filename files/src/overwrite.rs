//! Outputs that would replace their own input, or each other.

use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Component, Path, PathBuf, absolute};

use crate::atomic::link_target;

/// An output file that is one of the inputs.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("{}: the output would replace its own input", path.display())]
#[diagnostic(help("choose another name with -o"))]
pub struct ReplacesInput {
    /// The file that is both.
    pub path: PathBuf,
}

/// Two outputs that are one file.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("{} and {}: two outputs in one file", one.display(), other.display())]
#[diagnostic(help("give them different names"))]
pub struct SameOutput {
    /// The first output.
    pub one: PathBuf,
    /// The second.
    pub other: PathBuf,
}

/// Refuses two outputs of one command in the same file.
///
/// # Errors
/// If two of them are the same file, by whatever path.
pub fn refuse_same(outputs: &[&Path]) -> Result<(), SameOutput> {
    for (index, one) in outputs.iter().enumerate() {
        if let Some(other) = outputs[..index].iter().find(|other| is_same(one, other)) {
            return Err(SameOutput { one: other.to_path_buf(), other: one.to_path_buf() });
        }
    }
    Ok(())
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

/// Whether two paths lead to the same file or folder, which need not exist yet.
pub fn is_same(one: &Path, other: &Path) -> bool {
    let identity = |path: &Path| path.metadata().ok().map(|data| (data.dev(), data.ino()));
    match (identity(one), identity(other)) {
        (Some(one), Some(other)) => one == other,
        (None, None) => resolved(one).is_ok_and(|one| resolved(other).is_ok_and(|o| one == o)),
        _ => false,
    }
}

/// The one path of what may not exist: links are followed as far as there is something.
fn resolved(path: &Path) -> io::Result<PathBuf> {
    let target = absolute(link_target(path)?)?;
    let mut found = PathBuf::new();
    for part in target.components() {
        match part {
            Component::ParentDir => {
                found.pop();
            }
            Component::CurDir => {}
            part => found.push(part),
        }
        // A folder that is yet to be made has no links.
        found = found.canonicalize().unwrap_or(found);
    }
    Ok(found)
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
        let [soft, hard] = ["soft.toml", "hard.toml"].map(|name| folder.path().join(name));
        std::os::unix::fs::symlink("scene.toml", &soft).unwrap();
        std::fs::hard_link(&scene, &hard).unwrap();
        assert!(refuse_input(&soft, [&scene]).is_err() && refuse_input(&hard, [&scene]).is_err());
    }

    #[test]
    fn outputs_are_told_apart_before_they_exist() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("real")).unwrap();
        std::os::unix::fs::symlink("real", at("linked")).unwrap();
        std::os::unix::fs::symlink("real/new.csv", at("dangling.csv")).unwrap();
        let same = ["real/new.csv", "linked/new.csv", "real/../real/./new.csv", "dangling.csv"];
        for other in same {
            assert!(refuse_same(&[&at("a.csv"), &at(same[0]), &at(other)]).is_err(), "{other}");
        }
        assert!(is_same(&at("none/yet/../a.csv"), &at("none/a.csv")));
        assert!(refuse_same(&[&at("a.csv"), &at("real/a.csv"), &at("real/new.csv")]).is_ok());
    }
}
