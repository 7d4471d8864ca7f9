//! The scenes of the speed-accuracy charts and the settings that are tried on them.

use super::Family;
use crate::context::Suite;
use crate::scene::merged;

/// A scene, its reference and the settings that are tried on it.
pub struct Case {
    /// Name of the scene in the report.
    pub name: &'static str,
    /// What is simulated, in words.
    pub description: &'static str,
    /// Scene with the settings of the reference, which runs with two seeds.
    reference: String,
    /// Scene whose first frames networks start from: one of the settings, so that its packings are
    /// prepared.
    pub(super) start_of_networks: String,
    /// Names and scenes of the settings.
    pub(super) settings: Vec<(Family, String, String)>,
    /// Width and height of the column, m.
    pub(super) size: [f64; 2],
}

/// What the reference is computed with, in words, and the keys that say so.
const REFERENCE: (&str, &str) = (
    "400 discs, f32, step 0.1 ms, cells of 0.125 m",
    "rve.discs = 400\nmaterial.precision = \"f32\"\nstep = 1e-4\ndomain.cell = 0.125\noutput.fields = []",
);

/// Settings of the quick suite with packings: names, and keys that differ from the reference.
const QUICK: [(&str, &str); 9] = [
    ("200 discs", "rve.discs = 200"),
    ("100 discs", "rve.discs = 100"),
    ("50 discs", "rve.discs = 50"),
    ("100 discs + f64", "rve.discs = 100\nmaterial.precision = \"f64\""),
    ("100 discs + long substeps", "rve.discs = 100\nrve.step_factor = 0.4"),
    ("50 discs + long substeps", "rve.discs = 50\nrve.step_factor = 0.4"),
    ("100 discs + mass x 10", "rve.discs = 100\nrve.mass_scale = 10"),
    ("100 discs + mass x 100", "rve.discs = 100\nrve.mass_scale = 100"),
    ("100 discs + cells of 0.25 m", "rve.discs = 100\ndomain.cell = 0.25"),
];

/// The same of the full suite.
const FULL: [(&str, &str); 16] = [
    ("800 discs", "rve.discs = 800"),
    ("200 discs", "rve.discs = 200"),
    ("100 discs", "rve.discs = 100"),
    ("f64", "material.precision = \"f64\""),
    ("long substeps", "rve.step_factor = 0.4"),
    ("short substeps", "rve.step_factor = 0.1"),
    ("100 discs + long substeps", "rve.discs = 100\nrve.step_factor = 0.4"),
    ("mass x 10", "rve.mass_scale = 10"),
    ("mass x 100", "rve.mass_scale = 100"),
    ("100 discs + mass x 10", "rve.discs = 100\nrve.mass_scale = 10"),
    ("step 0.05 ms", "step = 5e-5"),
    ("step 0.2 ms", "step = 2e-4"),
    ("step 0.5 ms", "step = 5e-4"),
    ("cells of 0.25 m", "domain.cell = 0.25"),
    ("cells of 0.0625 m", "domain.cell = 0.0625"),
    ("100 discs + cells of 0.25 m", "rve.discs = 100\ndomain.cell = 0.25"),
];

/// Settings with the mu(I) law.
const CONTINUUM: [(&str, &str); 3] = [
    ("mu(I) + cells of 0.25 m", "material.kind = \"mu-i\"\ndomain.cell = 0.25"),
    ("mu(I) + cells of 0.125 m", "material.kind = \"mu-i\""),
    ("mu(I) + cells of 0.0625 m", "material.kind = \"mu-i\"\ndomain.cell = 0.0625"),
];

/// Seeds of the two references and of everything else: no setting shares its packings with a
/// reference.
const SEEDS: [u64; 3] = [1, 2, 3];

impl Case {
    /// The cases of a suite.
    pub fn of(suite: Suite) -> Vec<Self> {
        let mut cases = vec![Self::quick()];
        if suite == Suite::Full {
            cases.extend(Self::full());
        }
        cases
    }

    /// The small column: minutes on two cores.
    pub fn quick() -> Self {
        // Half of the collapse of the demo column: the whole would take twice as long.
        let scene = merged(include_str!("../../../scenes/column.toml"), "duration = 0.6");
        let description = "the first 0.6 s of the collapse of a column of 1 m x 1 m (256 points, \
                           `scenes/column.toml`)";
        Self::new("Column of 1 m", description, &scene, &QUICK, [1.0, 1.0])
    }

    /// Scenes of the paper.
    fn full() -> [Self; 2] {
        [
            Self::new(
                "Col2x2",
                "a column of 2 m x 2 m, 1024 points, 3 s",
                include_str!("../../../scenes/paper/test/col2x2.toml"),
                &FULL,
                [2.0, 2.0],
            ),
            Self::new(
                "Col5x3",
                "a column of 5 m x 3 m, 3840 points, 3 s",
                include_str!("../../../scenes/paper/test/col5x3.toml"),
                &FULL,
                [5.0, 3.0],
            ),
        ]
    }

    fn new(
        name: &'static str,
        description: &'static str,
        scene: &str,
        packings: &[(&str, &str)],
        size: [f64; 2],
    ) -> Self {
        let reference = merged(scene, REFERENCE.1);
        let other = merged(&reference, &seed(SEEDS[2]));
        let setting = |family| {
            let other = &other;
            move |(name, changes): &(&str, &str)| {
                (family, (*name).to_owned(), merged(other, changes))
            }
        };
        let packings = packings.iter().map(setting(Family::Packings));
        let settings = packings.chain(CONTINUUM.iter().map(setting(Family::Continuum))).collect();
        let start_of_networks = merged(&other, "rve.discs = 200");
        Self { name, description, reference, start_of_networks, settings, size }
    }

    /// What the reference is computed with, in words.
    pub fn reference_name(&self) -> &'static str {
        REFERENCE.0
    }

    /// The reference with its two seeds.
    pub(super) fn references(&self) -> [String; 2] {
        [SEEDS[0], SEEDS[1]].map(|number| merged(&self.reference, &seed(number)))
    }
}

fn seed(number: u64) -> String {
    format!("seed = {number}")
}

#[cfg(test)]
mod tests {
    use dempm::scene::Scene;

    use super::*;

    #[test]
    fn all_settings_are_valid_scenes_of_the_same_material() {
        for case in Case::of(Suite::Full) {
            for (_, name, scene) in &case.settings {
                let scene = Scene::parse(scene, name).unwrap_or_else(|e| panic!("{name}: {e:?}"));
                assert_eq!(scene.seed, SEEDS[2]);
                assert_eq!(scene.columns[0].place.size, case.size);
            }
        }
    }
}
