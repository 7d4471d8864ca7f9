//! How far a scene is expected to end up from the same scene with every grain as a disc.

use dem::Grains;
use serde::Serialize;

use crate::scene::{Material, Scene};

/// `tables/how-right-each-model-is--accuracy-of-the-defaults.csv` of `validation report --suite full`:
/// distances at the end of `scenes/truth/`. Rows whose source is `preliminary` are of an earlier study.
const MEASURED: &str = include_str!("accuracy.csv");

/// Relative difference up to which two lengths count as equal.
const EQUAL: f64 = 0.01;

/// Expected distance from the truth, scaled with the height from the most similar measured scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    /// Root mean square distance of points at the end (m); none of discs, which are the truth.
    pub distance: Option<f64>,
    /// The same between two runs as discs with different seeds (m).
    pub spread: f64,
    /// The scene it was measured on.
    pub scene: &'static str,
    /// Its cell (m).
    pub cell: f64,
    /// Its height (m).
    pub height: f64,
    /// Whether the measurement is preliminary.
    pub preliminary: bool,
    /// Ways in which this scene differs from all measured ones.
    pub beyond: Vec<String>,
}

/// A measured scene.
struct Measured {
    scene: &'static str,
    kind: &'static str,
    width: f64,
    height: f64,
    material: &'static str,
    cell: f64,
    distance: f64,
    spread: f64,
    preliminary: bool,
}

impl Accuracy {
    /// The accuracy to expect of a scene; `None` if nothing like it was measured.
    pub(super) fn of(scene: &Scene) -> Option<Self> {
        let kind = kind(scene);
        let material = scene.material.name();
        // Two runs of discs differ by the spread, which every row has.
        let is_truth = material == "discs";
        let rows = measured().into_iter().filter(|row| row.kind == kind);
        let rows: Vec<Measured> = rows.filter(|row| is_truth || row.material == material).collect();
        let [width, height] = largest_column(scene);
        let cell = scene.domain.cell;
        let away = |row: &Measured| {
            let shape = (row.height / row.width / (height / width)).ln().abs();
            let cells = if is_truth { 0.0 } else { (row.cell / cell).ln().abs() };
            shape + (row.height / height).ln().abs() + cells
        };
        let nearest = rows.iter().min_by(|a, b| away(a).total_cmp(&away(b)))?;
        let scale = height / nearest.height;
        let mut beyond = Vec::new();
        let outside = |value: f64, of: fn(&Measured) -> f64| {
            let [least, most] = range(rows.iter().map(of));
            value < (1.0 - EQUAL) * least || value > (1.0 + EQUAL) * most
        };
        if outside(height, |row| row.height) {
            beyond.push(format!("a height of {height} m"));
        }
        if outside(height / width, |row| row.height / row.width) {
            beyond.push(format!("an aspect ratio of {:.2}", height / width));
        }
        if !is_truth && outside(cell, |row| row.cell) {
            beyond.push(format!("cells of {cell} m"));
        }
        if has_other_grains(&scene.material) {
            beyond.push("other grains".to_owned());
        }
        Some(Self {
            distance: (!is_truth).then_some(scale * nearest.distance),
            spread: scale * nearest.spread,
            scene: nearest.scene,
            cell: nearest.cell,
            height: nearest.height,
            preliminary: nearest.preliminary,
            beyond,
        })
    }
}

/// What the material does, as the table names it.
fn kind(scene: &Scene) -> &'static str {
    let falls = |column: &crate::scene::Column| {
        column.place.corner[1] > 0.5 * scene.domain.spacing() || column.velocity != [0.0; 2]
    };
    if scene.plate.is_some() {
        "penetration"
    } else if scene.columns.iter().any(falls) {
        "fall"
    } else {
        "column"
    }
}

/// Width and height of the highest column (m).
fn largest_column(scene: &Scene) -> [f64; 2] {
    let sizes = scene.columns.iter().map(|column| column.place.size);
    sizes.max_by(|a, b| a[1].total_cmp(&b[1])).unwrap_or([1.0; 2])
}

/// Whether grains are not those that the table was measured with, the defaults.
fn has_other_grains(material: &Material) -> bool {
    let usual = Grains::default();
    let differs = |a: f64, b: f64| (a / b - 1.0).abs() > EQUAL;
    match material.grains() {
        Some(grains) => [
            (grains.radius_min, usual.radius_min),
            (grains.radius_max, usual.radius_max),
            (grains.thickness, usual.thickness),
            (grains.friction, usual.friction),
            (grains.normal_stiffness, usual.normal_stiffness),
        ]
        .into_iter()
        .any(|(a, b)| differs(a, b)),
        None => differs(material.grain().0, usual.mean_diameter()),
    }
}

/// All rows; lines in another format are left out.
fn measured() -> Vec<Measured> {
    MEASURED.lines().skip(1).filter_map(parse).collect()
}

fn parse(line: &'static str) -> Option<Measured> {
    let cells: Vec<&str> = line.split(',').collect();
    let &[scene, kind, width, height, material, cell, _, distance, spread, source] = &cells[..]
    else {
        return None;
    };
    let numbers: Option<Vec<f64>> =
        [width, height, cell, distance, spread].map(|text| text.parse().ok()).into_iter().collect();
    let &[width, height, cell, distance, spread] = &numbers?[..] else { return None };
    let preliminary = source == "preliminary";
    Some(Measured { scene, kind, width, height, material, cell, distance, spread, preliminary })
}

fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(size: [f64; 2], lines: &str) -> Option<Accuracy> {
        let [width, height] = size;
        let text = format!(
            "duration = 3.0\n[domain]\nsize = [10.0, 10.0]\n[[column]]\nsize = [{width:?}, {height:?}]\n{lines}"
        );
        Accuracy::of(&Scene::parse(&text, "test.toml").unwrap())
    }

    #[test]
    fn every_line_of_the_report_is_understood() {
        assert!(MEASURED.lines().count() > 1);
        assert_eq!(measured().len(), MEASURED.lines().count() - 1);
        assert!(measured().iter().all(|row| row.distance > 0.0 && row.spread > 0.0));
    }

    #[test]
    fn a_measured_scene_is_quoted_and_others_are_scaled_by_height() {
        let quoted = of([2.0, 1.0], "").unwrap();
        let name = "Column a = 0.5";
        let row = measured().into_iter().find(|r| r.scene == name && r.material == "rve").unwrap();
        assert_eq!((quoted.scene, quoted.distance), (name, Some(row.distance)));
        assert_eq!(quoted.beyond, Vec::<String>::new());
        let other = of([2.25, 1.125], "").unwrap();
        assert!((other.distance.unwrap() / 1.125 - row.distance).abs() < 1e-12);
        let discs = of([2.0, 1.0], "[material]\nkind = \"discs\"").unwrap();
        assert_eq!((discs.distance, discs.spread), (None, row.spread));
    }

    #[test]
    fn what_was_not_measured_is_named() {
        let flat = of([9.0, 0.5], "").unwrap();
        assert!(flat.beyond.iter().any(|what| what.contains("aspect ratio")), "{flat:?}");
        let sand = of([2.0, 2.0], "[grains]\nradius_min = 1e-4\nradius_max = 2e-4").unwrap();
        assert!(sand.beyond.contains(&"other grains".to_owned()));
        assert_eq!(of([2.0, 2.0], "[material]\nkind = \"elastic\""), None);
    }
}
