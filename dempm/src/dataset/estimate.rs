//! What a data set of scenes with grains is expected to cost, if no grain comes to rest.

use super::case::Case;
use crate::check::WHOLE_SCENES_ON_GPU;
use crate::scene::Material;

/// Disc-steps per second of packings on a busy H200, and the least time of a step of a whole scene there (s):
/// docs/benchmarks.md, docs/notes/2026-11-23-discs-kernel.md.
const PACKINGS: f64 = 4.5e10;
const LEAST_STEP: f64 = 7.6e-6;
/// Motion of a column while it is prepared, in times of a free fall from its top: 36 000 steps at 1 m.
const PREPARATION: f64 = 1.0;
/// Standard gravity, under which columns are prepared (m/s²).
const GRAVITY: f64 = 9.81;

/// The expected cost of some cases.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Discs times steps, with the preparation of columns; of all packings in points.
    pub disc_steps: f64,
    /// Wall time on one H200 (s).
    pub gpu_seconds: f64,
}

impl Estimate {
    /// The cost of `cases`, `jobs` at a time. Continuum laws count nothing.
    pub fn of(cases: &[Case], jobs: usize) -> Self {
        let (mut disc_steps, mut busy, mut waiting) = (0.0, 0.0, 0.0);
        for case in cases {
            let cost = Cost::of(case);
            disc_steps += cost.disc_steps;
            busy += cost.disc_steps / cost.rate;
            waiting += cost.steps * LEAST_STEP;
        }
        Self { disc_steps, gpu_seconds: f64::max(busy, waiting / jobs as f64) }
    }
}

/// The cost of a case.
struct Cost {
    disc_steps: f64,
    /// Steps that wait for each other on a GPU.
    steps: f64,
    /// Disc-steps per second of a busy GPU.
    rate: f64,
}

impl Cost {
    fn of(case: &Case) -> Self {
        let (scene, discs) = (&case.scene, case.discs() as f64);
        let Some(grains) = scene.material.grains() else {
            return Self { disc_steps: 0.0, steps: 0.0, rate: PACKINGS };
        };
        let steps = (scene.steps() * grains.substeps(scene.step)) as f64;
        match scene.material {
            Material::Discs(_) => {
                let fall = (2.0 * scene.height() / GRAVITY).sqrt();
                let steps = steps + PREPARATION * fall / grains.preparation_step();
                Self { disc_steps: discs * steps, steps, rate: WHOLE_SCENES_ON_GPU }
            }
            _ => Self { disc_steps: discs * steps, steps: scene.steps() as f64, rate: PACKINGS },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Split;
    use crate::scene::Scene;

    fn case(size: f64) -> Case {
        let text = format!(
            "duration = 3.0\n[domain]\nsize = [10.0, 10.0]\n[[column]]\nsize = [{size}, {size}]\n\
             [material]\nkind = \"discs\"\n"
        );
        let scene = Scene::parse(&text, "scene").unwrap();
        Case::new(Split::Train, "a".to_owned(), scene, String::new())
    }

    /// Col3x3 as discs: 165 000 discs, 4 steps in 0.1 ms, measured at 2.9 s for 3 s with a prepared column. The column
    /// falls for 0.78 s in steps of half the length.
    #[test]
    fn a_column_of_three_metres_costs_what_was_measured() {
        let one = Estimate::of(&[case(3.0)], 1);
        assert!((2.9e10..3.2e10).contains(&one.disc_steps), "{one:?}");
        assert!((2.5..4.0).contains(&one.gpu_seconds), "{one:?}");
    }

    /// Small scenes wait for steps, and several at a time do so together.
    #[test]
    fn small_scenes_share_a_gpu() {
        let small: Vec<Case> = (0..4).map(|_| case(0.5)).collect();
        let [one, four] = [1, 4].map(|jobs| Estimate::of(&small, jobs).gpu_seconds);
        assert!((one / four - 4.0).abs() < 1e-9);
        // Large ones fill it alone.
        let large = [case(6.0), case(6.0)];
        assert_eq!(Estimate::of(&large, 1), Estimate::of(&large, 2));
    }
}
