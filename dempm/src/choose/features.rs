//! What is known of a scene and a candidate before it is run, as dimensionless numbers.

use mpm::Friction;

use super::candidate::Candidate;
use crate::scene::{Column, Rectangle, Scene};

/// Names of the features, as in the table of measured cases.
pub const NAMES: [&str; 14] = [
    "grain", "aspect", "fall", "speed", "barriers", "nearness", "columns", "room", "friction",
    "floor", "time", "cell", "packing", "size",
];

/// How a feature out of range is called.
pub const MEANINGS: [&str; 14] = [
    "size of the grains over the height",
    "aspect ratio",
    "height of the fall over that of the column",
    "speed of the throw",
    "height of barriers",
    "distance to barriers",
    "number of columns",
    "room to flow",
    "friction of the grains",
    "friction of the floor",
    "duration after flight in units of sqrt(H / g)",
    "cells over the height",
    "discs in a packing",
    "size of the discs",
];

/// The features of a candidate.
pub type Features = [f64; NAMES.len()];

/// Terms of the regression.
const TERMS: usize = 16;
/// Duration of a collapse (in `sqrt(H / g)`), after which errors hardly grow.
const COLLAPSE: f64 = 3.2;
/// Grain friction of the default.
const USUAL_FRICTION: f64 = 0.5;
/// Grains of less friction are as smooth.
const SMOOTH: f64 = 0.02;
/// Least duration after flight (in `sqrt(H / g)`).
const LEAST_TIME: f64 = 0.05;
/// Columns beyond this number are as many.
const MANY: usize = 3;

/// The features of a candidate of `scene`, whose grains are those of the truth. With `H` the height of the
/// highest pile and `g` gravity: logarithms of `d / H`, of the aspect ratio, of `1 + fall / H`, of
/// `1 + v² / (2 g H)`; the height of barriers over H; `exp(-gap / H)` of the nearest barrier; columns besides the
/// first; logarithms of 1 + free width of the floor over H, of friction and of the duration after flight over
/// `sqrt(H / g)`; those of the candidate.
pub fn features(scene: &Scene, candidate: &Candidate) -> Features {
    let height = scene.height();
    let gravity = scene.gravity[0].hypot(scene.gravity[1]);
    let diameter = scene.material.grain().0;
    let fall = scene.columns.iter().map(|column| free_fall(scene, column)).fold(0.0, f64::max);
    let speed =
        scene.columns.iter().map(|c| c.velocity[0].hypot(c.velocity[1])).fold(0.0, f64::max);
    let flights = scene.columns.iter().map(|column| {
        let rises = column.velocity[1];
        (rises + (rises * rises + 2.0 * gravity * free_fall(scene, column)).sqrt()) / gravity
    });
    let left = scene.duration - flights.fold(0.0, f64::max);
    let tops = scene.obstacles.iter().map(|obstacle| obstacle.place.end()[1].min(height));
    let covered: f64 = scene.columns.iter().map(|column| column.place.size[0]).sum();
    let room = (scene.domain.size[0] - covered).max(0.0);
    let friction = scene.material.grains().map_or(USUAL_FRICTION, |grains| grains.friction);
    [
        (diameter / height).ln(),
        aspect(scene).ln(),
        (fall / height).ln_1p(),
        (0.5 * speed * speed / (gravity * height)).ln_1p(),
        tops.fold(0.0, f64::max) / height,
        (-gap_to_barriers(scene) / height).exp(),
        (scene.columns.len().min(MANY) - 1) as f64,
        (room / height).ln_1p(),
        (friction.max(SMOOTH) / USUAL_FRICTION).ln(),
        coefficient(scene.domain.walls.bottom),
        (left * (gravity / height).sqrt()).max(LEAST_TIME).ln(),
        (candidate.cell / height).ln(),
        candidate.packings.map_or(0.0, |[discs, _]| (discs as f64 / 64.0).ln()),
        candidate.size.ln(),
    ]
}

/// The terms of the regression: the features, the logarithm of the energy of falls and throws over `g H`, and the time
/// until rest.
pub(super) fn terms(features: &Features) -> [f64; TERMS] {
    let &[
        grain,
        aspect,
        fall,
        speed,
        barriers,
        nearness,
        columns,
        room,
        friction,
        floor,
        time,
        cell,
        packing,
        size,
    ] = features;
    let energy = (fall.exp() + speed.exp() - 1.0).ln();
    let until_rest = time.min(COLLAPSE.ln());
    [
        grain, energy, aspect, until_rest, cell, packing, size, fall, speed, barriers, nearness,
        columns, room, friction, floor, time,
    ]
}

/// Height over half of the width of the highest column, over all of it at a wall: what flows in one direction.
fn aspect(scene: &Scene) -> f64 {
    let highest = scene.columns.iter().max_by(|a, b| a.place.size[1].total_cmp(&b.place.size[1]));
    let Some(Column { place, .. }) = highest else { return 1.0 };
    let tolerance = 0.5 * scene.domain.spacing();
    let at_wall = place.corner[0] < tolerance || place.end()[0] > scene.domain.size[0] - tolerance;
    place.size[1] / (if at_wall { 1.0 } else { 0.5 } * place.size[0])
}

/// Height (m) that a column falls before it meets the floor, an obstacle or another column.
fn free_fall(scene: &Scene, column: &Column) -> f64 {
    let bottom = column.place.corner[1];
    let (from, to) = (column.place.corner[0], column.place.end()[0]);
    let boxes = scene.obstacles.iter().map(|obstacle| obstacle.place);
    let others = boxes.chain(scene.columns.iter().map(|other| other.place));
    let below = others
        .filter(|place| place.end()[1] <= bottom && place.corner[0] < to && place.end()[0] > from);
    bottom - below.map(|place| place.end()[1]).fold(0.0, f64::max)
}

/// Least horizontal gap (m) between a column and an obstacle; infinite without obstacles.
fn gap_to_barriers(scene: &Scene) -> f64 {
    let gap = |a: &Rectangle, b: &Rectangle| {
        let beside = (b.corner[0] - a.end()[0]).max(a.corner[0] - b.end()[0]);
        beside.max(0.0)
    };
    let columns = scene.columns.iter().map(|column| &column.place);
    let pairs = columns.flat_map(|place| scene.obstacles.iter().map(move |o| (place, &o.place)));
    pairs.map(|(place, obstacle)| gap(place, obstacle)).fold(f64::INFINITY, f64::min)
}

fn coefficient(friction: Friction) -> f64 {
    match friction {
        Friction::Slip => 0.0,
        Friction::Coulomb(coefficient) => coefficient.min(1.0),
        Friction::Stick => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::super::candidate::candidates;
    use super::*;

    fn of(text: &str, candidate: usize) -> Features {
        let scene = Scene::parse(text, "test.toml").unwrap();
        features(&scene, &candidates(&scene)[candidate])
    }

    fn named(features: &Features, name: &str) -> f64 {
        features[NAMES.iter().position(|other| *other == name).unwrap()]
    }

    const COLUMN: &str =
        "duration = 1.0\nmaterial.kind = \"discs\"\n[domain]\nsize = [4.0, 4.0]\n[[column]]\n";

    #[test]
    fn a_column_at_rest_has_the_numbers_of_its_shape() {
        let found = of(&format!("{COLUMN}size = [1.0, 2.0]"), 1);
        for (name, value) in [
            ("grain", (7.5e-3_f64 / 2.0).ln()),
            ("aspect", 2.0_f64.ln()),
            ("fall", 0.0),
            ("speed", 0.0),
            ("barriers", 0.0),
            ("nearness", 0.0),
            ("columns", 0.0),
            ("room", 2.5_f64.ln()),
            ("friction", 0.0),
            ("floor", 0.5),
            ("time", 0.5 * (9.81_f64 / 2.0).ln()),
            ("cell", (0.125_f64 / 2.0).ln()),
            ("size", 2.0_f64.ln()),
        ] {
            assert!((named(&found, name) - value).abs() < 1e-12, "{name}: {found:?}");
        }
    }

    #[test]
    fn barriers_count_the_more_the_nearer_they_are() {
        let column = format!("{COLUMN}corner = [1.0, 0.0]\nsize = [1.0, 2.0]\n");
        let nearness = |boxes: &str| named(&of(&format!("{column}{boxes}"), 0), "nearness");
        let [left, right] =
            [0.25, 3.0].map(|x| format!("[[obstacle]]\ncorner = [{x}, 0.0]\nsize = [0.5, 0.25]\n"));
        // 0.25 m to the left, 1 m to the right; H = 2 m.
        assert!((nearness(&left) - (-0.125_f64).exp()).abs() < 1e-12);
        assert!((nearness(&right) - (-0.5_f64).exp()).abs() < 1e-12);
        assert_eq!(nearness(&format!("{right}{left}")), nearness(&left));
    }

    #[test]
    fn falls_are_measured_to_what_is_below() {
        let fall =
            format!("{COLUMN}corner = [1.0, 1.5]\nsize = [1.0, 1.0]\nvelocity = [3.0, 4.0]\n");
        let found = of(&fall, 0);
        assert!((named(&found, "fall") - 2.5_f64.ln()).abs() < 1e-12);
        assert!((named(&found, "speed") - (1.0 + 25.0_f64 / 19.62).ln()).abs() < 1e-12);
        // Free on both sides: half of the width.
        assert!((named(&found, "aspect") - 2.0_f64.ln()).abs() < 1e-12);
        let onto = of(&format!("{fall}[[obstacle]]\ncorner = [1.5, 0.0]\nsize = [1.0, 0.5]\n"), 0);
        assert!((named(&onto, "fall") - 2.0_f64.ln()).abs() < 1e-12);
        assert_eq!((named(&onto, "barriers"), named(&onto, "nearness")), (0.5, 1.0));
        // It rises at 4 m/s and meets the floor after (4 + sqrt(16 + 2 g 1.5)) / g.
        let flight = (4.0 + (16.0 + 3.0 * 9.81_f64).sqrt()) / 9.81;
        let left = LEAST_TIME.max((1.0 - flight) * 9.81_f64.sqrt());
        assert!((named(&found, "time") - left.ln()).abs() < 1e-12);
    }
}
