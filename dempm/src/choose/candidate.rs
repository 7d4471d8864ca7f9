//! The ways in which a scene can be computed.

use miette::Severity;
use toml::{Table, Value};

use super::family::Family;
use crate::scene::{Scene, SceneError};

/// Sizes of discs over those of the scene.
const SIZES: [f64; 3] = [1.0, 2.0, 4.0];
/// Discs in a packing and different packings: the defaults, and what is cheaper.
const PACKINGS: [[usize; 2]; 2] = [[64, 64], [36, 16]];
/// Cells from the finest on that packings and the law are computed on.
const GRIDS: usize = 3;
/// Least and largest cell over the height of the highest pile.
const CELL_OVER_HEIGHT: [f64; 2] = [1.0 / 80.0, 0.25];
/// Least cell (mean diameters): finer ones are smaller than a shear band.
const LEAST_CELL: f64 = 3.0;
/// Powers of two by which a cell is larger than that of the scene.
const POWERS: std::ops::RangeInclusive<i32> = -4..=4;
/// Least cell of discs (mean diameters of the scene): its four squares hold some seventy grains each. That of
/// discs 4 times as large is twice as wide, as a square may not be empty.
const CELL_OF_DISCS: f64 = 16.0;
const CELL_OF_LARGER: f64 = 8.0;
/// Relative tolerance on equal lengths.
const ROUNDING: f64 = 1.0e-6;
/// Points along a cell, as in all measured scenes.
const POINTS_PER_CELL: i64 = 2;

/// A way to compute a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// The kind of model.
    pub family: Family,
    /// Its name in tables, such as `discs, 2 times as large`.
    pub name: String,
    /// Size of the discs over that of the scene.
    pub size: f64,
    /// Edge of a cell of the grid (m).
    pub cell: f64,
    /// Discs in a packing and different packings.
    pub packings: Option<[usize; 2]>,
    /// The scene with this model, or why it cannot be computed so.
    pub scene: Result<Box<Scene>, String>,
}

impl Candidate {
    /// The next coarser one of the same kind: the same model on twice the cell, or with discs twice as large.
    pub fn coarser<'a>(&self, all: &'a [Self]) -> Option<&'a Self> {
        let is_coarser = |other: &&Self| {
            let next = match self.family {
                Family::Discs => is_twice(other.size, self.size),
                Family::Rve | Family::MuI => is_twice(other.cell, self.cell),
                Family::Learned => false,
            };
            next && other.family == self.family && other.packings == self.packings
        };
        all.iter().filter(|other| other.scene.is_ok()).find(is_coarser)
    }
}

fn is_twice(large: f64, small: f64) -> bool {
    (large / small - 2.0).abs() < ROUNDING
}

/// All candidates of a scene of grains: discs first, the finest first in each family. A plate or an elastic
/// material has none.
pub fn candidates(scene: &Scene) -> Vec<Candidate> {
    let Ok(mut base) = scene.text.parse::<Table>() else { return Vec::new() };
    // An earlier one says nothing of these.
    base.remove("choice");
    let build = |keys: &[(&str, &str, Value)]| with(scene, &base, keys);
    let diameter = scene.material.grain().0;
    let mut all = Vec::new();
    for size in SIZES {
        let [min, max] = radii(scene).map(|radius| Value::Float(size * radius));
        let larger = [("grains", "radius_min", min), ("grains", "radius_max", max)];
        let keys = |cell: f64| {
            let mut keys = kind(Family::Discs, cell);
            keys.extend(larger.iter().filter(|_| size != 1.0).cloned());
            keys
        };
        let enough = CELL_OF_DISCS.max(size * CELL_OF_LARGER) * diameter;
        let cells = POWERS.map(|power| scene.domain.cell * 2.0_f64.powi(power));
        let fitting: Vec<f64> = cells.filter(|cell| build(&keys(*cell)).is_ok()).collect();
        let found = fitting.iter().find(|cell| **cell > (1.0 - ROUNDING) * enough);
        // The scene's own, with what is wrong with it, rather than none.
        let cell = found.or(fitting.last()).copied().unwrap_or(scene.domain.cell);
        let name =
            if size == 1.0 { "discs".into() } else { format!("discs, {size} times as large") };
        let scene = build(&keys(cell));
        all.push(Candidate { family: Family::Discs, name, size, cell, packings: None, scene });
    }
    let grids = |family: Family| -> Vec<f64> {
        let height = scene.height();
        let [least, largest] = CELL_OVER_HEIGHT.map(|share| share * height);
        let least = least.max(LEAST_CELL * diameter);
        let cells = POWERS.map(|power| scene.domain.cell * 2.0_f64.powi(power));
        let fits = |cell: &f64| {
            let bounds = (1.0 - ROUNDING) * least..=(1.0 + ROUNDING) * largest;
            bounds.contains(cell) && build(&kind(family, *cell)).is_ok()
        };
        let fitting: Vec<f64> = cells.filter(fits).take(GRIDS).collect();
        // The scene's own, with what is wrong with it, rather than none.
        if fitting.is_empty() { vec![scene.domain.cell] } else { fitting }
    };
    for [discs, packings] in PACKINGS {
        for cell in grids(Family::Rve) {
            let mut keys = kind(Family::Rve, cell);
            keys.push(("material", "packings", Value::Integer(packings as i64)));
            keys.push(("rve", "discs", Value::Integer(discs as i64)));
            let name = format!("{packings} packings of {discs}, cells of {} mm", millimetres(cell));
            let (packings, scene) = (Some([discs, packings]), build(&keys));
            all.push(Candidate { family: Family::Rve, name, size: 1.0, cell, packings, scene });
        }
    }
    for cell in grids(Family::MuI) {
        let mut keys = kind(Family::MuI, cell);
        if !base.contains_key("mu-i") {
            keys.push(("mu-i", "grain_diameter", Value::Float(diameter)));
        }
        let name = format!("mu(I), cells of {} mm", millimetres(cell));
        let scene = build(&keys);
        all.push(Candidate { family: Family::MuI, name, size: 1.0, cell, packings: None, scene });
    }
    all
}

/// The scene with its grains as discs on every grid that fits it, the finest first.
pub fn discs_on_grids(scene: &Scene) -> Vec<Scene> {
    let Ok(mut base) = scene.text.parse::<Table>() else { return Vec::new() };
    base.remove("choice");
    let cells = POWERS.map(|power| scene.domain.cell * 2.0_f64.powi(power));
    cells.filter_map(|cell| Some(*with(scene, &base, &kind(Family::Discs, cell)).ok()?)).collect()
}

/// A key of a scene: table, key and value.
type Key = (&'static str, &'static str, Value);

/// The keys of a family on a grid.
fn kind(family: Family, cell: f64) -> Vec<Key> {
    vec![
        ("material", "kind", Value::String(family.name().to_owned())),
        ("domain", "cell", Value::Float(cell)),
        ("domain", "points_per_cell", Value::Integer(POINTS_PER_CELL)),
    ]
}

/// The scene with some keys set.
fn with(scene: &Scene, base: &Table, keys: &[(&str, &str, Value)]) -> Result<Box<Scene>, String> {
    let mut table = base.clone();
    for (name, key, value) in keys {
        let entry = table.entry(*name).or_insert_with(|| Value::Table(Table::new()));
        let inner = entry.as_table_mut().ok_or_else(|| format!("`{name}` is no table"))?;
        inner.insert((*key).to_owned(), value.clone());
    }
    let text = toml::to_string(&table).map_err(|error| error.to_string())?;
    Scene::parse(&text, &scene.name).map(Box::new).map_err(|error| first_problem(&error))
}

/// The first error of a scene, in one line.
fn first_problem(error: &SceneError) -> String {
    let SceneError::Invalid(all) = error else { return error.to_string() };
    let errors = all.problems.iter().find(|problem| problem.severity == Severity::Error);
    errors.map_or_else(|| error.to_string(), |problem| problem.message.clone())
}

/// Smallest and largest radius (m).
fn radii(scene: &Scene) -> [f64; 2] {
    let usual = dem::Grains::default();
    let grains = scene.material.grains().unwrap_or(&usual);
    [grains.radius_min, grains.radius_max]
}

fn millimetres(length: f64) -> f64 {
    (1.0e4 * length).round() / 10.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(lines: &str, width: f64) -> Scene {
        let text = format!(
            "duration = 0.5\n{lines}\n[[column]]\nsize = [{width:?}, 1.0]\n[domain]\nsize = [4.0, 2.0]\n"
        );
        Scene::parse(&text, "test.toml").unwrap()
    }

    fn of(family: Family, all: &[Candidate]) -> Vec<(f64, bool)> {
        let own = all.iter().filter(|candidate| candidate.family == family);
        own.map(|candidate| (candidate.cell, candidate.scene.is_ok())).collect()
    }

    #[test]
    fn the_model_of_the_scene_does_not_matter() {
        let [discs, packings] = ["material.kind = \"discs\"", ""].map(|line| {
            let mut all = candidates(&scene(line, 1.0));
            for candidate in &mut all {
                // Their texts differ by the line.
                candidate.scene = candidate.scene.clone().map(|mut scene| {
                    scene.text.clear();
                    scene
                });
            }
            all
        });
        assert_eq!(discs, packings);
        let grids = [0.03125, 0.0625, 0.125].map(|cell| (cell, true));
        assert_eq!(of(Family::MuI, &discs), grids);
        assert_eq!(of(Family::Rve, &discs), [grids, grids].concat());
        // Eight mean diameters of 7.5 mm in a point; those of 30 mm have four.
        assert_eq!(of(Family::Discs, &discs), [(0.125, true), (0.125, true), (0.25, true)]);
    }

    #[test]
    fn the_coarser_one_is_of_the_same_kind() {
        let all = candidates(&scene("", 1.0));
        let coarser = |name: &str| {
            let candidate = all.iter().find(|candidate| candidate.name == name).unwrap();
            candidate.coarser(&all).map(|coarser| coarser.name.as_str())
        };
        assert_eq!(coarser("discs"), Some("discs, 2 times as large"));
        assert_eq!(coarser("discs, 4 times as large"), None);
        let packings = "16 packings of 36, cells of ".to_owned();
        assert_eq!(coarser(&(packings.clone() + "31.3 mm")), Some(&*(packings + "62.5 mm")));
        assert_eq!(coarser("mu(I), cells of 125 mm"), None);
    }

    #[test]
    fn grids_that_do_not_fit_the_columns_are_left_out() {
        // 53 points of the finest cell, which is no whole number of larger ones.
        let all = candidates(&scene("", 53.0 / 64.0));
        assert_eq!(of(Family::MuI, &all), [(0.03125, true)]);
        let discs = of(Family::Discs, &all);
        // Two of the larger grains do not fit into a point of it.
        assert_eq!(discs, [(0.03125, true), (0.03125, false), (0.03125, false)]);
        let why = all[2].scene.as_ref().unwrap_err();
        assert!(why.contains("may hold no grain"), "{why}");
    }
}
