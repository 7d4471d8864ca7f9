//! Errors and warnings of a scene before it runs.

use dempm::check::{Needs, Rates};
use dempm::scene::{Problem, Scene, SceneError};

use super::study::StudyError;

/// Name of the file in messages.
const NAME: &str = "scene.toml";

/// Errors of a scene, or else its warnings; `None` if there are neither.
pub fn said(text: &str) -> Option<String> {
    join(problems(text))
}

/// Errors and warnings of a scene, including those of `dempm check`; `None` if there are none.
pub fn checked(text: &str) -> Option<String> {
    join(doubts(text))
}

/// Errors and warnings of a scene, including those of `dempm check`.
pub fn doubts(text: &str) -> Vec<String> {
    let scene = Scene::parse(text, NAME);
    // The rate only enters the estimated duration.
    let doubts =
        scene.map_or(Vec::new(), |scene| Needs::of(&scene, &Rates::of_processor(1.0)).warnings);
    problems(text).into_iter().chain(doubts).collect()
}

fn problems(text: &str) -> Vec<String> {
    match Scene::parse(text, NAME) {
        Ok(scene) => messages(&scene.warnings),
        Err(SceneError::Invalid(problems)) => messages(&problems.problems),
        Err(other) => vec![other.to_string()],
    }
}

fn messages(problems: &[Problem]) -> Vec<String> {
    problems.iter().map(|problem| problem.message.clone()).collect()
}

fn join(texts: Vec<String>) -> Option<String> {
    (!texts.is_empty()).then(|| texts.join("; "))
}

/// A scene that has to be valid.
pub fn parse(name: &str, text: &str) -> Result<Scene, StudyError> {
    Scene::parse(text, name)
        .map_err(|_| StudyError::Scene { name: name.into(), reason: problems(text).join("; ") })
}

#[cfg(test)]
mod tests {
    use super::*;

    const COLUMN: &str = "duration = 2.0\n[domain]\nsize = [6.0, 2.0]\n[[column]]\n\
                          size = [1.0, 1.0]\n[material]\nkind = \"rve\"\n";

    #[test]
    fn silent_failures_that_studies_found_are_warned_of() {
        let said = |line: &str| said(&format!("{COLUMN}{line}\n")).unwrap_or_default();
        assert_eq!(said("[rve]\ndiscs = 400"), "");
        assert!(
            said("[grains]\nmass_scale = 30.0").contains("mass_scale = 30 makes flow stronger")
        );
        assert!(said("[rve]\nthin_width = 0.0").contains("lets packings lock"));
        assert!(said("[grains]\nlocal_damping = 0.2").contains("local_damping = 0.2"));
        let unstable = "step_factor = 0.5 may be unstable";
        assert!(said("[grains]\nstep_factor = 0.5\ndamping_ratio = 0.9").contains(unstable));
        assert!(said("[grains]\nstep_factor = 0.5\ndamping_ratio = 0.5").contains(unstable));
        assert!(said("[grains]\nstep_factor = 0.5\nradius_min = 5.0e-3").contains(unstable));
        assert_eq!(said("[grains]\nstep_factor = 0.5"), "");
        assert!(said("[grains]\nstep_factor = 0.6").contains("out of range"));
        assert!(said("[numerics]\ntransfer = \"pic\"").contains("stops all motion"));
        assert!(said("[numerics]\ntransfer = \"apic\"").contains("does not converge"));
        assert!(said("[numerics]\ntransfer = \"flip\"\nrelaxation = 100.0").contains("viscous"));
        assert_eq!(said("[numerics]\ntransfer = \"flip\""), "");
    }
}
