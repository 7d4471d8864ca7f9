//! Checks on grains and packings.

use dem::Grains;

use super::log::{Log, Place};
use super::model::{Discs, Material, Precision, Rve, Scene};
use super::problem::Problem;

/// More DEM steps than this in a macro step can only be a mistake.
const MAX_SUBSTEPS: f64 = 1.0e4;
/// Largest step of packings that may form lattices of equal discs, in `sqrt(m_min / kn)`: their
/// spins in phase have `omega² = 24 kt / m`, so `2 / omega` is 0.41.
const LATTICE_STEP: f64 = 0.4;
/// Width of cells (mean diameters) below which discs cannot pass each other: `sin phi` was measured to
/// jump from 0.3 to 0.7 and more.
const LOCKED: f64 = 2.0;
/// Smallest side of a column of discs, in mean diameters.
const NARROW: f64 = 4.0;
/// Sides of the squares of points, in mean diameters: below the first a square may stay empty, below the
/// second its mean scatters.
const EMPTY: f64 = 2.0;
const FEW: f64 = 4.0;
/// Most discs of a scene.
const MAX_DISCS: f64 = 1.0e9;
/// Most nodes of a grid for continuum fields.
const MAX_NODES: f64 = 1.0e7;
/// Packings that average over each other's scatter.
const MANY: usize = 16;
/// Relative difference of radii below which discs form lattices.
const EQUAL: f64 = 0.1;

pub(super) fn validate(scene: &Scene, log: &Log) {
    match &scene.material {
        Material::Discs(discs) => {
            if radii(&discs.grains, log) {
                columns(scene, &discs.grains, log);
                stacks(scene, log);
                points(scene, &discs.grains, log);
                count(scene, discs, log);
                resolution(scene, discs, log);
                grid(scene, log);
                grains(&discs.grains, scene.step, log);
            }
        }
        Material::Rve(rve) => {
            if radii(&rve.parameters.grains, log) {
                size(rve, log);
                width(rve, log);
                grains(&rve.parameters.grains, scene.step, log);
            }
        }
        Material::MuI(_) | Material::Elastic(_) => {}
    }
}

/// Refuses grains so light that the last of the 32 bits of a position changes the force of a contact by more than their
/// weight: they do not come to rest.
fn resolution(scene: &Scene, discs: &Discs, log: &Log) {
    let grains = &discs.grains;
    let side = scene.domain.size[0].max(scene.domain.size[1]);
    let force = side / 2.0_f64.powi(32) * grains.normal_stiffness;
    let weight = grains.disc_mass(grains.radius_min) * scene.gravity[0].hypot(scene.gravity[1]);
    if discs.precision == Precision::F32 && 0.0 < weight && weight < force {
        log.report(
            Problem::error("positions in f32 are too coarse for these grains")
                .at(
                    place(log, "radius_min").or(place(log, "normal_stiffness")),
                    format!(
                        "the smallest grain weighs {weight:.1e} N; the last bit of a position in {side} m \
                         is a force of {force:.1e} N"
                    ),
                )
                .help("precision = \"f64\" in [material], or a smaller domain"),
        );
    }
}

/// Refuses a grid of too many nodes.
fn grid(scene: &Scene, log: &Log) {
    let Some(grid) = scene.grid else { return };
    let nodes: f64 = grid.nodes(scene.domain.size).iter().product();
    if nodes > MAX_NODES {
        log.report(
            Problem::error(format!("`output.grid` has {nodes:.1e} nodes"))
                .at(log.place("output.grid.spacing"), format!("a node every {} m", grid.spacing))
                .help(format!("at most {MAX_NODES:e}: a larger spacing or a smaller width")),
        );
    }
}

/// Whether the radii are an interval.
fn radii(grains: &Grains, log: &Log) -> bool {
    let Grains { radius_min, radius_max, .. } = *grains;
    let ordered = radius_min <= radius_max;
    if !ordered {
        log.report(
            Problem::error("the smallest radius is larger than the largest")
                .at(place(log, "radius_min"), format!("radius_min = {radius_min} m"))
                .at(place(log, "radius_max"), format!("radius_max = {radius_max} m"))
                .help(
                    "radii are uniform between radius_min and radius_max; equal radii are allowed",
                ),
        );
    }
    ordered
}

fn grains(grains: &Grains, step: f64, log: &Log) {
    dem_step(grains, log);
    strength(grains, log);
    if grains.overlap_limit < grains.overlap_warning {
        log.report(
            Problem::warning("the run ends at a smaller overlap than it would warn at")
                .at(place(log, "overlap_limit"), "overlap_limit")
                .at(place(log, "overlap_warning"), "overlap_warning")
                .help("overlap_limit is normally the larger one"),
        );
    }
    let substeps = step / grains.step();
    if substeps > MAX_SUBSTEPS {
        log.report(
            Problem::error(format!("{substeps:.3e} DEM steps in a macro step are too many"))
                .at(
                    place(log, "radius_min").or(place(log, "normal_stiffness")),
                    format!(
                        "the DEM step is {:.1e} s with these discs and stiffnesses",
                        grains.step()
                    ),
                )
                .help("check the units: radii in m, stiffnesses in N/m, step in s"),
        );
    }
}

/// Columns are at least some grains wide and high.
fn columns(scene: &Scene, grains: &Grains, log: &Log) {
    let diameter = grains.mean_diameter();
    for (k, column) in scene.columns.iter().enumerate() {
        let [width, height] = column.place.size;
        let across = width.min(height) / diameter;
        if across < NARROW {
            log.report(
                Problem::error("the column is too small for its grains")
                    .at(
                        log.place(&format!("column[{k}].size")),
                        format!("{across:.1} mean diameters of {diameter} m across"),
                    )
                    .help(format!(
                        "at least {NARROW} mean diameters; smaller grains or a larger column"
                    )),
            );
        }
    }
}

/// Warns of columns that stand on each other: each is prepared for itself.
fn stacks(scene: &Scene, log: &Log) {
    let tolerance = 1.0e-6 * scene.domain.spacing();
    for (k, upper) in scene.columns.iter().enumerate() {
        let ([left, bottom], [right, _]) = (upper.place.corner, upper.place.end());
        let below = scene.columns.iter().position(|lower| {
            let ([from, _], [to, top]) = (lower.place.corner, lower.place.end());
            (bottom - top).abs() < tolerance && right.min(to) - left.max(from) > tolerance
        });
        if let Some(lower) = below {
            log.report(
                Problem::warning(format!("column {} stands on column {}", k + 1, lower + 1))
                    .at(log.place(&format!("column[{k}].corner")), "columns are prepared apart")
                    .help(
                        "the lower one is prepared without the weight of the upper one and settles \
                         when the run begins; where both are as wide, write them as one column",
                    ),
            );
        }
    }
}

/// The squares of points hold enough grains for a mean.
fn points(scene: &Scene, grains: &Grains, log: &Log) {
    let spacing = scene.domain.spacing();
    let across = spacing / grains.mean_diameter();
    let label = format!("squares of {spacing} m are {across:.1} mean diameters wide");
    let place = log.place("domain.cell").or(log.place("domain.size"));
    if across < EMPTY {
        log.report(
            Problem::error("the squares of points may hold no grain").at(place, label).help(
                format!(
                    "at least {EMPTY} mean diameters: a larger `cell` or fewer `points_per_cell`"
                ),
            ),
        );
    } else if across < FEW {
        log.report(
            Problem::warning("the points are means over few grains")
                .at(place, label)
                .help("stresses scatter; eight mean diameters hold some seventy grains"),
        );
    }
}

/// Grains have indices of 32 bits.
fn count(scene: &Scene, discs: &Discs, log: &Log) {
    let count = discs.count_in(scene.point_area() * scene.point_count() as f64);
    if count > MAX_DISCS {
        log.report(
            Problem::error(format!("{count:.3e} discs are too many"))
                .at(place(log, "radius_max").or(log.place("column[0].size")), "their size")
                .help(format!("at most {MAX_DISCS:e}; larger grains or smaller columns")),
        );
    }
}

/// The place of a key of `[grains]`.
fn place(log: &Log, key: &str) -> Option<Place> {
    log.place(&format!("grains.{key}"))
}

/// Checks the number of discs of a packing.
fn size(rve: &Rve, log: &Log) {
    let p = &rve.parameters;
    // In a narrower cell a disc meets several images of a neighbour even before it deforms.
    let needed = 2.0 * (2.0 + p.grains.skin) * p.grains.radius_max;
    if rve.side() < needed {
        let discs = (p.discs as f64 * (needed / rve.side()).powi(2)).ceil();
        log.report(
            Problem::error(format!("{} discs are too few", p.discs))
                .at(
                    log.place("rve.discs").or(place(log, "radius_max")),
                    format!(
                        "the RVE is {:.3} m wide; discs that see each other need {needed:.3} m",
                        rve.side()
                    ),
                )
                .help(format!("at least {discs} discs of these radii; 400 is usual")),
        );
    } else if p.discs < 100 && rve.packings < MANY {
        let packings =
            if rve.packings == 1 { "1 packing" } else { &format!("{} packings", rve.packings) };
        log.report(
            Problem::warning(format!("{packings} of {} discs make a noisy material", p.discs))
                .at(log.place("rve.discs"), "the stress ratio scatters by about 0.7 / sqrt(discs)")
                .help("64 packings, which average over each other, or 400 discs"),
        );
    }
}

/// Warns of cells that may become so thin that discs lock.
fn width(rve: &Rve, log: &Log) {
    let thin_width = rve.parameters.thin_width;
    if thin_width < LOCKED {
        log.report(
            Problem::warning(format!("thin_width = {thin_width} lets packings lock"))
                .at(log.place("rve.thin_width"), "mean diameters")
                .help(format!("in cells thinner than {LOCKED} discs cannot pass each other")),
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

/// Checks the stability of grains with the DEM step of the scene.
fn dem_step(grains: &Grains, log: &Log) {
    let Grains { step_factor, damping_ratio, .. } = *grains;
    let equal = grains.radius_min > (1.0 - EQUAL) * grains.radius_max;
    let (limit, key, why) = if equal && LATTICE_STEP < damped_step(damping_ratio) {
        (LATTICE_STEP, "radius_min", "discs of equal radii form lattices, unstable beyond 0.41")
    } else {
        (damped_step(damping_ratio), "damping_ratio", "a strong dashpot needs a shorter step")
    };
    if step_factor > limit {
        log.report(
            Problem::warning(format!("step_factor = {step_factor} may be unstable"))
                .at(place(log, "step_factor"), "packings may gain energy by themselves")
                .at(place(log, key), why)
                .help(format!("at most {limit:.2}; 0.2 is safe")),
        );
    }
}

/// Warns of settings that make grains stronger than real ones.
fn strength(grains: &Grains, log: &Log) {
    let Grains { mass_scale, local_damping, .. } = *grains;
    if mass_scale > 1.0 {
        log.report(
            Problem::warning(format!("mass_scale = {mass_scale} makes flow stronger"))
                .at(
                    place(log, "mass_scale"),
                    format!("inertial numbers are {:.1} times as large", mass_scale.sqrt()),
                )
                .help("1 is physical; a scaled mass is harmless in slow motion only"),
        );
    }
    if local_damping > 0.0 {
        log.report(
            Problem::warning(format!("local_damping = {local_damping} makes flow stronger"))
                .at(place(log, "local_damping"), "friction of fast flow grows by up to a half")
                .help("damping_ratio (the dashpot of contacts) leaves the strength as it is"),
        );
    }
}
