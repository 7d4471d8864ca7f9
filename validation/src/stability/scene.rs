//! What the program says of a scene before it runs.

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
