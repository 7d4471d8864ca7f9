//! Runs of one scene that differ in their seeds.

use std::path::{Path, PathBuf};

use dempm::trajectory::{Trajectory, TrajectoryError};
use toml::Table;

/// Runs of one scene with several seeds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Seeds {
    /// Class of the scene: the beginning of the file's name before its number.
    pub class: String,
    /// The files, the first of which names the scene.
    pub files: Vec<PathBuf>,
}

impl Seeds {
    fn of(mut files: Vec<PathBuf>) -> Self {
        // `heap-000.h5` comes before `heap-000-seed-2.h5`.
        files.sort_by_key(|path| (stem(path).len(), path.clone()));
        Self { class: class_of(&stem(&files[0])), files }
    }

    /// Name of the scene.
    pub fn name(&self) -> String {
        stem(&self.files[0])
    }
}

/// Groups trajectories by scene, in the order of their names. The text of a scene but for title and seed tells
/// which belong together.
///
/// # Errors
/// If a trajectory cannot be read.
pub fn group_by_scene(paths: &[PathBuf]) -> Result<Vec<Seeds>, TrajectoryError> {
    let mut groups: Vec<(Option<Table>, Vec<PathBuf>)> = Vec::new();
    for path in paths {
        let text = Trajectory::open(path)?.header().scene.clone();
        let scene = toml::from_str::<Table>(&text).ok().map(|mut scene| {
            scene.remove("seed");
            scene.remove("title");
            scene
        });
        match groups.iter_mut().find(|(other, _)| scene.is_some() && *other == scene) {
            Some((_, files)) => files.push(path.clone()),
            None => groups.push((scene, vec![path.clone()])),
        }
    }
    let seeds = groups.into_iter().map(|(_, files)| Seeds::of(files));
    Ok(seeds.collect())
}

/// Name of a run: that of its file.
pub(super) fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// `at-rest` of `at-rest-003`; a name without a number is its own class, and one that is a number is of class
/// `scene`.
fn class_of(name: &str) -> String {
    match name.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end_matches(['-', '_']) {
        "" => "scene".to_owned(),
        class => class.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_what_stands_before_the_number() {
        for (name, class) in
            [("at-rest-003", "at-rest"), ("000", "scene"), ("col2x2", "col2x"), ("heap", "heap")]
        {
            assert_eq!(class_of(name), class);
        }
    }

    #[test]
    fn the_first_seed_names_the_scene() {
        let files = ["heap-000-seed-10.h5", "heap-000-seed-2.h5", "heap-000.h5"].map(PathBuf::from);
        let seeds = Seeds::of(files.to_vec());
        assert_eq!((seeds.name().as_str(), seeds.class.as_str()), ("heap-000", "heap"));
        assert_eq!(stem(&seeds.files[2]), "heap-000-seed-10");
    }
}
