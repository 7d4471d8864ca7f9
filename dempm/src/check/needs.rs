//! Cost of a scene, the expected flow regime, and warnings.

use dem::Grains;
use serde::Serialize;

use super::accuracy::Accuracy;
use super::rates::Rates;
use super::units::{bytes, quantity};
use crate::memory;
use crate::packings;
use crate::run::monitor;
use crate::scene::{CROSSING, Material, Precision, Scene};
use crate::trajectory::Field;

/// Cost of running a scene and the flow regime to expect. SI units.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Needs {
    /// Title of the scene.
    pub title: String,
    /// File of the scene.
    pub name: String,
    /// Name of the material.
    pub material: &'static str,
    /// Material points.
    pub points: usize,
    /// Initial distance between neighbouring points (m).
    pub spacing: f64,
    /// Edge of a cell of the background grid (m).
    pub cell: f64,
    /// Cells along x and y.
    pub cells: [usize; 2],
    /// Frames after the initial one.
    pub frames: usize,
    /// Macro steps.
    pub steps: usize,
    /// Macro step (s).
    pub step: f64,
    /// Largest stable macro step for elastic waves (s).
    pub step_limit: f64,
    /// Bulk density (kg/m³).
    pub density: f64,
    /// Speed of compression waves (m/s).
    pub wave_speed: f64,
    /// Height of the highest pile (m).
    pub height: f64,
    /// Pressure under the highest pile (Pa).
    pub base_pressure: f64,
    /// Upper bound of velocities (m/s): free fall from the highest point with the initial velocity.
    pub peak_velocity: f64,
    /// Inertial number of the shear rate `peak velocity / height` at half the base pressure.
    pub inertial_number: Option<f64>,
    /// Duration of a collapse, `3.2 sqrt(H / g)` (s); none without gravity.
    pub collapse_time: Option<f64>,
    /// Expected extent of the deposit along x (m), ignoring walls.
    pub reach: Option<[f64; 2]>,
    /// Sizes of the packings; none without packings.
    pub rve: Option<RveNeeds>,
    /// Cost of the discs; none under a continuum law.
    pub dem: Option<DemNeeds>,
    /// Expected distance from the same scene as discs; none if nothing similar was measured.
    pub accuracy: Option<Accuracy>,
    /// Size of the uncompressed trajectory (bytes).
    pub output: f64,
    /// Memory for points, grid and packings (bytes).
    pub memory: f64,
    /// Estimated wall time (s).
    pub seconds: f64,
    /// Estimated wall time (s) of preparing packings or discs, which are kept for the next run.
    pub preparation: f64,
    /// Ways in which the scene leaves the validity of the method.
    pub warnings: Vec<String>,
    /// What of the scene itself is doubtful, as its [report](Scene::warning_report) shows with places.
    pub scene_warnings: Vec<String>,
}

/// Sizes of the packings of a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RveNeeds {
    /// Discs in one RVE.
    pub discs: usize,
    /// Side of the RVE (m).
    pub side: f64,
    /// Different packings.
    pub packings: usize,
}

/// Cost and stability of the discs of a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DemNeeds {
    /// Discs in all packings, or in the whole scene.
    pub discs: f64,
    /// DEM steps in a macro step.
    pub substeps: usize,
    /// DEM step (s).
    pub step: f64,
    /// Largest stable DEM step (s).
    pub step_limit: f64,
    /// Stiffness number `kn / (p t)` under the highest pile; infinite without gravity.
    pub stiffness_number: f64,
    /// DEM steps times discs of the whole run.
    pub disc_steps: f64,
    /// Disc-steps per second.
    pub rate: f64,
}

/// DEM step beyond which packings are unstable, in `sqrt(m_min / kn)`.
const UNSTABLE_STEP: f64 = 0.55;
/// Below this stiffness number overlaps are no longer small.
const SOFT: f64 = 50.0;
/// Above this inertial number flow is no longer dense.
pub(super) const COLLISIONAL: f64 = 0.1;
/// Ratio of local pressures in impacts to the pressure at the base.
const IMPACT: f64 = 4.0;
/// Position, velocity and pressure of a grain in a trajectory.
const BYTES_PER_GRAIN: f64 = 20.0;
/// Density, velocity and stress at a node of a grid in a trajectory.
const BYTES_PER_NODE: f64 = 28.0;
/// Steps in which a disc of a packing is prepared.
const PACKING_PREPARATION: f64 = 9.0e4;
/// Those of its ladder, which are left where packings come with the program.
const LADDER: f64 = 2.0e4;
/// Motion of a column while it is prepared, in times of a free fall from its top.
const COLUMN_PREPARATION: f64 = 1.0;
/// Standard gravity, under which columns are prepared (m/s²).
const GRAVITY: f64 = 9.81;

impl Needs {
    /// Estimates the cost of `scene` on a machine of this speed.
    pub fn of(scene: &Scene, rates: &Rates) -> Self {
        let points = scene.point_count();
        let gravity = scene.gravity[0].hypot(scene.gravity[1]);
        let density = scene.material.density();
        let height = scene.height();
        let base_pressure = density * gravity * height;
        let peak_velocity = peak_velocity(scene, gravity);
        let rve = match &scene.material {
            Material::Rve(rve) => Some(RveNeeds {
                discs: rve.parameters.discs,
                side: rve.side(),
                packings: rve.packings,
            }),
            _ => None,
        };
        let discs = discs(scene);
        let dem = scene
            .material
            .grains()
            .map(|grains| DemNeeds::of(grains, discs, scene, base_pressure, rates));
        let mut needs = Self {
            title: scene.title.clone(),
            name: scene.name.clone(),
            material: scene.material.name(),
            points,
            spacing: scene.domain.spacing(),
            cell: scene.domain.cell,
            cells: scene.domain.cells(),
            frames: scene.frames(),
            steps: scene.steps(),
            step: scene.step,
            step_limit: scene.step_limit(),
            density,
            wave_speed: scene.material.wave_speed(),
            height,
            base_pressure,
            peak_velocity,
            inertial_number: inertial_number(scene, peak_velocity / height, 0.5 * base_pressure),
            collapse_time: (gravity > 0.0).then(|| 3.2 * (height / gravity).sqrt()),
            reach: if gravity > 0.0 { reach(scene) } else { None },
            accuracy: Accuracy::of(scene),
            output: output(scene, points, discs),
            memory: memory(scene, points, discs),
            seconds: seconds(scene, points, dem.as_ref(), rates),
            preparation: preparation(scene, discs, rates),
            rve,
            dem,
            warnings: Vec::new(),
            scene_warnings: scene.warnings.iter().map(|problem| problem.message.clone()).collect(),
        };
        needs.warnings = needs.warnings(scene);
        needs
    }

    /// The warning for grains that are too soft for their load.
    fn softness(&self, dem: &DemNeeds, grains: &Grains) -> Option<String> {
        let overlap = 2.0 * IMPACT / dem.stiffness_number;
        if dem.stiffness_number < SOFT {
            Some(format!(
                "discs are soft: kappa = {:.0} at the base, at least {SOFT} keeps overlaps below \
                 2 % of a diameter; a larger normal_stiffness or a smaller thickness helps",
                dem.stiffness_number
            ))
        } else if overlap > grains.overlap_warning {
            Some(format!(
                "impacts may press discs {:.0} % of a radius into each other, more than \
                 overlap_warning",
                100.0 * overlap
            ))
        } else {
            None
        }
    }

    fn warnings(&self, scene: &Scene) -> Vec<String> {
        let mut warnings = Vec::new();
        if let (Some(dem), Some(grains)) = (&self.dem, scene.material.grains()) {
            warnings.extend(self.softness(dem, grains));
        }
        if let Material::Rve(material) = &scene.material {
            let p = &material.parameters;
            if material.precision == Precision::F32 {
                let mean = 0.5 * self.base_pressure;
                warnings.extend(monitor::unresolved(
                    "the mean pressure of the highest pile",
                    mean,
                    &p.grains,
                ));
            }
            if p.preparation.pressure > self.base_pressure && self.base_pressure > 0.0 {
                warnings.push(format!(
                    "packings are made at {}, more than the pressure at the base: the material \
                     starts over-consolidated",
                    quantity(p.preparation.pressure, "Pa")
                ));
            }
        }
        let crossing = self.peak_velocity * self.step / self.cell;
        if crossing > CROSSING && !matches!(scene.material, Material::Discs(_)) {
            warnings.push(format!(
                "points may cross {crossing:.2} cells in one step at {:.1} m/s; a shorter step keeps \
                 it below {CROSSING}",
                self.peak_velocity
            ));
        }
        if let Some(i) = self.inertial_number.filter(|i| *i > COLLISIONAL) {
            warnings.push(format!(
                "the flow is collisional (inertial number about {i:.2}), where packings hardly touch"
            ));
        }
        if let Some([left, right]) = self.reach {
            let [from, to] = [0.0, scene.domain.size[0]];
            let touches = |x: f64| {
                scene.columns.iter().any(|c| {
                    (c.place.corner[0] - x).abs() < self.spacing
                        || (c.place.end()[0] - x).abs() < self.spacing
                })
            };
            if right > to && !touches(to) {
                warnings.push(format!("the front is expected to reach the right wall: {right:.1} m in a domain of {to} m"));
            }
            if left < from && !touches(from) {
                warnings.push("the front is expected to reach the left wall".into());
            }
        }
        if let Some(available) = memory::available().filter(|available| self.memory > *available) {
            warnings.push(format!(
                "this machine has {} of memory left, which is too little",
                bytes(available)
            ));
        }
        if let Some(time) = self.collapse_time.filter(|time| *time > scene.duration) {
            warnings.push(format!("the run ends before a collapse does ({time:.2} s)"));
        }
        warnings
    }
}

impl DemNeeds {
    fn of(grains: &Grains, discs: f64, scene: &Scene, base_pressure: f64, rates: &Rates) -> Self {
        let substeps = grains.substeps(scene.step);
        let inertia = grains.mass_scale * grains.disc_mass(grains.radius_min);
        let stiffness = grains.normal_stiffness.max(grains.tangential_stiffness);
        Self {
            discs,
            substeps,
            step: scene.step / substeps as f64,
            step_limit: UNSTABLE_STEP * (inertia / stiffness).sqrt(),
            stiffness_number: grains.stiffness_number(base_pressure),
            disc_steps: discs * scene.steps() as f64 * substeps as f64,
            rate: match scene.material {
                Material::Discs(_) => rates.discs,
                _ => rates.packings,
            },
        }
    }
}

/// Wall time of a run without preparation (s).
fn seconds(scene: &Scene, points: usize, dem: Option<&DemNeeds>, rates: &Rates) -> f64 {
    let steps = scene.steps() as f64;
    let point_steps = points as f64 * steps;
    let discs = dem.map_or(0.0, |dem| dem.disc_steps / dem.rate);
    let [packings, law, whole_scene] = rates.least;
    match (&scene.material, dem) {
        (Material::Discs(_), Some(dem)) => discs + steps * dem.substeps as f64 * whole_scene,
        (Material::Rve(_), _) => discs + steps * packings + point_steps / rates.points,
        _ => steps * law + point_steps / rates.law,
    }
}

/// Wall time of preparing packings or discs (s).
fn preparation(scene: &Scene, discs: f64, rates: &Rates) -> f64 {
    match &scene.material {
        Material::Discs(model) => {
            let fall = COLUMN_PREPARATION * (2.0 * scene.height() / GRAVITY).sqrt();
            let [_, _, least] = rates.least;
            fall / model.grains.preparation_step() * (least + discs / rates.preparation)
        }
        Material::Rve(rve) => {
            let discs = rve.packings * rve.parameters.discs;
            let ship = packings::ship(&rve.parameters, rve.seeds(scene.seed));
            let steps = if ship { LADDER } else { PACKING_PREPARATION };
            steps * discs as f64 / rates.packing_preparation
        }
        Material::MuI(_) | Material::Elastic(_) => 0.0,
    }
}

/// Discs in all packings, or in the whole scene.
fn discs(scene: &Scene) -> f64 {
    let points = scene.point_count() as f64;
    match &scene.material {
        Material::Discs(discs) => discs.count_in(points * scene.point_area()),
        Material::Rve(rve) => points * rve.parameters.discs as f64,
        Material::MuI(_) | Material::Elastic(_) => 0.0,
    }
}

/// Upper bound of velocities: the energy of each column at its top (m/s).
fn peak_velocity(scene: &Scene, gravity: f64) -> f64 {
    let columns = scene.columns.iter().map(|column| {
        let [u, v] = column.velocity;
        (u * u + v * v + 2.0 * gravity * column.place.end()[1]).sqrt()
    });
    columns.fold(0.0, f64::max)
}

/// `rate d sqrt(rho_s / p)` with the scaled mass density; none without grains or without pressure.
fn inertial_number(scene: &Scene, rate: f64, pressure: f64) -> Option<f64> {
    let (diameter, density) = scene.material.grain();
    let mass_scale = match &scene.material {
        Material::Rve(rve) => rve.parameters.grains.mass_scale,
        Material::Discs(discs) => discs.grains.mass_scale,
        _ => 1.0,
    };
    (diameter > 0.0 && pressure > 0.0)
        .then(|| rate * diameter * (mass_scale * density / pressure).sqrt())
}

/// Expected extent of collapsed columns, from two-dimensional columns of discs: the runout over the
/// width is `2.5 a` up to an aspect ratio `a` of 2 and `3.25 a^0.7` above (Staron and Hinch 2005).
/// Ignores initial velocities, obstacles and other columns.
fn reach(scene: &Scene) -> Option<[f64; 2]> {
    if matches!(scene.material, Material::Elastic(_)) {
        return None;
    }
    let tolerance = 0.5 * scene.domain.spacing();
    let reaches = scene.columns.iter().filter_map(|column| {
        let ([left, _], [right, top]) = (column.place.corner, column.place.end());
        let at_left = left < tolerance;
        let at_right = right > scene.domain.size[0] - tolerance;
        if at_left && at_right {
            return None;
        }
        let width = (right - left) * if at_left || at_right { 1.0 } else { 0.5 };
        let aspect = top / width;
        let runout = width * if aspect < 2.0 { 2.5 * aspect } else { 3.25 * aspect.powf(0.7) };
        Some([
            left - if at_left { 0.0 } else { runout },
            right + if at_right { 0.0 } else { runout },
        ])
    });
    reaches.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

/// The trajectory before compression (bytes).
fn output(scene: &Scene, points: usize, discs: f64) -> f64 {
    let frames = (scene.frames() + 1) as f64;
    let grains = match (&scene.material, scene.grains_every) {
        (Material::Discs(_), every @ 1..) => {
            (frames / every as f64).ceil() * BYTES_PER_GRAIN * discs
        }
        _ => 0.0,
    };
    let grid = match (&scene.material, scene.grid) {
        (Material::Discs(_), Some(grid)) => {
            let [columns, rows] = grid.nodes(scene.domain.size);
            frames * BYTES_PER_NODE * columns * rows
        }
        _ => 0.0,
    };
    frames * points as f64 * bytes_per_point(&scene.fields) + grains + grid
}

/// Bytes of one point in one frame before compression.
fn bytes_per_point(optional: &[Field]) -> f64 {
    let always = [Field::Position, Field::Velocity].map(|field| 8 * field.components().len());
    let optional = optional.iter().map(|field| 4 * field.components().len());
    always.into_iter().chain(optional).sum::<usize>() as f64
}

/// State of points, grid and discs (bytes). A disc of a packing, the pairs near it and their history take
/// about 100 bytes in f32.
fn memory(scene: &Scene, points: usize, discs: f64) -> f64 {
    let points = 300.0 * points as f64;
    let grid = || 100.0 * scene.domain.cells().map(|cells| cells as f64).iter().product::<f64>();
    match &scene.material {
        Material::Discs(model) => points + model.memory(discs),
        Material::Rve(rve) => {
            let disc = match rve.precision {
                Precision::F32 => 100.0,
                Precision::F64 => 200.0,
            };
            points + grid() + disc * discs
        }
        Material::MuI(_) | Material::Elastic(_) => points + grid(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn needs(text: &str) -> Needs {
        Needs::of(&Scene::parse(text, "test.toml").unwrap(), &Rates::of_processor(1.0e8))
    }

    const COLUMN: &str =
        "duration = 3.0\n[domain]\nsize = [10.0, 10.0]\n[[column]]\nsize = [3.0, 3.0]\n";

    #[test]
    fn the_3_m_column_has_the_known_numbers() {
        let needs = needs(COLUMN);
        let (rve, dem) = (needs.rve.as_ref().unwrap(), needs.dem.as_ref().unwrap());
        assert_eq!((needs.points, rve.discs, dem.substeps, needs.steps), (36_864, 64, 7, 17_400));
        assert!((needs.density - 2226.0).abs() < 1.0);
        assert!((needs.wave_speed - 80.0).abs() < 1.0);
        assert!((needs.step_limit - 2.0e-4).abs() < 1.0e-5);
        assert!((dem.step_limit - 3.4e-5).abs() < 1.0e-6);
        assert!((needs.base_pressure - 65.5e3).abs() < 100.0);
        assert!((dem.stiffness_number - 204.0).abs() < 1.0);
        assert!((dem.disc_steps - 2.874e11).abs() < 1.0e9);
        assert!((needs.seconds - 3120.0).abs() < 60.0, "{}", needs.seconds);
        // The column reaches the wall of the box, and nothing else is wrong with it.
        let [warning] = &needs.warnings[..] else { panic!("{:?}", needs.warnings) };
        assert!(warning.contains("right wall: 10.5 m"), "{warning}");
    }

    #[test]
    fn scenes_outside_the_sound_region_are_warned_about() {
        for (lines, expected) in [
            ("[grains]\nthickness = 0.075", "discs are soft: kappa = 20"),
            ("[grains]\noverlap_warning = 0.01", "impacts may press discs 4 % of a radius"),
            ("[rve]\npreparation.pressure = 1e5", "over-consolidated"),
            ("[grains]\nmass_scale = 1000", "collisional"),
        ] {
            let warnings = needs(&format!("{COLUMN}{lines}")).warnings;
            assert!(warnings.iter().any(|w| w.contains(expected)), "{expected}: {warnings:?}");
        }
        let short = COLUMN.replace("duration = 3.0", "duration = 1.0");
        assert!(
            needs(&short).warnings.iter().any(|w| w.contains("before a collapse does (1.77 s)"))
        );
        let fast = format!(
            "{}velocity = [0, -62.4]",
            COLUMN
                .replace("= 3.0\n[", "= 3.0\nstep = 4e-4\nframe_interval = 0.04\n[")
                .replace("[10.0, 10.0]", "[10.0, 10.0]\ncell = 0.125")
        );
        assert!(needs(&fast).warnings.iter().any(|w| w.contains("0.20 cells in one step")));
    }

    #[test]
    fn pressures_that_f32_does_not_resolve_are_expected() {
        let said = |lines: &str| {
            let warnings = needs(&format!("gravity = [0, -0.03]\n{COLUMN}{lines}")).warnings;
            warnings.iter().any(|w| w.contains("100 Pa, but under 170 Pa"))
        };
        assert!(said("[material]\nkind = \"rve\"\nprecision = \"f32\""));
        assert!(!said("[material]\nkind = \"rve\"\nprecision = \"f64\""));
    }

    /// 28 bytes a node in every frame, 20 bytes a grain in each tenth.
    #[test]
    fn output_counts_grains_and_grid() {
        let column = format!("{COLUMN}[material]\nkind = \"discs\"\n");
        let plain = needs(&column);
        let frames = (plain.frames + 1) as f64;
        let grid = needs(&format!("{column}[output.grid]\nwidth = 0.05\nspacing = 0.1\n"));
        // Three widths more on each side.
        assert!((grid.output - plain.output - frames * 28.0 * 103.0 * 103.0).abs() < 1.0);
        let grains = needs(&format!("{column}[output]\ngrains_every = 10\n"));
        let discs = plain.dem.as_ref().unwrap().discs;
        let expected = (frames / 10.0).ceil() * 20.0 * discs;
        assert!((grains.output - plain.output - expected).abs() < 1.0);
    }

    #[test]
    fn without_gravity_nothing_is_expected_to_collapse() {
        let needs = needs(&format!("gravity = [0, 0]\n{COLUMN}"));
        assert_eq!((needs.collapse_time, needs.reach, needs.inertial_number), (None, None, None));
        assert!(!needs.to_string().contains("inf"), "{needs}");
        assert_eq!(needs.warnings, Vec::<String>::new());
    }

    #[test]
    fn the_values_of_the_table_end_in_one_column() {
        let text = needs(COLUMN).to_string();
        let end = |label: &str, value: &str| {
            let line = text.lines().find(|line| line.trim_start().starts_with(label)).unwrap();
            line.find(value).map(|start| line[..start].chars().count() + value.chars().count())
        };
        let column = end("material points", "36 864");
        assert!(column.is_some());
        for (label, value) in
            [("macro step", "172 µs"), ("DEM step", "24.6 µs"), ("time  ", "52 min")]
        {
            assert_eq!(end(label, value), column, "{text}");
        }
    }
}
