//! Checks on steps: frames, waves, velocities.

use mpm::{Basis, Transfer};

use super::estimate::{COURANT, CROSSING};
use super::geometry::whole;
use super::log::Log;
use super::model::{Material, Scene};
use super::problem::Problem;

/// Relaxation of FLIP towards PIC (1/s) beyond which it changes the deposit.
const VISCOUS_RATE: f64 = 10.0;
/// Most macro steps of a run.
const MAX_STEPS: f64 = 1.0e10;

pub(super) fn validate(scene: &Scene, log: &Log) {
    if matches!(scene.material, Material::Discs(_)) {
        // The step is only that at which a plate moves on; the DEM has its own.
        frames(scene, log);
    } else if step(scene, log) {
        // Problems that follow from an unstable step would only hide it.
        frames(scene, log);
        transfer(scene, log);
        density(scene, log);
    }
}

fn frames(scene: &Scene, log: &Log) {
    let Scene { duration, step, frame_interval, .. } = *scene;
    let steps = frame_interval / step;
    if whole(steps).is_none_or(|n| n == 0) {
        let near = steps.round().max(1.0) * step;
        log.report(
            Problem::error("a frame is not a whole number of steps")
                .at(log.place("frame_interval"), format!("{steps:.6} steps of {step:?} s"))
                .at(log.place("step"), "the step")
                .help(format!("nearest: frame_interval = {near:?}")),
        );
    }
    let frames = duration / frame_interval;
    if whole(frames).is_none_or(|n| n == 0) {
        let near = frames.round().max(1.0) * frame_interval;
        log.report(
            Problem::error("the duration is not a whole number of frames")
                .at(log.place("duration"), format!("{frames:.6} frames of {frame_interval:?} s"))
                .at(log.place("frame_interval"), "time between frames")
                .help(format!("nearest: duration = {near:?}")),
        );
    }
    if duration / step > MAX_STEPS {
        log.report(
            Problem::error(format!("{:.3e} steps are too many", duration / step))
                .at(log.place("duration"), "seconds")
                .at(log.place("step"), "seconds"),
        );
    }
}

/// Whether the step is stable for elastic waves; also reports too fast initial velocities.
fn step(scene: &Scene, log: &Log) -> bool {
    let speed = scene.material.wave_speed();
    let limit = scene.step_limit();
    let cell = scene.domain.cell;
    let stable = scene.step <= limit;
    if !stable {
        let mut help = format!(
            "seconds; at most {COURANT} of the time that a wave needs through a cell: {:.2e} s",
            rounded_down(limit)
        );
        if let Material::Rve(rve) = &scene.material {
            help += &format!(
                ". The DEM takes steps of {:.1e} s within each macro step",
                rve.parameters.grains.step()
            );
        }
        log.report(
            Problem::error(format!("step = {} s is unstable", scene.step))
                .at(
                    log.place("step").or(log.place("domain.cell")),
                    format!(
                        "waves travel at {speed:.0} m/s and cross a cell of {cell} m in {:.1e} s",
                        cell / speed
                    ),
                )
                .help(help),
        );
    }
    let bodies = scene.columns.iter().enumerate();
    let columns = bodies.map(|(k, column)| (format!("column[{k}].velocity"), column.velocity));
    let plate = scene.plate.iter().map(|plate| ("plate.velocity".to_owned(), plate.velocity));
    for (path, [u, v]) in columns.chain(plate) {
        let moved = u.hypot(v) * scene.step / cell;
        if moved > CROSSING {
            log.report(
                Problem::error(format!("{:.4} m/s is too fast for the step", u.hypot(v)))
                    .at(log.place(&path), format!("{moved:.2} cells in one step"))
                    .help(format!(
                        "m/s; at most {CROSSING} cells a step: {:.4} m/s with this step, or a shorter step",
                        CROSSING * cell / scene.step
                    )),
            );
        }
    }
    stable
}

/// A number with three digits that is no larger, so that it is allowed where a limit is.
fn rounded_down(limit: f64) -> f64 {
    let unit = 10_f64.powf(limit.log10().floor() - 2.0);
    (limit / unit).floor() * unit
}

fn density(scene: &Scene, log: &Log) {
    let rate = scene.numerics.density_correction;
    if rate * scene.step > 1.0 {
        log.report(
            Problem::error(format!("density_correction = {rate} is faster than one step"))
                .at(log.place("numerics.density_correction"), "1/s")
                .help(format!("a rate per second, at most 1 / step = {:.0}", 1.0 / scene.step)),
        );
    }
}

fn transfer(scene: &Scene, log: &Log) {
    if let Transfer::FlipApic { rate } | Transfer::Flip { rate } = scene.numerics.transfer
        && rate * scene.step > 1.0
    {
        log.report(
            Problem::error(format!("relaxation = {rate} is faster than one step"))
                .at(log.place("numerics.relaxation"), "1/s")
                .help(format!(
                    "a rate per second, at most 1 / step = {:.0}; transfer = \"apic\" or \"pic\" is \
                     the limit",
                    1.0 / scene.step
                )),
        );
    }
    let cell = scene.domain.cell;
    let doubt = match scene.numerics.transfer {
        Transfer::Pic => Some((
            "transfer = \"pic\" stops all motion".to_owned(),
            format!("a viscosity of {:.2} m²/s with this step", cell * cell / (4.0 * scene.step)),
        )),
        Transfer::Apic => Some((
            "transfer = \"apic\" does not converge in the step".to_owned(),
            "the shorter the step, the more it dissipates".to_owned(),
        )),
        Transfer::Flip { rate } if rate > VISCOUS_RATE => Some((
            format!("transfer = \"flip\" with relaxation = {rate} is viscous"),
            format!("a viscosity of {:.2} m²/s", rate * cell * cell / 4.0),
        )),
        Transfer::Flip { .. } | Transfer::FlipApic { .. } => None,
    };
    if let Some((message, label)) = doubt {
        log.report(
            Problem::warning(message)
                .at(log.place("numerics.transfer"), label)
                .help("\"flip-apic\" (the default) is quiet and converges in the step"),
        );
    }
    if scene.numerics.basis == Basis::Linear {
        log.report(
            Problem::warning("linear basis functions are for tests only")
                .at(log.place("numerics.basis"), "forces jump when a point crosses a cell face")
                .help("no fixed step is safe with them; \"quadratic\" is the default"),
        );
    }
}
