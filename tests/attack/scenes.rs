//! Random legal scenes over all keys: each runs, or ends with an error that says why.

use std::cell::Cell;
use std::fmt::Write;
use std::fs;
use std::time::Duration;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use crate::campaign::{Attack, Finding, Promise, campaign};
use crate::program::program;

/// Some legal scenes take for ever to prepare: after this time Ctrl-C has to end it.
const PATIENCE: Duration = Duration::from_secs(2);

#[test]
fn random_scenes() {
    let simulated = Cell::new(0);
    campaign("random_scenes", |attack| {
        fs::write(attack.folder.join("scene.toml"), scene(&mut attack.rng)).unwrap();
        let run = program("dempm run scene.toml -o out.h5 --device cpu", &attack.folder);
        let ended = run.interrupted_after(PATIENCE).run();
        ended.is_sound()?;
        if attack.folder.join("out.h5").exists() {
            simulated.set(simulated.get() + 1);
            opens(attack)?;
        }
        Ok(())
    });
    println!("random_scenes: {} of them were simulated", simulated.get());
}

/// What was written can be read, and holds numbers.
fn opens(attack: &Attack) -> Result<(), Finding> {
    let info = program("dempm info out.h5", &attack.folder).run();
    info.is_sound()?;
    let moving =
        info.stdout.lines().filter(|l| l.starts_with("position") || l.starts_with("velocity"));
    let lost = |line: &str| line.contains("NaN") || line.contains("inf");
    if !info.succeeded() || moving.clone().count() != 4 || moving.clone().any(lost) {
        return Promise::NothingLost.broken(info.report("the trajectory of a random scene"));
    }
    Ok(())
}

/// One of some.
fn one<'a>(options: &[&'a str], rng: &mut ChaCha8Rng) -> &'a str {
    options[rng.random_range(0..options.len())]
}

/// Near a usual value, or far from it; within limits.
fn about(usual: f64, low: f64, high: f64, rng: &mut ChaCha8Rng) -> f64 {
    let decades = if rng.random_ratio(1, 8) { 6.0 } else { 0.3 };
    let factor = 10_f64.powf(rng.random_range(-decades..=decades));
    (usual * factor).clamp(low, high)
}

/// Anything between limits.
fn within(low: f64, high: f64, rng: &mut ChaCha8Rng) -> f64 {
    if rng.random_ratio(1, 10) {
        [low, high][rng.random_range(0..2)]
    } else {
        rng.random_range(low..=high)
    }
}

/// A rectangle of whole cells in the domain.
fn rectangle([columns, rows]: [u32; 2], cell: f64, rng: &mut ChaCha8Rng) -> String {
    let [x, y] = [columns, rows].map(|count| rng.random_range(0..count));
    let width = rng.random_range(1..=(columns - x).min(3));
    let height = rng.random_range(1..=(rows - y).min(3));
    let [x, y, width, height] = [x, y, width, height].map(|count| f64::from(count) * cell);
    format!("corner = [{x:?}, {y:?}]\nsize = [{width:?}, {height:?}]\n")
}

/// Friction of four faces.
fn faces(rng: &mut ChaCha8Rng) -> String {
    let mut face = |name| {
        let words = ["\"slip\"", "\"stick\"", "0.0", "0.3", "10.0"];
        format!("{name} = {}", one(&words, rng))
    };
    format!("{{ {}, {}, {}, {} }}", face("left"), face("right"), face("bottom"), face("top"))
}

fn pair(most: f64, rng: &mut ChaCha8Rng) -> String {
    format!("[{:?}, {:?}]", within(-most, most, rng), within(-most, most, rng))
}

/// Appends `key = value` for some of the keys.
fn some(text: &mut String, keys: &[(&str, f64, f64, f64)], rng: &mut ChaCha8Rng) {
    for &(key, usual, low, high) in keys {
        if rng.random_ratio(1, 3) {
            writeln!(text, "{key} = {:?}", about(usual, low, high, rng)).unwrap();
        }
    }
}

/// A scene of a few cells and frames, of which most are legal.
fn scene(rng: &mut ChaCha8Rng) -> String {
    let cells = [0; 2].map(|_| rng.random_range(3..10_u32));
    let cell = [0.0625, 0.125, 0.125, 0.125, 0.25, 1.0][rng.random_range(0..6)];
    let [width, height] = cells.map(|count| f64::from(count) * cell);
    let step = [1.0e-5, 1.0e-4, 1.0e-4, 2.0e-4][rng.random_range(0..4)];
    let steps = rng.random_range(1..20_u32);
    let frames = rng.random_range(1..6_u32);
    let mut text = String::new();
    let line =
        |text: &mut String, key: &str, value: &str| writeln!(text, "{key} = {value}").unwrap();

    let titles = ["", "Column", "Säule 砂", "a\\u001b[31m\\u0007", "\\n\\t", "x"];
    line(&mut text, "title", &format!("\"{}\"", one(&titles, rng)));
    line(&mut text, "seed", &rng.random::<u32>().to_string());
    if rng.random_ratio(1, 3) {
        let most = [0.0, 10.0, 1000.0][rng.random_range(0..3)];
        line(&mut text, "gravity", &pair(most, rng));
    }
    line(&mut text, "step", &format!("{step:?}"));
    line(&mut text, "frame_interval", &format!("{:?}", step * f64::from(steps)));
    line(&mut text, "duration", &format!("{:?}", step * f64::from(steps) * f64::from(frames)));

    text += "[domain]\n";
    line(&mut text, "size", &format!("[{width:?}, {height:?}]"));
    line(&mut text, "cell", &format!("{cell:?}"));
    line(&mut text, "points_per_cell", &rng.random_range(1..4).to_string());
    line(&mut text, "point_layout", one(&["\"staggered\"", "\"square\""], rng));
    line(&mut text, "walls", &faces(rng));

    for _ in 0..[1, 1, 1, 2][rng.random_range(0..4)] {
        text += "[[column]]\n";
        text += &rectangle(cells, cell, rng);
        if rng.random_ratio(1, 3) {
            let most = [0.5, 10.0, 1000.0][rng.random_range(0..3)];
            line(&mut text, "velocity", &pair(most, rng));
        }
    }
    if rng.random_ratio(1, 4) {
        text += "[[obstacle]]\n";
        text += &rectangle(cells, cell, rng);
        line(&mut text, "faces", &faces(rng));
    }
    if rng.random_ratio(1, 4) {
        text += "[plate]\n";
        text += &rectangle(cells, cell, rng);
        line(&mut text, "velocity", &pair(10.0, rng));
        line(&mut text, "start", &format!("{:?}", within(0.0, 1.0e-2, rng)));
        line(&mut text, "faces", &faces(rng));
    }
    text += &material(rng);

    text += "[numerics]\n";
    let choices: [(&str, &[&str]); 5] = [
        ("basis", &["\"quadratic\"", "\"gimp\"", "\"cubic\"", "\"linear\""]),
        ("scheme", &["\"musl\"", "\"usl\"", "\"usf\""]),
        ("transfer", &["\"flip-apic\"", "\"flip\"", "\"apic\"", "\"pic\""]),
        ("wall_contact", &["\"nodes\"", "\"points\""]),
        ("cell_average", &["true", "false"]),
    ];
    for (key, options) in choices {
        if rng.random_ratio(1, 3) {
            line(&mut text, key, one(options, rng));
        }
    }
    some(&mut text, &[("relaxation", 500.0, 0.0, 5000.0)], rng);
    some(&mut text, &[("density_correction", 10.0, 0.0, 1000.0)], rng);
    let fields =
        ["[]", "[\"stress\"]", "[\"coordination\", \"inertial_number\"]", "[\"solid_fraction\"]"];
    if rng.random_ratio(1, 3) {
        text += "[output]\n";
        line(&mut text, "fields", one(&fields, rng));
    }
    text
}

/// The tables of the material.
fn material(rng: &mut ChaCha8Rng) -> String {
    let kind = one(&["rve", "rve", "mu-i", "elastic"], rng);
    let mut text =
        format!("[material]\nkind = \"{kind}\"\npackings = {}\n", rng.random_range(1..4));
    for (key, options) in [
        ("precision", ["\"f32\"", "\"f64\""]),
        ("neighbours", ["\"usual\"", "\"ample\""]),
        ("initial_stress", ["\"ladder\"", "\"none\""]),
    ] {
        if rng.random_ratio(1, 3) {
            writeln!(text, "{key} = {}", one(&options, rng)).unwrap();
        }
    }
    let tiny = f64::MIN_POSITIVE;
    match kind {
        "rve" => {
            text += "[grains]\n";
            let keys = [
                ("radius_min", 2.5e-3, tiny, 0.5),
                ("radius_max", 5.0e-3, tiny, 0.5),
                ("grain_density", 2650.0, tiny, 1.0e5),
                ("thickness", 7.5e-3, tiny, 10.0),
                ("normal_stiffness", 1.0e5, tiny, 1.0e12),
                ("tangential_stiffness", 1.0e5, tiny, 1.0e12),
                ("friction", 0.5, 0.0, 10.0),
                ("rolling_friction", 0.1, 0.0, 10.0),
                ("rolling_stiffness", 1.0e5, tiny, 1.0e12),
                ("damping_ratio", 0.2, 0.0, 1.0),
                ("local_damping", 0.1, 0.0, 0.9),
                ("mass_scale", 1.0, 1.0, 1.0e6),
                ("step_factor", 0.2, 0.005, 0.5),
                ("skin", 0.3, 0.01, 2.0),
                ("overlap_warning", 0.15, tiny, 2.0),
                ("overlap_limit", 1.0, tiny, 2.0),
                ("preparation_friction", 1.0e-2, 0.0, 10.0),
            ];
            some(&mut text, &keys, rng);
            write!(text, "[rve]\ndiscs = {}\n", rng.random_range(4..30)).unwrap();
            writeln!(text, "kinetic_stress = {}", rng.random::<bool>()).unwrap();
            let keys = [
                ("stress_window", 0.5, 1.0e-6, 1.0),
                ("free_solid_fraction", 0.7, 0.0, 0.78),
                ("thin_width", 3.0, 0.0, 20.0),
            ];
            some(&mut text, &keys, rng);
            if rng.random_ratio(1, 3) {
                text += "[rve.preparation]\n";
                let keys = [
                    ("pressure", 2.0e3, 1.0, 1.0e9),
                    ("cloud_solid_fraction", 0.3, 0.01, 0.45),
                    ("local_damping", 0.2, 0.0, 0.9),
                    ("ladder_rate", 0.02, tiny, 1.0),
                    ("lateral_strain", 1.0, 0.0, 1.0),
                ];
                some(&mut text, &keys, rng);
            }
        }
        "mu-i" => {
            text += "[mu-i]\n";
            let keys = [
                ("density", 2173.0, tiny, 1.0e5),
                ("bulk_modulus", 6.0e6, tiny, 1.0e12),
                ("shear_modulus", 4.7e6, tiny, 1.0e12),
                ("static_friction", 0.28, 0.0, 0.99),
                ("dynamic_friction", 0.8, 0.0, 0.99),
                ("inertial_number", 0.35, tiny, 1.0e3),
                ("grain_diameter", 7.5e-3, tiny, 0.5),
                ("grain_density", 2650.0, tiny, 1.0e5),
            ];
            some(&mut text, &keys, rng);
        }
        _ => {
            text += "[elastic]\n";
            let keys = [
                ("density", 2173.0, tiny, 1.0e5),
                ("young_modulus", 1.0e7, tiny, 1.0e12),
                ("poisson_ratio", 0.2, -0.99, 0.49),
            ];
            some(&mut text, &keys, rng);
        }
    }
    text
}
