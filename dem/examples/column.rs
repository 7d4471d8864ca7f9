//! Collapse of a column of some 2000 discs: the side of `validation/yade` that this crate computes.
//!
//! `cargo run --release -p dem --example column -- DIRECTORY SEED` prepares the column and writes
//! `start.csv`, `grains.json` and, for three perturbations of the start, `dem-K.csv` (time series) and
//! `dem-K-end.csv` (grains).

use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::Path;

use dem::Grains;
use dem::assembly::{
    Assembly, Boundary, ColumnBox, Faces, Floor, GrainState, Packed, on_cpu, prepare_column,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const SIDE: f64 = 0.33;
const GRAVITY: [f64; 2] = [0.0, -9.81];
/// Duration and time between two samples (s).
const DURATION: f64 = 1.2;
const SAMPLING: f64 = 0.02;
const PERTURBATIONS: u64 = 3;
/// Of each coordinate of a start (m).
const PERTURBATION: f64 = 1.0e-9;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, directory, seed] = arguments.as_slice() else {
        return Err("usage: column DIRECTORY SEED".into());
    };
    let directory = Path::new(directory);
    fs::create_dir_all(directory)?;
    let seed: u64 = seed.parse()?;
    let grains = Grains::default();
    let boundary = Boundary {
        size: [1.5, 0.6],
        walls: Faces::default(),
        floor: Floor::Rough,
        boxes: vec![],
        seed,
    };
    let place = ColumnBox { corner: [0.0, 0.0], size: [SIDE, SIDE], loaded: true };
    let mut start = prepare_column::<f64>(&grains, &boundary, GRAVITY, &place, seed, &mut on_cpu)?;
    // Both codes begin without tangential springs.
    start.contacts.clear();
    write_start(directory, &grains, &boundary, &start)?;
    for perturbation in 1..=PERTURBATIONS {
        collapse(directory, &grains, &boundary, &start, perturbation)?;
    }
    Ok(())
}

fn write_start(
    directory: &Path,
    grains: &Grains,
    boundary: &Boundary,
    start: &Packed,
) -> Result<(), Box<dyn Error>> {
    let mut rows = String::from("x,y,r,fixed\n");
    for grain in &start.grains {
        writeln!(rows, "{},{},{},0", grain.x[0], grain.x[1], grain.r)?;
    }
    for ([x, y], r) in boundary.floor_grains(grains) {
        writeln!(rows, "{x},{y},{r},1")?;
    }
    fs::write(directory.join("start.csv"), rows)?;
    let Grains { normal_stiffness: kn, tangential_stiffness: kt, .. } = grains;
    let Grains { friction, damping_ratio, grain_density, thickness, radius_max, .. } = grains;
    let dt = grains.step();
    let json = format!(
        r#"{{"normal_stiffness": {kn}, "tangential_stiffness": {kt}, "friction": {friction},
"damping_ratio": {damping_ratio}, "grain_density": {grain_density}, "thickness": {thickness},
"radius_max": {radius_max}, "dt": {dt}, "duration": {DURATION}, "sampling": {SAMPLING}}}
"#
    );
    fs::write(directory.join("grains.json"), json)?;
    Ok(())
}

fn collapse(
    directory: &Path,
    grains: &Grains,
    boundary: &Boundary,
    start: &Packed,
    perturbation: u64,
) -> Result<(), Box<dyn Error>> {
    let mut rng = ChaCha8Rng::seed_from_u64(perturbation);
    let mut start = start.clone();
    for grain in &mut start.grains {
        grain.x = grain.x.map(|x| x + rng.random_range(-PERTURBATION..PERTURBATION));
    }
    let dt = grains.step();
    let mut assembly = Assembly::<f64>::new(grains, boundary, GRAVITY, dt, &start)?;
    let steps = (SAMPLING / dt).round() as usize;
    let mut rows = String::from("time,front,kinetic,potential\n");
    for _ in 0..=(DURATION / SAMPLING).round() as usize {
        let energy = assembly.energy();
        let front = front(&assembly.states());
        writeln!(rows, "{},{front},{},{}", assembly.time(), energy.kinetic, energy.potential)?;
        assembly.advance(steps)?;
    }
    fs::write(directory.join(format!("dem-{perturbation}.csv")), rows)?;
    let mut end = String::from("x,y,r\n");
    for grain in assembly.states() {
        writeln!(end, "{},{},{}", grain.x[0], grain.x[1], grain.r)?;
    }
    fs::write(directory.join(format!("dem-{perturbation}-end.csv")), end)?;
    Ok(())
}

/// The foremost position that 99 % of the mass stays behind (m).
fn front(states: &[GrainState]) -> f64 {
    let mut places: Vec<(f64, f64)> = states.iter().map(|s| (s.x[0], s.mass)).collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = places.iter().map(|p| p.1).sum();
    let mut behind = 0.0;
    for (x, mass) in places {
        behind += mass;
        if behind >= 0.99 * total {
            return x;
        }
    }
    f64::NAN
}
