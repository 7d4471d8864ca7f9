//! The scenes that all models compute: `scenes/truth/`.

use crate::suite::Suite;

/// A scene for all models.
#[derive(Debug)]
pub struct TruthScene {
    /// Its name in the report.
    pub name: &'static str,
    /// Lead of the section that compares models with the truth on it.
    pub lead: &'static str,
    /// Title of that section.
    pub title: &'static str,
    /// What happens, in words.
    pub description: &'static str,
    /// Text of its file, with packings as the material.
    pub text: &'static str,
    /// The same scene with the settings of the paper, where it is one of the paper's.
    pub published: Option<&'static str>,
    /// Width and height of what falls or collapses, m.
    pub size: [f64; 2],
    /// What it does.
    pub kind: Kind,
}

/// What the material of a scene does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// It stands on the floor and collapses.
    Column,
    /// It falls.
    Fall,
    /// A plate is pushed into it.
    Penetration,
}

impl Kind {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Column => "column",
            Self::Fall => "fall",
            Self::Penetration => "penetration",
        }
    }
}

macro_rules! scene {
    ($name:literal, $file:literal, $published:expr, $size:expr, $kind:expr, $description:literal) => {
        TruthScene {
            name: $name,
            lead: concat!("Distances from the discs where ", $description, "."),
            title: concat!("Truth: ", $name),
            description: $description,
            text: include_str!(concat!("../../../../scenes/truth/", $file)),
            published: $published,
            size: $size,
            kind: $kind,
        }
    };
}

macro_rules! published {
    ($file:literal) => {
        Some(include_str!(concat!("../../../../scenes/paper/", $file)))
    };
}

/// All scenes; the quick suite has the first.
pub const SCENES: [TruthScene; 13] = [
    scene!(
        "Small column",
        "small.toml",
        None,
        [0.5, 0.5],
        Kind::Column,
        "a column 0.5 m wide and 0.5 m high collapses"
    ),
    scene!(
        "Column a = 0.5",
        "column-a05.toml",
        None,
        [2.0, 1.0],
        Kind::Column,
        "a column 2 m wide and 1 m high collapses"
    ),
    scene!(
        "Column a = 1",
        "column-a1.toml",
        None,
        [1.0, 1.0],
        Kind::Column,
        "a column 1 m wide and 1 m high collapses"
    ),
    scene!(
        "Column a = 2",
        "column-a2.toml",
        None,
        [1.0, 2.0],
        Kind::Column,
        "a column 1 m wide and 2 m high collapses"
    ),
    scene!(
        "Column a = 6",
        "column-a6.toml",
        None,
        [1.0, 6.0],
        Kind::Column,
        "a column 1 m wide and 6 m high collapses"
    ),
    scene!(
        "Col2x2",
        "col2x2.toml",
        published!("test/col2x2.toml"),
        [2.0, 2.0],
        Kind::Column,
        "a column 2 m wide and 2 m high collapses"
    ),
    scene!(
        "Col3x3",
        "col3x3.toml",
        published!("train/x0y0-v00.toml"),
        [3.0, 3.0],
        Kind::Column,
        "a column 3 m wide and 3 m high collapses"
    ),
    scene!(
        "Col3x3barriers",
        "col3x3barriers.toml",
        published!("test/col3x3barriers.toml"),
        [3.0, 3.0],
        Kind::Column,
        "a column 3 m wide and 3 m high collapses onto two barriers"
    ),
    scene!(
        "Case 2",
        "case2.toml",
        published!("valid/case2.toml"),
        [3.0, 3.0],
        Kind::Fall,
        "a block of 3 m x 3 m falls 1.5 m"
    ),
    scene!(
        "Case 4",
        "case4.toml",
        published!("valid/case4.toml"),
        [3.0, 3.0],
        Kind::Fall,
        "a block of 3 m x 3 m is thrown from a height of 3 m"
    ),
    scene!(
        "Fall onto a barrier",
        "fall-barrier.toml",
        None,
        [1.5, 1.5],
        Kind::Fall,
        "a block of 1.5 m x 1.5 m falls 1 m onto a barrier"
    ),
    scene!(
        "Twins",
        "twins.toml",
        published!("test/col2x2twins.toml"),
        [2.0, 2.0],
        Kind::Column,
        "two columns 2 m wide and 2 m high collapse and meet"
    ),
    scene!(
        "Penetration",
        "penetration.toml",
        None,
        [4.0, 1.0],
        Kind::Penetration,
        "a plate is pushed 0.25 m deep into a bed 1 m deep"
    ),
];

impl TruthScene {
    /// The scenes of a suite.
    pub fn of(suite: Suite) -> &'static [Self] {
        suite.pick(&SCENES[..1], &SCENES)
    }

    /// The scene of this name.
    ///
    /// # Panics
    /// If there is none.
    pub fn named(name: &str) -> &'static Self {
        let found = SCENES.iter().find(|scene| scene.name == name);
        found.unwrap_or_else(|| panic!("no scene is named {name}"))
    }
}

#[cfg(test)]
mod tests {
    use dempm::scene::Scene;

    use super::*;

    #[test]
    fn scenes_are_of_packings_and_follow_the_defaults() {
        for scene in &SCENES {
            let parsed = Scene::parse(scene.text, scene.name).unwrap();
            assert_eq!(parsed.material.name(), "rve");
            assert_eq!(parsed.columns[0].place.size, scene.size);
            for table in ["[numerics]", "[rve]", "[grains]", "cell", "step"] {
                assert!(!scene.text.contains(table), "{}: {table}", scene.name);
            }
        }
    }

    #[test]
    fn scenes_of_the_paper_have_its_geometry() {
        for scene in &SCENES {
            let Some(published) = scene.published else { continue };
            let [ours, theirs] =
                [scene.text, published].map(|text| Scene::parse(text, scene.name).unwrap());
            assert_eq!(ours.columns, theirs.columns, "{}", scene.name);
            assert_eq!(ours.obstacles, theirs.obstacles, "{}", scene.name);
            assert_eq!(ours.domain.size, theirs.domain.size);
            assert_eq!((ours.duration, ours.frames()), (theirs.duration, theirs.frames()));
        }
    }
}
