//! Whether grid and material can do what the scene asks of them: resolve the columns, carry their weight,
//! survive their impact, calm their points.

use mpm::Transfer;

use super::log::Log;
use super::model::{Material, Scene};
use super::problem::Problem;

/// Cells over the smaller side of a column: below the first it cannot deform at all, below the second
/// it hardly flows.
const CELLS: (f64, f64) = (1.0, 2.0);
/// Strain by the weight of the tallest column, at its base: above the first it is doubtful that the
/// material stands for grains, above the second it is flattened.
const WEIGHT_STRAIN: (f64, f64) = (0.1, 0.5);
/// Speed of an impact over that of waves, which is the strain of the impact.
const IMPACT_STRAIN: f64 = 0.3;
/// A collapse takes about a second: noise that decays more slowly (1/s) stays.
const CALMING_RATE: f64 = 1.0;

pub(super) fn validate(scene: &Scene, log: &Log) {
    weight(scene, log);
    impact(scene, log);
    if !matches!(scene.material, Material::Discs(_)) {
        resolution(scene, log);
        calming(scene, log);
    }
}

fn resolution(scene: &Scene, log: &Log) {
    let cell = scene.domain.cell;
    for (k, column) in scene.columns.iter().enumerate() {
        let [width, height] = column.place.size;
        let cells = width.min(height) / cell;
        let place = log.place(&format!("column[{k}].size"));
        let label = format!("{cells:.2} cells of {cell} m across");
        let help = "a smaller `cell`; collapses are usually resolved by 8 and more";
        if cells < CELLS.0 {
            log.report(
                Problem::error("the column is smaller than a cell of the grid and cannot flow")
                    .at(place, label)
                    .help(help),
            );
        } else if cells < CELLS.1 {
            log.report(
                Problem::warning("the column is less than two cells across and hardly flows")
                    .at(place, label)
                    .help(help),
            );
        }
    }
}

/// A column of height H compresses by `rho g H / M` at its base.
fn weight(scene: &Scene, log: &Log) {
    let [gx, gy] = scene.gravity;
    let Some(tallest) = scene.columns.iter().map(|c| c.place.size[1]).max_by(f64::total_cmp) else {
        return;
    };
    let speed = scene.material.wave_speed();
    let strain = gx.hypot(gy) * tallest / (speed * speed);
    let message = format!(
        "the weight of a column of {tallest} m compresses its base by {:.0} %",
        100.0 * strain
    );
    let problem = if strain > WEIGHT_STRAIN.1 {
        Problem::error(message)
    } else if strain > WEIGHT_STRAIN.0 {
        Problem::warning(message)
    } else {
        return;
    };
    log.report(
        problem
            .at(log.place(stiffness_key(scene)), format!("waves travel at {speed:.1} m/s"))
            .help("grains compress by less than 1 %: a stiffer material"),
    );
}

/// Falling adds `sqrt(2 g h)`; an impact at speed v compresses by `v / c`.
fn impact(scene: &Scene, log: &Log) {
    let [_, gy] = scene.gravity;
    let speed = scene.material.wave_speed();
    for (k, column) in scene.columns.iter().enumerate() {
        let [u, v] = column.velocity;
        let fallen = (u * u + v * v + 2.0 * gy.abs() * column.place.corner[1]).sqrt();
        if fallen > IMPACT_STRAIN * speed {
            log.report(
                Problem::warning(format!(
                    "column {} hits a wall or the floor at up to {fallen:.1} m/s, which compresses it by \
                     {:.0} %",
                    k + 1,
                    100.0 * fallen / speed
                ))
                .at(log.place(&format!("column[{k}].velocity")), "m/s")
                .at(log.place(stiffness_key(scene)), format!("waves travel at {speed:.1} m/s"))
                .help("a lower speed or height, or a stiffer material"),
            );
        }
    }
}

fn calming(scene: &Scene, log: &Log) {
    if let Transfer::FlipApic { rate } = scene.numerics.transfer
        && rate < CALMING_RATE
    {
        log.report(
            Problem::warning(format!("relaxation = {rate} leaves points in random motion"))
                .at(log.place("numerics.relaxation"), "1/s")
                .help("the default calms points within a tenth of a second"),
        );
    }
}

/// The key that sets the speed of waves.
fn stiffness_key(scene: &Scene) -> &'static str {
    match scene.material {
        Material::Discs(_) | Material::Rve(_) => "grains.normal_stiffness",
        Material::MuI(_) => "mu-i.bulk_modulus",
        Material::Elastic(_) => "elastic.young_modulus",
    }
}
