//! The scenes of a data set.

use std::path::Path;

use super::case::Case;
use super::error::DatasetError;
use super::list;
use super::paper;
use super::report::Row;
use super::selection::Selection;
use super::split::{DataSet, Split};
use crate::scene::Scene;

/// The scenes of the paper (`paper`) or of a list file.
///
/// # Errors
/// If the list cannot be read or a scene is invalid.
pub fn cases(scenes: &Path) -> Result<Vec<Case>, DatasetError> {
    if scenes != Path::new("paper") {
        return list::read(scenes);
    }
    paper::SCENES
        .iter()
        .map(|&(split, name, text)| {
            let scene = Scene::parse(text, &format!("paper/{}/{name}.toml", split.name()))?;
            Ok(Case::new(split, name.to_owned(), scene, String::new()))
        })
        .collect()
}

/// The cases in any of the selections; all if there are none.
///
/// # Errors
/// If a selection holds no case of `scenes`.
pub fn select(
    cases: &[Case],
    only: &[Selection],
    scenes: &Path,
) -> Result<Vec<Case>, DatasetError> {
    if let Some(empty) = only.iter().find(|only| !cases.iter().any(|case| only.has(case))) {
        let (path, selection) = (scenes.to_owned(), empty.to_string());
        return Err(DatasetError::NoScene { path, selection });
    }
    let is_selected = |case: &Case| only.is_empty() || only.iter().any(|only| only.has(case));
    Ok(cases.iter().filter(|case| is_selected(case)).cloned().collect())
}

/// Refuses training scenes with different frame intervals before any of them is run.
///
/// # Errors
/// If two training cases of `scenes` differ in `frame_interval`.
pub fn check_intervals(cases: &[Case], scenes: &Path) -> Result<(), DatasetError> {
    let mut train = cases.iter().filter(|case| case.split == Split::Train);
    let Some(first) = train.next() else { return Ok(()) };
    match train.find(|case| case.scene.frame_interval != first.scene.frame_interval) {
        None => Ok(()),
        Some(other) => Err(DatasetError::Intervals {
            path: scenes.to_owned(),
            one: first.name.clone(),
            other: other.name.clone(),
            values: (first.scene.frame_interval, other.scene.frame_interval),
        }),
    }
}

/// Refuses a folder that has trajectories of the cases already, finished or not.
///
/// # Errors
/// With the first of them.
pub fn refuse_existing(cases: &[Case], folder: &Path) -> Result<(), DatasetError> {
    let existing = cases.iter().map(|case| case.file(folder)).find(|path| path.exists());
    existing.map_or(Ok(()), |path| Err(DatasetError::Exists { path }))
}

/// The finished trajectories in `folder`; `rows` are those of `cases`.
pub fn finished(cases: &[Case], rows: &[Row], folder: &Path) -> DataSet {
    let files = |split| {
        let of_split = cases.iter().zip(rows).filter(|(case, _)| case.split == split);
        of_split.filter(|(_, row)| row.is_finished()).map(|(case, _)| case.file(folder)).collect()
    };
    DataSet { splits: Split::ALL.map(|split| (split, files(split))).into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splits_and_scenes_are_selected_by_name() {
        let (all, paper) = (cases(Path::new("paper")).unwrap(), Path::new("paper"));
        let count = |only: &[&str]| {
            let only: Vec<Selection> = only.iter().map(|only| only.parse().unwrap()).collect();
            select(&all, &only, paper).map(|cases| cases.len())
        };
        assert_eq!(count(&[]).unwrap(), 39);
        assert_eq!(count(&["test"]).unwrap(), 9);
        // The collapses of Table 7.
        assert_eq!(count(&["test/col*"]).unwrap(), 8);
        assert_eq!(count(&["valid", "test/col2x2"]).unwrap(), 6);
        let unknown = count(&["test/col9*"]).unwrap_err().to_string();
        assert_eq!(unknown, "paper: no scene test/col9*");
        assert!("tests".parse::<Selection>().unwrap_err().contains("train, valid, test"));
    }

    #[test]
    fn the_scenes_of_the_paper_are_valid_without_their_files() {
        let cases = cases(Path::new("paper")).unwrap();
        assert_eq!(cases.len(), 39);
        let penetration = cases.last().unwrap();
        // 90 000 steps of 5120 points.
        assert_eq!(penetration.work(), 460_800_000);
        assert_eq!(penetration.file(Path::new("d")), Path::new("d/test/penetration.h5"));
    }
}
