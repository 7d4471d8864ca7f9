//! The scenes of the speed-accuracy charts and the settings that are compared on them.

use super::measured::Family;
use crate::scene_text::merged;
use crate::suite::Suite;

/// A scene, its reference and the settings that are compared with it.
pub struct Case {
    /// Name of the scene in the report.
    pub name: &'static str,
    /// What is simulated, in words.
    pub description: &'static str,
    /// Name of the reference among the settings.
    pub reference_name: &'static str,
    /// Settings of the reference, in words.
    pub reference_words: &'static str,
    /// Scene with the settings of the reference, which runs with two seeds.
    reference: String,
    /// Scene whose first frames networks start from. It is one of the settings, so that its packings
    /// are prepared.
    pub(super) start_of_networks: String,
    /// Names and scenes of the settings.
    pub(super) settings: Vec<(Family, String, String)>,
    /// Width and height of the column, m.
    pub size: [f64; 2],
}

/// Settings of a suite with packings.
struct Settings {
    /// Name of the reference, its settings in words, and their keys.
    reference: [&'static str; 3],
    /// Discs in a packing unless a setting changes it.
    discs: i64,
    /// Names, and the keys that differ from the reference with these discs.
    packings: &'static [(&'static str, &'static str)],
}

const QUICK: Settings = Settings {
    reference: [
        "400 discs (reference)",
        "400 discs, f32, step 0.1 ms, cells of 0.125 m",
        "rve.discs = 400",
    ],
    discs: 100,
    packings: &[
        ("200 discs", "rve.discs = 200"),
        ("100 discs", ""),
        ("50 discs", "rve.discs = 50"),
        ("100 discs + f64", "material.precision = \"f64\""),
        ("100 discs + long substeps", "grains.step_factor = 0.401"),
        ("50 discs + long substeps", "rve.discs = 50\ngrains.step_factor = 0.401"),
        ("100 discs + mass x 10", "grains.mass_scale = 10"),
        ("100 discs + mass x 100", "grains.mass_scale = 100"),
        ("100 discs + cells of 0.25 m", "domain.cell = 0.25"),
    ],
};

/// With twice as many discs in the reference as in any setting. Long substeps are those of
/// `scenes/paper`: 4 of 2.5e-5 s in a step, where the default makes 8 and short ones 16.
const FULL: Settings = Settings {
    reference: [
        "800 discs (reference)",
        "800 discs, f32, step 0.1 ms, cells of 0.125 m",
        "rve.discs = 800",
    ],
    discs: 400,
    packings: &[
        ("400 discs", ""),
        ("200 discs", "rve.discs = 200"),
        ("100 discs", "rve.discs = 100"),
        ("50 discs", "rve.discs = 50"),
        ("400 discs, 8 packings", "material.packings = 8"),
        ("400 discs + f64", "material.precision = \"f64\""),
        ("400 discs + short substeps", "grains.step_factor = 0.1"),
        ("400 discs + long substeps", "grains.step_factor = 0.401"),
        ("100 discs + long substeps", "rve.discs = 100\ngrains.step_factor = 0.401"),
        ("50 discs + long substeps", "rve.discs = 50\ngrains.step_factor = 0.401"),
        ("400 discs + mass x 10", "grains.mass_scale = 10"),
        ("400 discs + mass x 100", "grains.mass_scale = 100"),
        ("100 discs + mass x 10", "rve.discs = 100\ngrains.mass_scale = 10"),
        ("400 discs + step 0.05 ms", "step = 5e-5"),
        ("400 discs + step 0.2 ms", "step = 2e-4"),
        ("400 discs + step 0.5 ms", "step = 5e-4"),
        ("400 discs + cells of 0.25 m", "domain.cell = 0.25"),
        ("400 discs + cells of 0.0625 m", "domain.cell = 0.0625"),
        ("100 discs + cells of 0.25 m", "rve.discs = 100\ndomain.cell = 0.25"),
    ],
};

/// Settings of the full suite for Col2x2.
const ON_COL2X2: [&str; 12] = [
    "400 discs",
    "200 discs",
    "100 discs",
    "50 discs",
    "400 discs + f64",
    "400 discs + long substeps",
    "50 discs + long substeps",
    "400 discs + mass x 10",
    "400 discs + step 0.5 ms",
    "400 discs + cells of 0.25 m",
    "400 discs + cells of 0.0625 m",
    "100 discs + cells of 0.25 m",
];

/// Settings of the full suite for Col5x3.
const ON_COL5X3: [&str; 6] = [
    "400 discs",
    "200 discs",
    "100 discs",
    "50 discs + long substeps",
    "400 discs + cells of 0.25 m",
    "100 discs + cells of 0.25 m",
];

/// Settings with the mu(I) law.
const CONTINUUM: [(&str, &str); 3] = [
    ("mu(I) + cells of 0.25 m", "material.kind = \"mu-i\"\ndomain.cell = 0.25"),
    ("mu(I) + cells of 0.125 m", "material.kind = \"mu-i\""),
    ("mu(I) + cells of 0.0625 m", "material.kind = \"mu-i\"\ndomain.cell = 0.0625"),
];

/// Keys of all settings unless they change them.
const COMMON: &str = "material.precision = \"f32\"\nstep = 1e-4\ndomain.cell = 0.125\n\
                      grains.step_factor = 0.2\noutput.fields = []";

/// Seeds of the two references and of everything else: no setting shares its packings with a
/// reference.
const SEEDS: [u64; 3] = [1, 2, 3];

impl Case {
    /// The cases of a suite.
    pub fn of(suite: Suite) -> Vec<Self> {
        let column = include_str!("../../../../scenes/column.toml");
        if suite == Suite::Quick {
            // Half of the collapse of the demo column: the whole would take twice as long.
            let scene = merged(column, "duration = 0.5");
            let description = "the first 0.5 s of the collapse of a column of 1 m x 1 m (256 \
                               points, `scenes/column.toml`)";
            return vec![Self::new("Column of 1 m", description, &scene, &QUICK, [1.0, 1.0])];
        }
        vec![
            Self::new(
                "Column of 1 m",
                "a column of 1 m x 1 m (256 points, 1.2 s, `scenes/column.toml`)",
                column,
                &FULL,
                [1.0, 1.0],
            ),
            Self::new(
                "Col2x2",
                "the first 2 s of Col2x2, after which only the surface creeps: a column of 2 m x 2 m, \
                 1024 points",
                &merged(include_str!("../../../../scenes/paper/test/col2x2.toml"), "duration = 2.0"),
                &FULL,
                [2.0, 2.0],
            )
            .with_only(&ON_COL2X2),
            Self::new(
                "Col5x3",
                "a column of 5 m x 3 m, 3840 points, 3 s",
                include_str!("../../../../scenes/paper/test/col5x3.toml"),
                &FULL,
                [5.0, 3.0],
            )
            .with_only(&ON_COL5X3),
        ]
    }

    fn new(
        name: &'static str,
        description: &'static str,
        scene: &str,
        settings: &Settings,
        size: [f64; 2],
    ) -> Self {
        let scene = merged(scene, COMMON);
        let [_, _, keys] = settings.reference;
        let reference = merged(&scene, keys);
        let other = merged(&scene, &seed(SEEDS[2]));
        let other = merged(&other, &format!("rve.discs = {}", settings.discs));
        let start_of_networks = merged(&other, "rve.discs = 200");
        let setting = |family| {
            let other = &other;
            move |(name, changes): &(&str, &str)| {
                (family, (*name).to_owned(), merged(other, changes))
            }
        };
        let packings = settings.packings.iter().map(setting(Family::Packings));
        let tried = packings.chain(CONTINUUM.iter().map(setting(Family::Continuum))).collect();
        let [reference_name, reference_words, _] = settings.reference;
        Self {
            name,
            description,
            reference_name,
            reference_words,
            reference,
            start_of_networks,
            settings: tried,
            size,
        }
    }

    /// Drops the settings with packings that are not among `names`.
    fn with_only(mut self, names: &[&str]) -> Self {
        self.settings.retain(|(family, name, _)| {
            *family != Family::Packings || names.contains(&name.as_str())
        });
        self
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
    fn what_larger_scenes_try_is_among_the_settings() {
        let known = |name: &&str| FULL.packings.iter().any(|(setting, _)| setting == name);
        assert!(ON_COL2X2.iter().chain(&ON_COL5X3).all(known));
    }

    #[test]
    fn all_settings_are_valid_scenes_of_the_same_material() {
        for case in Case::of(Suite::Full).into_iter().chain(Case::of(Suite::Quick)) {
            for (_, name, scene) in &case.settings {
                let scene = Scene::parse(scene, name).unwrap_or_else(|e| panic!("{name}: {e:?}"));
                assert_eq!(scene.seed, SEEDS[2]);
                assert_eq!(scene.columns[0].place.size, case.size);
            }
        }
    }
}
