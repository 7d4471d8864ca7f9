//! Scenes drawn at random: blocks of a list whose values are distributions.

use std::num::{NonZeroU32, NonZeroUsize};
use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::{Table, Value};

use super::case::Case;
use super::distribution::Draws;
use super::error::DatasetError;
use super::keys::{Assignment, assign, leaves};
use super::split::Split;
use crate::scene::{Scene, SceneError};

/// Most draws for one scene.
const TRIES: u32 = 1000;

/// A class of scenes.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Random {
    /// Name of the class, with which the names of its cases begin.
    class: String,
    /// A list, relative to this one, whose class of the same name is drawn from.
    like: Option<String>,
    /// Base scene instead of that of the file.
    scene: Option<String>,
    #[serde(default)]
    train: Count,
    #[serde(default)]
    valid: Count,
    #[serde(default)]
    test: Count,
    /// Smallest and largest number of points; scenes beyond are drawn again.
    points: Option<[usize; 2]>,
    /// Values for all scenes.
    #[serde(default)]
    set: Table,
    /// Quantities with names, drawn once for each scene.
    #[serde(default, rename = "let")]
    quantities: Table,
    /// Values of the scenes, any of them a distribution.
    #[serde(default)]
    draw: Table,
}

/// How many scenes of a split are drawn.
#[derive(Clone, Copy, Deserialize)]
#[serde(untagged, expecting = "a number of scenes, or a table with `scenes`, `seeds` and `every`")]
enum Count {
    Scenes(usize),
    Repeated(Repeated),
}

/// Scenes of which some are run with several seeds.
#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Repeated {
    scenes: usize,
    /// Runs of one of `every` scenes, at least 1.
    seeds: NonZeroU32,
    #[serde(default = "every_scene")]
    every: NonZeroUsize,
}

fn every_scene() -> NonZeroUsize {
    NonZeroUsize::MIN
}

impl Default for Count {
    fn default() -> Self {
        Self::Scenes(0)
    }
}

impl Count {
    /// The number of runs of each scene.
    fn runs(self) -> Vec<u32> {
        match self {
            Self::Scenes(scenes) => vec![1; scenes],
            Self::Repeated(Repeated { scenes, seeds, every }) => {
                let of =
                    |scene: usize| if scene.is_multiple_of(every.get()) { seeds.get() } else { 1 };
                (0..scenes).map(of).collect()
            }
        }
    }
}

/// A list as far as classes are drawn from it.
pub(super) struct Source<'a> {
    /// The list.
    pub(super) path: &'a Path,
    /// Its base scene.
    pub(super) scene: Option<&'a str>,
    /// Its values for all cases.
    pub(super) set: &'a Table,
}

/// What the scenes of a class are drawn from.
#[derive(Clone)]
pub(super) struct Class {
    name: String,
    /// The list that describes it, and the block there.
    path: PathBuf,
    block: String,
    base: PathBuf,
    base_table: Table,
    /// Values for all scenes, later ones before earlier ones.
    set: Vec<Assignment>,
    points: Option<[usize; 2]>,
    quantities: Table,
    draw: Table,
}

impl Random {
    fn error(&self, path: &Path, index: usize, key: &str, reason: String) -> DatasetError {
        DatasetError::Key { path: path.to_owned(), key: format!("random[{index}].{key}"), reason }
    }

    /// The class that this block describes, the `index`-th of the list; `like` finds one in another list.
    pub(super) fn class(
        &self,
        source: &Source<'_>,
        index: usize,
        like: &dyn Fn(&Path, &str) -> Result<Class, DatasetError>,
    ) -> Result<Class, DatasetError> {
        let error =
            |key: &str, reason: &str| Err(self.error(source.path, index, key, reason.to_owned()));
        let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if self.class.is_empty() || !self.class.chars().all(is_plain) {
            return error("class", "names files: small letters, digits and -");
        }
        for (name, table) in [("set", &self.set), ("draw", &self.draw)] {
            if table.contains_key("seed") {
                return error(&format!("{name}.seed"), "is drawn for each run");
            }
        }
        if let Some(file) = &self.like {
            if !self.draw.is_empty() || !self.quantities.is_empty() || self.scene.is_some() {
                return error("like", "takes scene, `let` and `draw` from the other list");
            }
            let mut class = like(&source.path.with_file_name(file), &self.class)?;
            class.set.extend([source.set, &self.set].into_iter().flat_map(leaves));
            class.points = self.points.or(class.points);
            return Ok(class);
        }
        let Some(scene) = self.scene.as_deref().or(source.scene) else {
            return error("scene", "is missing here and at the top of the list");
        };
        let base = source.path.with_file_name(scene);
        Ok(Class {
            name: self.class.clone(),
            path: source.path.to_owned(),
            block: format!("random[{index}]"),
            base_table: read_toml(&base)?,
            base,
            set: [source.set, &self.set].into_iter().flat_map(leaves).collect(),
            points: self.points,
            quantities: self.quantities.clone(),
            draw: self.draw.clone(),
        })
    }

    /// Whether this is the block of a class.
    pub(super) fn is(&self, class: &str) -> bool {
        self.class == class
    }

    /// Whether the other block has the same class.
    pub(super) fn shares(&self, other: &Self) -> bool {
        self.class == other.class
    }

    fn count(&self, split: Split) -> Count {
        match split {
            Split::Train => self.train,
            Split::Valid => self.valid,
            Split::Test => self.test,
        }
    }

    /// The cases of a split, each scene with its seeds.
    pub(super) fn cases(
        &self,
        class: &Class,
        list: &Path,
        seed: u64,
        split: Split,
    ) -> Result<Vec<Case>, DatasetError> {
        let mut cases = Vec::new();
        for (number, runs) in self.count(split).runs().into_iter().enumerate() {
            let name = format!("{}-{number:03}", class.name);
            // A scene does not depend on how many others of its class there are.
            let key = format!("{seed} {} {} {number}", class.name, split.name());
            let drawn = class.draw_scene(&key, list, split, &name)?;
            for run in 0..runs {
                let first = run == 0;
                let own = if first { name.clone() } else { format!("{name}-seed-{}", run + 1) };
                let shown = format!("{}: {}", list.display(), split.case(&own));
                let scene = Scene::parse(&drawn.text(u64::from(run)), &shown)?;
                cases.push(Case {
                    class: class.name.clone(),
                    same_as: (!first).then(|| name.clone()),
                    refused: if first { drawn.refused } else { 0 },
                    ..Case::new(split, own, scene, drawn.values.clone())
                });
            }
        }
        Ok(cases)
    }
}

/// A scene that was drawn.
struct Drawn {
    table: Table,
    seed: u64,
    values: String,
    refused: u32,
}

impl Drawn {
    /// The scene of its `run`-th seed, from 0.
    fn text(&self, run: u64) -> String {
        let mut table = self.table.clone();
        table.insert("seed".to_owned(), Value::Integer((self.seed + run) as i64));
        toml::to_string(&table).expect("tables that were read can be written")
    }
}

impl Class {
    fn error(&self, key: &str, reason: String) -> DatasetError {
        let key = format!("{}.{key}", self.block);
        DatasetError::Key { path: self.path.clone(), key, reason }
    }

    /// Draws until a scene is valid and has the right number of points.
    fn draw_scene(
        &self,
        key: &str,
        list: &Path,
        split: Split,
        name: &str,
    ) -> Result<Drawn, DatasetError> {
        let mut reason = String::new();
        for refused in 0..TRIES {
            let hash = blake3::hash(format!("{key} {refused}").as_bytes());
            let mut random = ChaCha8Rng::from_seed(*hash.as_bytes());
            // Seeds of further runs come after it, and a scene holds 32 bits.
            let seed = u64::from(random.random::<u32>() >> 1);
            let draw = Draws::new(random, &self.quantities).table(&self.draw, "draw");
            let draw = draw.map_err(|(key, reason)| self.error(&key, reason))?;
            let mut table = self.base_table.clone();
            let title = format!("{}, {}", stem(&self.base), split.case(name));
            table.insert("title".to_owned(), Value::String(title));
            let drawn = leaves(&draw);
            for (key, value) in drawn.iter().chain(&self.set) {
                assign(&mut table, key, value.clone()).map_err(|reason| self.error(key, reason))?;
            }
            let values = drawn.iter().map(|(key, value)| format!("{key} = {value}"));
            let values = values.collect::<Vec<_>>().join(", ");
            let drawn = Drawn { table, seed, values, refused };
            let shown = format!("{}: {}", list.display(), split.case(name));
            match Scene::parse(&drawn.text(0), &shown) {
                Ok(scene) => match self.points {
                    Some([least, most]) if !(least..=most).contains(&scene.point_count()) => {
                        reason = format!("{} points", scene.point_count());
                    }
                    _ => return Ok(drawn),
                },
                Err(SceneError::Invalid(problems)) => {
                    reason = problems.problems.first().map_or_else(String::new, first_reason);
                }
                Err(other) => return Err(other.into()),
            }
        }
        let reason =
            format!("gives no valid scene in {TRIES} draws; the last has this fault: {reason}");
        Err(self.error("draw", reason))
    }
}

fn first_reason(problem: &crate::scene::Problem) -> String {
    let label = problem.places.first().map_or("", |(_, label)| label);
    let help = problem.help.as_deref().unwrap_or("");
    let parts = [&problem.message, label, help];
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ")
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// The content of a TOML file.
pub(super) fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T, DatasetError> {
    let text = std::fs::read_to_string(path)
        .map_err(|source| DatasetError::Read { path: path.to_owned(), source })?;
    toml::from_str(&text).map_err(|source| DatasetError::Syntax { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::super::catalogue::cases;
    use super::*;

    const BASE: &str = "duration = 1.0\n[domain]\nsize = [4.0, 2.0]\ncell = 0.125\n[[column]]\n\
                        size = [1.0, 1.0]\n[material]\nkind = \"discs\"\n";
    const LIST: &str = "scene = \"base.toml\"\nseed = 7\n[set]\nduration = 0.5\n[[random]]\n\
                        class = \"heap\"\ntrain = { scenes = 30, seeds = 3, every = 10 }\nvalid = 4\n\
                        points = [20, 200]\n[[random.draw.column]]\nrepeat = { choice = [1, 2] }\n\
                        corner = [{ uniform = [0.0, 3.0] }, 0.0]\n\
                        size = [{ uniform = [0.25, 1.0], multiple = 0.0625 }, 0.5]\n";

    /// The cases of a list in a folder with the base scene, and other lists beside it.
    fn drawn(lists: &[(&str, &str)]) -> Result<Vec<Case>, DatasetError> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("base.toml"), BASE).unwrap();
        for (name, text) in lists {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        cases(&folder.path().join(lists[0].0))
    }

    fn texts(cases: &[Case]) -> Vec<&str> {
        cases.iter().map(|case| case.scene.text.as_str()).collect()
    }

    #[test]
    fn scenes_are_valid_within_bounds_and_the_same_every_time() {
        let all = drawn(&[("list.toml", LIST)]).unwrap();
        assert_eq!(all.len(), 30 + 3 * 2 + 4);
        for case in &all {
            assert!((20..=200).contains(&case.scene.point_count()));
            assert_eq!(case.scene.duration, 0.5);
            assert_eq!(case.class, "heap");
        }
        // Two columns of half a metre in three overlap now and then.
        assert!(all.iter().map(|case| case.refused).sum::<u32>() > 0);
        assert!(all.iter().any(|case| case.scene.columns.len() == 2));
        assert_eq!(texts(&all), texts(&drawn(&[("list.toml", LIST)]).unwrap()));
        let other = LIST.replace("seed = 7", "seed = 8");
        assert_ne!(all[0].scene.columns, drawn(&[("list.toml", &other)]).unwrap()[0].scene.columns);
    }

    #[test]
    fn seeds_of_a_scene_are_known_as_such() {
        let all = drawn(&[("list.toml", LIST)]).unwrap();
        let again: Vec<&Case> = all.iter().filter(|case| case.same_as.is_some()).collect();
        assert_eq!(again.len(), 6);
        assert_eq!(again[1].name, "heap-000-seed-3");
        for case in again {
            let first =
                all.iter().find(|other| Some(&other.name) == case.same_as.as_ref()).unwrap();
            assert_eq!((&first.scene.columns, first.split), (&case.scene.columns, case.split));
            assert_ne!(first.scene.seed, case.scene.seed);
        }
    }

    /// More scenes do not change those that were drawn before.
    #[test]
    fn a_scene_does_not_depend_on_the_others() {
        let few = drawn(&[("list.toml", LIST)]).unwrap();
        let more = LIST.replace("scenes = 30", "scenes = 31").replace("valid = 4", "valid = 9");
        let more = drawn(&[("list.toml", &more)]).unwrap();
        for case in few {
            let same = more.iter().find(|other| other.full_name() == case.full_name()).unwrap();
            assert_eq!(same.scene.text, case.scene.text);
        }
    }

    /// Another material on the scenes of another list.
    #[test]
    fn a_list_draws_from_the_classes_of_another() {
        let like = "seed = 7\nset.material.kind = \"mu-i\"\nset.domain.cell = 0.125\n[[random]]\n\
                    class = \"heap\"\nlike = \"list.toml\"\ntrain = 10\n";
        let [one, other] =
            [[("list.toml", LIST)].as_slice(), &[("like.toml", like), ("list.toml", LIST)]]
                .map(|lists| drawn(lists).unwrap());
        let first: Vec<&Case> =
            one.iter().filter(|case| case.same_as.is_none()).take(other.len()).collect();
        assert_eq!(other.len(), 10);
        for (discs, law) in first.iter().zip(&other) {
            assert_eq!((law.scene.material.name(), law.scene.duration), ("mu-i", 0.5));
            assert_eq!(discs.scene.columns, law.scene.columns);
        }
    }

    #[test]
    fn wrong_classes_are_refused_with_file_and_key() {
        for (from, to, key, said) in [
            ("seed = 7\n", "", "`seed`", "missing"),
            ("\"heap\"", "\"A heap\"", "random[0].class", "small letters"),
            (
                "corner = [{ uniform = [0.0, 3.0] }",
                "corner = [{ uniform = [3.0, 0.0] }",
                "random[0].draw.column.0.corner.0.uniform",
                "rise",
            ),
            (
                "uniform = [0.0, 3.0] }, 0.0]",
                "uniform = [9.0, 9.0] }, 0.0]",
                "random[0].draw",
                "not inside the domain",
            ),
            ("points = [20, 200]", "points = [20, 21]", "random[0].draw", "no valid scene"),
            ("scene = \"base.toml\"\n", "", "random[0].scene", "missing"),
            ("valid = 4", "like = \"list.toml\"", "random[0].like", "other list"),
        ] {
            let error = drawn(&[("list.toml", &LIST.replace(from, to))]).unwrap_err().to_string();
            assert!(
                error.contains("list.toml") && error.contains(key) && error.contains(said),
                "{to}: {error}"
            );
        }
        let circle = "seed = 1\n[[random]]\nclass = \"heap\"\nlike = \"list.toml\"\ntrain = 1\n";
        let error = drawn(&[("list.toml", circle)]).unwrap_err().to_string();
        assert!(error.contains("without end"), "{error}");
    }

    #[test]
    fn the_lists_that_ship_are_what_they_promise() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes/dataset");
        let all = cases(&folder.join("discs.toml")).unwrap();
        let scenes = all.iter().filter(|case| case.same_as.is_none() && case.split == Split::Train);
        assert!(scenes.count() >= 300);
        let test = cases(&folder.join("discs-test.toml")).unwrap();
        for class in ["at-rest", "boxes", "falls", "plate"] {
            let of_class = || test.iter().filter(|case| case.class == class);
            assert_eq!(of_class().filter(|case| case.same_as.is_none()).count(), 10);
            assert_eq!(of_class().count(), 40);
        }
        assert!(test.iter().all(|case| case.split == Split::Test));
        // Other solvers run the same scenes.
        for other in ["discs-test-rve.toml", "discs-test-paper.toml"] {
            let others = cases(&folder.join(other)).unwrap();
            let first: Vec<&Case> = test.iter().filter(|case| case.same_as.is_none()).collect();
            assert_eq!(others.len(), first.len());
            for (own, discs) in others.iter().zip(first) {
                assert_eq!(
                    (own.full_name(), own.scene.material.name()),
                    (discs.full_name(), "rve")
                );
                assert_eq!(own.scene.columns, discs.scene.columns);
                assert_eq!(own.scene.obstacles, discs.scene.obstacles);
                assert_eq!(own.scene.plate, discs.scene.plate);
            }
        }
    }
}
