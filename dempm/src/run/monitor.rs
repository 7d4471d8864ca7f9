//! Warnings of a running simulation when it leaves the validity of the method.

use dem::Grains;
use serde::{Deserialize, Serialize};

use super::rest::Rest;
use crate::scene::{Material, Precision};
use crate::simulation::{
    DiscModel, Model, STABLE_STEP, SceneMaterial, Simulation, SimulationError,
};
use crate::soundness::{self, Unsound};
use crate::trajectory::Frame;

/// Frames with unresolved pressures before the warning: low pressure may be momentary, as in a throw.
const UNRESOLVED: usize = 10;

/// The warning for a macro step (s) above the largest provably stable one, `bound` (s).
pub fn beyond_bound(step: f64, bound: f64) -> Option<String> {
    (step > bound).then(|| {
        format!("the step of {step:.2e} s exceeds the bound {bound:.2e} s of guaranteed stability")
    })
}

/// Share of RVE steps with a cell too thin to follow that is worth a warning: the tip of a collapse has 1 %.
const THIN_SHARE: f64 = 0.05;

/// The warning for an overlap above `warning`, both in radii.
pub fn overlap(largest: f64, warning: f64) -> String {
    format!("discs overlap by {largest:.2} of a radius, more than overlap_warning = {warning}")
}

/// The warning for cells thinner than `diameters` (mean diameters), the thinnest of `width` (m).
pub fn thin(diameters: f64, width: f64) -> String {
    format!(
        "cells of packings are thinner than {diameters} diameters ({:.1} mm) and not sheared further",
        1e3 * width
    )
}

/// The warning for a pressure (Pa), described by `what`, that f32 does not resolve in packings.
pub fn unresolved(what: &str, pressure: f64, grains: &Grains) -> Option<String> {
    let limit = grains.single_precision_pressure();
    (pressure > 0.0 && pressure < limit).then(|| {
        format!(
            "{what} is {pressure:.0} Pa, but under {limit:.0} Pa f32 may be a per cent or more \
             wrong in stress: use f64"
        )
    })
}

/// Coordination number above which a packing carries load; measured: 2.5 under the least load, 0 in
/// flight.
const LOADED: f64 = 1.0;

/// Median pressure (Pa) of the loaded packings; none if fewer than half are loaded, as in flight.
fn median_pressure(states: &[dem::RveState]) -> Option<f64> {
    let loaded = states.iter().filter(|state| !state.free && state.coordination > LOADED);
    let mut pressures: Vec<f64> = loaded.map(|state| 0.5 * state.stress.trace()).collect();
    pressures.sort_by(f64::total_cmp);
    (2 * pressures.len() > states.len()).then(|| pressures[pressures.len() / 2])
}

/// Checks every frame of a run and gives each kind of warning once.
///
/// It is part of a checkpoint, so that a resumed run warns when the uninterrupted one would.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Monitor {
    /// Smallest stable macro step of any frame but the initial one (s).
    stable_step: Option<f64>,
    /// Mechanical energy of the initial frame, with potential energy zero at the floor (J/m).
    start_energy: f64,
    /// Elastic energy of the initial state (J/m), which may become kinetic.
    stored_energy: f64,
    /// Projections of points up to the last frame.
    projected: f64,
    /// Kinds of warnings already given.
    energy: bool,
    crowded: bool,
    held: bool,
    overlap: bool,
    thin: bool,
    /// Frames whose pressure f32 did not resolve.
    unresolved: usize,
    /// All warnings so far, with their times.
    warnings: Vec<String>,
    /// Where the run ends as soon as everything is at rest.
    rest: Rest,
}

impl Monitor {
    /// Begins with the initial state, which later ones are compared with.
    pub fn new(simulation: &Simulation) -> Self {
        let points = &simulation.points;
        let stored_energy = soundness::stored_energy(
            points.volume.iter().zip(&points.stress).map(|(v, s)| (*v, s.norm_squared())),
            simulation.scene.material.wave_modulus(),
        );
        let start_energy = mechanical_energy(&simulation.frame());
        Self { start_energy, stored_energy, ..Self::default() }
    }

    /// Smallest stable macro step of any frame but the initial one (s); infinite before there is one.
    pub fn stable_step(&self) -> f64 {
        self.stable_step.unwrap_or(f64::INFINITY)
    }

    /// All warnings so far.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The time (s) from which on everything is at rest, where the scene asks for it.
    pub fn rest_time(&self) -> Option<f64> {
        self.rest.time()
    }

    /// New warnings for the present frame of a simulation.
    pub fn observe(&mut self, simulation: &Simulation, frame: &Frame) -> Vec<String> {
        if simulation.scene.stop_at_rest {
            self.rest.observe(&simulation.scene, &simulation.points.mass, frame);
        }
        let mut warnings = Vec::new();
        let time = frame.time;
        let mut warn = |text: String| warnings.push(format!("at t = {time:.3} s {text}"));
        if let Model::Discs(discs) = &simulation.model {
            self.observe_discs(discs, frame, &mut warn);
            self.warnings.extend_from_slice(&warnings);
            return warnings;
        }
        self.observe_step(simulation.scene.step, frame, &mut warn);
        for sign in self.unsound(simulation, frame) {
            warn(sign.to_string());
        }
        if let Some(rve) = simulation.packings() {
            let (tally, p) = (&rve.tally, rve.parameters());
            if tally.overlap_steps > 0 && !self.overlap {
                self.overlap = true;
                warn(overlap(tally.max_overlap, p.grains.overlap_warning));
            }
            if tally.thin_steps as f64 > THIN_SHARE * tally.steps as f64 && !self.thin {
                self.thin = true;
                warn(thin(p.thin_width, tally.min_width));
            }
            if let Material::Rve(asked) = &simulation.scene.material
                && asked.precision == Precision::F32
                && let Some(pressure) = median_pressure(rve.states())
                && let Some(warning) =
                    unresolved("the pressure in half of the packings", pressure, &p.grains)
            {
                self.unresolved += 1;
                if self.unresolved == UNRESOLVED {
                    warn(warning);
                }
            }
        }
        self.warnings.extend_from_slice(&warnings);
        warnings
    }

    /// The energy budget and overlaps of discs.
    fn observe_discs(&mut self, discs: &DiscModel, frame: &Frame, warn: &mut impl FnMut(String)) {
        let dissipated: f64 = ["dashpot_loss", "friction_loss", "damping_loss"]
            .map(|name| scalar(frame, name))
            .iter()
            .sum();
        let drift = scalar(frame, "energy_drift");
        let kinetic = scalar(frame, "kinetic_energy");
        let unsound = soundness::drift(drift, dissipated, kinetic, self.start_energy);
        if let Some(sign) = unsound.filter(|_| !self.energy) {
            self.energy = true;
            warn(sign.to_string());
        }
        let warning = discs.grains().overlap_warning;
        if discs.max_overlap() > warning && !self.overlap {
            self.overlap = true;
            warn(overlap(discs.max_overlap(), warning));
        }
    }

    /// The macro step against its bound of guaranteed stability.
    fn observe_step(&mut self, step: f64, frame: &Frame, warn: &mut impl FnMut(String)) {
        let Some(&bound) = frame.budget.get(STABLE_STEP) else { return };
        if self.stable_step() >= step
            && let Some(warning) = beyond_bound(step, bound)
        {
            warn(warning);
        }
        self.stable_step = Some(self.stable_step().min(bound));
    }

    /// Signs, each kind given once, that the frame shows no state of the material.
    fn unsound(&mut self, simulation: &Simulation, frame: &Frame) -> Vec<Unsound> {
        let scene = &simulation.scene;
        let energy = mechanical_energy(frame);
        let grown = soundness::energy(self.start_energy, energy, self.stored_energy);
        let full = scene.domain.points_per_cell.pow(2);
        let crowded = soundness::crowding(&frame.position, scene.domain.cell, full);
        let projected = scalar(frame, "points_projected");
        let (steps, all) = (scene.steps_per_frame(), frame.position.len());
        let held = soundness::held_at_walls(self.projected, projected, steps, all);
        self.projected = projected;
        let kinds =
            [(grown, &mut self.energy), (crowded, &mut self.crowded), (held, &mut self.held)];
        let new = |(sign, given): (Option<Unsound>, &mut bool)| {
            let sign = sign.filter(|_| !*given)?;
            *given = true;
            Some(sign)
        };
        kinds.into_iter().filter_map(new).collect()
    }
}

/// Kinetic and potential energy, less the work of the plate (J/m): it can only come from what the
/// material has stored.
fn mechanical_energy(frame: &Frame) -> f64 {
    scalar(frame, "kinetic_energy") + scalar(frame, "potential_energy")
        - scalar(frame, "plate_work")
}

fn scalar(frame: &Frame, name: &str) -> f64 {
    frame.budget.get(name).copied().unwrap_or_default()
}

/// Why a run has to end at the present frame: a continuum compressed beyond its law. Packings have
/// `overlap_limit`.
pub fn failure(simulation: &Simulation) -> Option<SimulationError> {
    let Model::Mpm(mpm) = &simulation.model else { return None };
    if let SceneMaterial::Rve(_) = mpm.material {
        return None;
    }
    let points = &simulation.points;
    let (point, left) = soundness::compression(&points.volume, simulation.scene.point_area())?;
    let position = points.position[point].into();
    Some(SimulationError::Compressed { time: simulation.time(), point, position, left })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    const SCENE: &str = "duration = 0.1\n[domain]\nsize = [2.0, 1.0]\n[[column]]\n\
                         size = [0.5, 0.5]\n[material]\nkind = \"mu-i\"\n";

    #[test]
    fn each_warning_is_given_once() {
        let scene = Scene::parse(SCENE, "scene.toml").unwrap();
        let simulation = Simulation::new(scene).unwrap();
        let mut monitor = Monitor::new(&simulation);
        let mut frame = simulation.frame();
        assert_eq!(monitor.observe(&simulation, &frame), Vec::<String>::new());
        let bound = monitor.stable_step();
        assert!(bound > simulation.scene.step && bound.is_finite());

        // All potential energy again as kinetic energy.
        frame.budget.insert("kinetic_energy".into(), frame.budget["potential_energy"]);
        frame.budget.insert(STABLE_STEP.into(), 0.5 * simulation.scene.step);
        let said = monitor.observe(&simulation, &frame);
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(said[0].contains("exceeds the bound 5.00e-5 s"), "{said:?}");
        assert!(said[1].contains("energy is 100 % above"), "{said:?}");
        assert_eq!(monitor.observe(&simulation, &frame), Vec::<String>::new());
        assert_eq!(monitor.stable_step(), 0.5 * simulation.scene.step);
        assert_eq!(monitor.warnings(), said);
    }

    /// The first growth counts from the initial state.
    #[test]
    fn growth_within_the_first_frame_is_seen() {
        let simulation = Simulation::new(Scene::parse(SCENE, "scene.toml").unwrap()).unwrap();
        let mut monitor = Monitor::new(&simulation);
        let mut frame = simulation.frame();
        frame.budget.insert("kinetic_energy".into(), 0.4 * frame.budget["potential_energy"]);
        let said = monitor.observe(&simulation, &frame);
        assert!(said.len() == 1 && said[0].contains("energy is 40 % above"), "{said:?}");
    }

    /// Without gravity, at the pressure that packings are made with: what they have stored moves them.
    #[test]
    fn stored_energy_may_become_motion() {
        let text = SCENE
            .replace("[domain]", "gravity = [0.0, 0.0]\n[domain]")
            .replace("kind = \"mu-i\"", "kind = \"rve\"\n[rve]\ndiscs = 30");
        let mut simulation = Simulation::new(Scene::parse(&text, "scene.toml").unwrap()).unwrap();
        let mut monitor = Monitor::new(&simulation);
        for _ in 0..5 {
            for _ in 0..simulation.scene.steps_per_frame() {
                simulation.advance().unwrap();
            }
            let frame = simulation.frame();
            let said = monitor.observe(&simulation, &frame);
            assert!(frame.budget["kinetic_energy"] > 0.0);
            assert!(!said.iter().any(|text| text.contains("energy")), "{said:?}");
        }
    }

    #[test]
    fn a_continuum_pressed_flat_ends_the_run() {
        let text = SCENE.replace(
            "size = [0.5, 0.5]\n",
            "size = [0.5, 0.5]\ncorner = [1.0, 0.25]\nvelocity = [0.0, -80.0]\n",
        );
        let text = text.replace("[domain]\n", "[domain]\ncell = 0.125\n");
        let mut simulation = Simulation::new(Scene::parse(&text, "scene.toml").unwrap()).unwrap();
        assert!(failure(&simulation).is_none());
        for _ in 0..simulation.scene.steps_per_frame() {
            simulation.advance().unwrap();
        }
        let error = failure(&simulation).unwrap().to_string();
        assert!(error.contains("is compressed to") && error.contains("t = 0.010"), "{error}");
    }

    /// Small packings under light gravity, g = 9.81 m/s² / `lighter`.
    fn resting(lighter: f64, precision: &str) -> Vec<String> {
        let text = format!(
            "duration = 0.06\nframe_interval = 1e-3\ngravity = [0.0, {:?}]\n[domain]\n\
             size = [0.25, 0.5]\n[[column]]\nsize = [0.25, 0.25]\n[material]\nkind = \"rve\"\n\
             precision = \"{precision}\"\ninitial_stress = \"ladder\"\n[rve]\ndiscs = 30\n",
            -9.81 / lighter
        );
        let scene = Scene::parse(&text, "scene.toml").unwrap();
        let (frames, steps) = (scene.frames(), scene.steps_per_frame());
        let mut simulation = Simulation::new(scene).unwrap();
        let mut monitor = Monitor::new(&simulation);
        let mut said = Vec::new();
        for _ in 0..frames {
            (0..steps).for_each(|_| simulation.advance().unwrap());
            said.extend(monitor.observe(&simulation, &simulation.frame()));
        }
        said
    }

    #[test]
    fn a_pressure_that_f32_does_not_resolve_is_reported_once() {
        let said = resting(50.0, "f32");
        assert!(said.len() == 1 && said[0].contains("wrong in stress: use f64"), "{said:?}");
        assert_eq!(resting(50.0, "f64"), Vec::<String>::new());
        assert_eq!(resting(1.0, "f32"), Vec::<String>::new());
    }

    #[test]
    fn a_plate_may_add_energy() {
        let scene = Scene::parse(SCENE, "scene.toml").unwrap();
        let simulation = Simulation::new(scene).unwrap();
        let mut monitor = Monitor::new(&simulation);
        let mut frame = simulation.frame();
        monitor.observe(&simulation, &frame);
        let energy = frame.budget["potential_energy"];
        frame.budget.insert("kinetic_energy".into(), energy);
        frame.budget.insert("plate_work".into(), energy);
        assert_eq!(monitor.observe(&simulation, &frame), Vec::<String>::new());
    }
}
