//! What the program says of a scene before it runs.

use dempm::check::Needs;
use dempm::scene::{Scene, SceneError};

use super::study::StudyError;

/// Errors of a scene file, or else its warnings; `None` if there are neither.
pub fn said(text: &str) -> Option<String> {
    let text = format!("title = \"Stability\"\n{text}");
    match Scene::parse(&text, "scene.toml") {
        Ok(scene) => join(&scene.warnings),
        Err(SceneError::Invalid(problems)) => join(&problems.problems),
        Err(other) => Some(other.to_string()),
    }
}

fn join(problems: &[dempm::scene::Problem]) -> Option<String> {
    let texts: Vec<String> = problems.iter().map(|p| p.message.clone()).collect();
    (!texts.is_empty()).then(|| texts.join("; "))
}

/// A scene that has to be valid.
pub fn parse(name: &str, text: &str) -> Result<Scene, StudyError> {
    Scene::parse(text, name).map_err(|e| {
        let reason = match &e {
            SceneError::Invalid(problems) => join(&problems.problems).unwrap_or_default(),
            other => other.to_string(),
        };
        StudyError::Scene { name: name.into(), reason }
    })
}

/// Errors, warnings, and what `dempm check` doubts.
pub fn checked(text: &str) -> Option<String> {
    let scene = Scene::parse(text, "scene.toml");
    // The rate only enters the estimated duration.
    let doubts = scene.map_or(Vec::new(), |scene| Needs::of(&scene, 1.0).warnings);
    let all: Vec<String> = said(text).into_iter().chain(doubts).collect();
    (!all.is_empty()).then(|| all.join("; "))
}
