//! What runs on a scene: the truth, the models and their settings.

use dem::Grains;
use dempm::scene::Scene;

use super::measured::{Family, Measured, Sweep};
use super::scenes::TruthScene;
use crate::scene_text::merged;
use crate::suite::Suite;

/// A scene and what is compared with its truth.
pub struct Case {
    /// The scene.
    pub scene: &'static TruthScene,
    /// The scene as discs, one text for each seed.
    pub(super) truth: Vec<String>,
    /// Models and settings.
    pub(super) settings: Vec<Setting>,
    /// Scenes whose first frames networks start from.
    pub(super) starts: Starts,
}

/// The scene as networks learnt it, whose point spacing they know.
pub(super) struct Starts {
    /// Of networks that learnt from packings: the settings of the paper.
    pub packings: String,
    /// Of networks that learnt from discs: another seed than those of the truth.
    pub discs: String,
}

/// A model with its settings.
pub(super) struct Setting {
    pub family: Family,
    pub name: String,
    /// Text of the scene.
    pub text: String,
}

/// Keys of all runs: frames that are common to all, and no fields that are not compared.
const COMMON: &str = "frame_interval = 0.02\noutput.fields = []";
/// The packings as the scene has them.
const DEFAULT: (&str, &str) = ("packings", "");
/// The continuum law with the scene's cells and with larger ones.
const MU_I: &str = "mu(I)";
const MU_I_COARSE: &str = "mu(I), twice the cell";
/// A scene of the paper, for its settings.
const PAPER: &str = include_str!("../../../../scenes/paper/test/col2x2.toml");
/// Grains of twice and four times the size. The thickness goes with it, and points become large enough
/// to average over.
const COARSER: [(&str, &str); 2] = [
    (
        "discs, 2 times as large",
        "grains.radius_min = 5e-3\ngrains.radius_max = 1e-2\ngrains.thickness = 1.5e-2",
    ),
    (
        "discs, 4 times as large",
        "grains.radius_min = 1e-2\ngrains.radius_max = 2e-2\ngrains.thickness = 3e-2\n\
         domain.cell = 0.25",
    ),
];

/// Seeds of the discs where the size of grains is varied.
const SEEDS_OF_GRAINS: u64 = 3;

/// Settings of packings whose speed and accuracy the quick suite compares.
const QUICK: [(&str, &str); 4] = [
    ("16 packings", "material.packings = 16"),
    ("36 discs", "rve.discs = 36"),
    ("cells of 62.5 mm", "domain.cell = 0.0625"),
    ("relaxation 500 1/s", "numerics.relaxation = 500"),
];

/// The same of the full suite: every default changed by itself, and what is cheaper.
const FULL: [(&str, &str); 19] = [
    ("16 packings", "material.packings = 16"),
    ("1 packing", "material.packings = 1"),
    ("100 discs", "rve.discs = 100"),
    ("36 discs", "rve.discs = 36"),
    ("rough ladder", "rve.preparation.rough_ladder = true"),
    ("one-dimensional ladder", "rve.preparation.lateral_strain = 0"),
    ("steps of 0.1 ms", "step = 1e-4"),
    ("DEM steps of half the length", "grains.step_factor = 0.201"),
    ("mass x 10", "grains.mass_scale = 10"),
    ("cells of 62.5 mm", "domain.cell = 0.0625"),
    ("cells of 62.5 mm, 100 discs", "domain.cell = 0.0625\nrve.discs = 100"),
    ("cells of 125 mm", "domain.cell = 0.125"),
    ("cells of 125 mm, 400 discs", "domain.cell = 0.125\nrve.discs = 400"),
    ("relaxation 500 1/s", "numerics.relaxation = 500"),
    ("FLIP", "numerics.transfer = \"flip\""),
    ("walls on nodes", "numerics.wall_contact = \"nodes\""),
    ("no density correction", "numerics.density_correction = 0"),
    ("shocks not widened", "numerics.shock_width = 0"),
    ("points on a square lattice", "domain.point_layout = \"square\""),
];

/// Scenes of the speed-accuracy charts; of the last, the largest, only a few settings.
const SPEED: [&str; 4] = ["Small column", "Column a = 1", "Col2x2", "Col3x3"];
/// Settings for it.
const ON_THE_LARGEST: [&str; 5] = [
    "16 packings",
    "steps of 0.1 ms",
    "cells of 62.5 mm",
    "cells of 62.5 mm, 100 discs",
    "cells of 125 mm",
];

impl Case {
    /// All scenes of a suite, with every model in its defaults.
    pub fn against_truth(suite: Suite) -> Vec<Self> {
        TruthScene::of(suite).iter().map(|scene| Self::new(scene, suite)).collect()
    }

    /// The scenes of the speed-accuracy charts, with many settings.
    pub fn of_speed(suite: Suite) -> Vec<Self> {
        let scenes = TruthScene::of(suite).iter().filter(|scene| SPEED.contains(&scene.name));
        scenes
            .map(|scene| {
                let mut case = Self::new(scene, suite);
                let few = scene.name == SPEED[SPEED.len() - 1];
                let packings: &[(&str, &str)] = suite.pick(&QUICK, &FULL);
                for setting in packings {
                    if !few || ON_THE_LARGEST.contains(&setting.0) {
                        case.add(Family::Packings, setting);
                    }
                }
                let coarse =
                    ("mu(I), cells of 0.125 m", "material.kind = \"mu-i\"\ndomain.cell = 0.125");
                case.add(Family::Continuum, &coarse);
                case
            })
            .collect()
    }

    /// The models whose accuracy `dempm check` states, with material and cell (m).
    pub fn defaults<'s>(&self, sweep: &'s Sweep) -> Vec<(&'static str, f64, &'s Measured)> {
        let cell = cell(self.scene);
        let models =
            [("rve", DEFAULT.0, cell), ("mu-i", MU_I, cell), ("mu-i", MU_I_COARSE, 2.0 * cell)];
        let found = |name: &str| sweep.measured.iter().find(|m| m.name == name);
        models
            .into_iter()
            .filter_map(|(material, name, cell)| Some((material, cell, found(name)?)))
            .collect()
    }

    /// A scene with every model in its defaults.
    pub fn new(scene: &'static TruthScene, suite: Suite) -> Self {
        let truth = seeds(&merged(scene.text, COMMON), suite.pick(4, 8));
        let starts = Starts::of(scene, truth.len());
        let mut case = Self { scene, truth, settings: Vec::new(), starts };
        case.add(Family::Packings, &DEFAULT);
        if let Some(published) = scene.published {
            let name = "packings, settings of the paper".to_owned();
            let text = merged(published, COMMON);
            case.settings.push(Setting { family: Family::Packings, name, text });
        }
        case.add(Family::Continuum, &(MU_I, "material.kind = \"mu-i\""));
        let twice = format!("material.kind = \"mu-i\"\ndomain.cell = {:?}", 2.0 * cell(scene));
        case.add(Family::Continuum, &(MU_I_COARSE, &twice));
        for (name, keys) in &COARSER[..suite.pick(1, 2)] {
            case.add(Family::CoarserDiscs, &(name, &format!("material.kind = \"discs\"\n{keys}")));
        }
        case
    }

    /// A scene with grains of `size` times their size, as a few seeds of discs, as packings and under the
    /// continuum law. The thickness remains: overlaps under the same weight are the same share of a radius.
    pub fn of_grains(scene: &'static TruthScene, size: f64) -> Self {
        let grains = Grains::default();
        let [min, max] = [grains.radius_min, grains.radius_max].map(|radius| size * radius);
        let keys = format!("grains.radius_min = {min:?}\ngrains.radius_max = {max:?}");
        let text = merged(&merged(scene.text, COMMON), &keys);
        let with = |keys: &str| merged(&text, keys);
        let setting = |family, name: &str, text| Setting { family, name: name.to_owned(), text };
        Self {
            scene,
            truth: seeds(&text, SEEDS_OF_GRAINS),
            settings: vec![
                setting(Family::Packings, DEFAULT.0, text.clone()),
                setting(Family::Continuum, MU_I, with("material.kind = \"mu-i\"")),
            ],
            starts: Starts::of(scene, SEEDS_OF_GRAINS as usize),
        }
    }

    fn add(&mut self, family: Family, (name, changes): &(&str, &str)) {
        let text = merged(&merged(self.scene.text, COMMON), changes);
        self.settings.push(Setting { family, name: (*name).to_owned(), text });
    }
}

/// A scene as discs, one text for each seed.
fn seeds(text: &str, count: u64) -> Vec<String> {
    (1..=count)
        .map(|number| merged(text, &format!("seed = {number}\nmaterial.kind = \"discs\"")))
        .collect()
}

impl Starts {
    /// Of a scene with so many seeds of the truth.
    fn of(scene: &TruthScene, seeds: usize) -> Self {
        let published = scene.published.map_or_else(|| merged(PAPER, scene.text), str::to_owned);
        let packings = merged(&published, "output.fields = []");
        let keys = format!(
            "seed = {}\nframe_interval = 0.01\nmaterial.kind = \"discs\"\ndomain.cell = 0.125\noutput.fields = []",
            seeds + 1
        );
        Self { packings, discs: merged(scene.text, &keys) }
    }
}

/// The cell of the scene's grid, m.
fn cell(scene: &TruthScene) -> f64 {
    Scene::parse(scene.text, scene.name).map_or(f64::NAN, |scene| scene.domain.cell)
}

#[cfg(test)]
mod tests {
    use dempm::scene::Material;

    use super::*;

    #[test]
    fn what_the_largest_scene_tries_is_among_the_settings() {
        let known = |name: &&str| FULL.iter().any(|(setting, _)| setting == name);
        assert!(ON_THE_LARGEST.iter().all(known));
        let known = |name: &&str| TruthScene::of(Suite::Full).iter().any(|s| s.name == *name);
        assert!(SPEED.iter().all(known));
    }

    #[test]
    fn all_runs_are_valid_scenes_of_the_same_material() {
        for suite in [Suite::Quick, Suite::Full] {
            for case in Case::against_truth(suite).into_iter().chain(Case::of_speed(suite)) {
                let texts = case.settings.iter().map(|setting| &setting.text);
                let starts = [&case.starts.packings, &case.starts.discs];
                for text in texts.chain(&case.truth).chain(starts) {
                    let scene = Scene::parse(text, case.scene.name);
                    let scene = scene.unwrap_or_else(|e| panic!("{}: {e:?}", case.scene.name));
                    assert_eq!(scene.columns[0].place.size, case.scene.size);
                }
                let names: std::collections::HashSet<&str> =
                    case.settings.iter().map(|setting| setting.name.as_str()).collect();
                assert_eq!(names.len(), case.settings.len());
            }
        }
    }

    #[test]
    fn smaller_grains_take_proportionally_smaller_steps() {
        let scene = TruthScene::named("Column a = 1");
        let steps = |size: f64| -> Vec<f64> {
            let case = Case::of_grains(scene, size);
            let texts = case.truth.iter().chain(case.settings.iter().map(|setting| &setting.text));
            texts
                .filter_map(|text| match Scene::parse(text, scene.name).unwrap().material {
                    Material::Discs(discs) => Some(discs.grains.step()),
                    Material::Rve(rve) => Some(rve.parameters.grains.step()),
                    Material::MuI(_) | Material::Elastic(_) => None,
                })
                .collect()
        };
        let (half, whole) = (steps(0.5), steps(1.0));
        assert_eq!(half.len(), 4);
        assert!(half.iter().zip(&whole).all(|(half, whole)| (half / whole - 0.5).abs() < 1e-12));
    }
}
