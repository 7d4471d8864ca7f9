//! Checks on steps: frames, waves, velocities, discs.

use dem::RveParameters;
use mpm::{Basis, Transfer};

use super::estimate::{COURANT, CROSSING};
use super::geometry::whole;
use super::log::Log;
use super::model::{Material, Rve, Scene};
use super::problem::Problem;

/// More DEM steps than this in a macro step can only be a mistake.
const MAX_SUBSTEPS: f64 = 1.0e4;
/// Relaxation of FLIP towards PIC (1/s) beyond which it changes the deposit.
const VISCOUS_RATE: f64 = 10.0;
/// Largest step of packings that may form lattices of equal discs, in `sqrt(m_min / kn)`: their
/// spins in phase have `omega² = 24 kt / m`, so `2 / omega` is 0.41.
const LATTICE_STEP: f64 = 0.4;
/// Width of cells (mean diameters) below which discs cannot pass each other: `sin phi` was measured to
/// jump from 0.3 to 0.7 and more.
const LOCKED: f64 = 2.0;
/// Relative difference of radii below which discs form lattices.
const EQUAL: f64 = 0.1;
/// Most macro steps of a run.
const MAX_STEPS: f64 = 1.0e10;

pub(super) fn validate(scene: &Scene, log: &Log) {
    // Problems that follow from an unstable step would only hide it.
    if step(scene, log) {
        frames(scene, log);
        transfer(scene, log);
    }
    if let Material::Rve(rve) = &scene.material {
        discs(scene, rve, log);
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
            "seconds; at most {COURANT} of the time that a wave needs through a cell: {limit:.1e} s"
        );
        if let Material::Rve(rve) = &scene.material {
            help += &format!(
                ". The DEM takes steps of {:.1e} s within each macro step; 1.0e-4 s is usual",
                rve.parameters.step()
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

fn transfer(scene: &Scene, log: &Log) {
    if let Transfer::FlipApic { rate } | Transfer::Flip { rate } = scene.numerics.transfer
        && rate * scene.step > 1.0
    {
        log.report(
            Problem::error(format!("relaxation = {rate} is faster than one step"))
                .at(log.place("numerics.relaxation"), "1/s")
                .help(format!(
                    "a rate per second, at most 1 / step = {}; transfer = \"apic\" or \"pic\" is \
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

fn discs(scene: &Scene, rve: &Rve, log: &Log) {
    let p = &rve.parameters;
    let place = |key: &str| log.place(&format!("rve.{key}"));
    if p.radius_min > p.radius_max {
        log.report(
            Problem::error("the smallest radius is larger than the largest")
                .at(place("radius_min"), format!("radius_min = {} m", p.radius_min))
                .at(place("radius_max"), format!("radius_max = {} m", p.radius_max))
                .help(
                    "radii are uniform between radius_min and radius_max; equal radii are allowed",
                ),
        );
        return;
    }
    // In a narrower cell a disc meets several images of a neighbour even before it deforms.
    let needed = 2.0 * (2.0 + p.skin) * p.radius_max;
    if rve.side() < needed {
        let discs = (p.discs as f64 * (needed / rve.side()).powi(2)).ceil();
        log.report(
            Problem::error(format!("{} discs are too few", p.discs))
                .at(
                    place("discs").or(place("radius_max")),
                    format!(
                        "the RVE is {:.3} m wide; discs that see each other need {needed:.3} m",
                        rve.side()
                    ),
                )
                .help(format!("at least {discs} discs of these radii; 400 is usual")),
        );
    } else if p.discs < 100 {
        log.report(
            Problem::warning(format!("{} discs make a noisy material", p.discs))
                .at(place("discs"), "the stress ratio scatters by about 0.7 / sqrt(discs)")
                .help("200 are enough for a first look, 400 for results"),
        );
    }
    packing_step(p, log);
    strength(p, log);
    if p.overlap_limit < p.overlap_warning {
        log.report(
            Problem::warning("the run ends at a smaller overlap than it would warn at")
                .at(place("overlap_limit"), "overlap_limit")
                .at(place("overlap_warning"), "overlap_warning")
                .help("overlap_limit is normally the larger one"),
        );
    }
    let substeps = scene.step / p.step();
    if substeps > MAX_SUBSTEPS {
        log.report(
            Problem::error(format!("{substeps:.3e} DEM steps in a macro step are too many"))
                .at(
                    place("radius_min").or(place("normal_stiffness")),
                    format!("the DEM step is {:.1e} s with these discs and stiffnesses", p.step()),
                )
                .help("check the units: radii in m, stiffnesses in N/m, step in s"),
        );
    }
}

/// Largest DEM step with a dashpot, in `sqrt(m_min / kn)`. A velocity that lags half a step behind
/// lowers the limit of a mode to `(2 / omega)(sqrt(1 + xi²) - xi)`; the mode is a light disc that
/// six neighbours hold, `omega² = 3 kn / m`, `xi = zeta sqrt(3/2)`. Packings were measured to become
/// unstable at 0.77 to 1 of it.
fn damped_step(zeta: f64) -> f64 {
    let xi = zeta * 1.5_f64.sqrt();
    0.75 * 2.0 / 3.0_f64.sqrt() * (xi.hypot(1.0) - xi)
}

/// Checks the stability of packings with the DEM step of the scene.
fn packing_step(p: &RveParameters, log: &Log) {
    let place = |key: &str| log.place(&format!("rve.{key}"));
    let equal = p.radius_min > (1.0 - EQUAL) * p.radius_max;
    let (limit, key, why) = if equal && LATTICE_STEP < damped_step(p.damping_ratio) {
        (LATTICE_STEP, "radius_min", "discs of equal radii form lattices, unstable beyond 0.41")
    } else {
        (damped_step(p.damping_ratio), "damping_ratio", "a strong dashpot needs a shorter step")
    };
    if p.step_factor > limit {
        log.report(
            Problem::warning(format!("step_factor = {} may be unstable", p.step_factor))
                .at(place("step_factor"), "packings may gain energy by themselves")
                .at(place(key), why)
                .help(format!("at most {limit:.2}; 0.2 is safe")),
        );
    }
}

/// Warns of settings that make packings stronger than real ones.
fn strength(p: &RveParameters, log: &Log) {
    let place = |key: &str| log.place(&format!("rve.{key}"));
    if p.mass_scale > 1.0 {
        log.report(
            Problem::warning(format!("mass_scale = {} makes flow stronger", p.mass_scale))
                .at(
                    place("mass_scale"),
                    format!("inertial numbers are {:.1} times as large", p.mass_scale.sqrt()),
                )
                .help("1 is physical; a scaled mass is harmless in slow motion only"),
        );
    }
    if p.thin_width < LOCKED {
        log.report(
            Problem::warning(format!("thin_width = {} lets packings lock", p.thin_width))
                .at(place("thin_width"), "mean diameters")
                .help(format!("in cells thinner than {LOCKED} discs cannot pass each other")),
        );
    }
    if p.local_damping > 0.0 {
        log.report(
            Problem::warning(format!("local_damping = {} makes flow stronger", p.local_damping))
                .at(place("local_damping"), "friction of fast flow grows by up to a half")
                .help("damping_ratio (the dashpot of contacts) leaves the strength as it is"),
        );
    }
}
