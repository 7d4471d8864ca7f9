//! Warnings of a running simulation when it leaves the validity of the method.

use dem::RveParameters;

use crate::scene::{Material, Precision};
use crate::simulation::{STABLE_STEP, SceneMaterial, Simulation};
use crate::trajectory::Frame;

/// Tolerated growth of the mechanical energy, relative to its initial value: packings and elastic
/// bodies store less than this under their own weight.
const ENERGY_TOLERANCE: f64 = 0.05;

/// Frames with unresolved pressures before the warning: low pressure may be momentary, as in a throw.
const UNRESOLVED: usize = 10;

/// The warning for a macro step (s) above the largest provably stable one, `bound` (s).
pub fn beyond_bound(step: f64, bound: f64) -> Option<String> {
    (step > bound).then(|| {
        format!("the step of {step:.2e} s exceeds the bound {bound:.2e} s of guaranteed stability")
    })
}

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
pub fn unresolved(what: &str, pressure: f64, p: &RveParameters) -> Option<String> {
    let limit = p.single_precision_pressure();
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
#[derive(Clone, Debug, Default)]
pub struct Monitor {
    /// Smallest stable macro step of any frame (s).
    stable_step: Option<f64>,
    /// Mechanical energy of the first frame, with potential energy zero at the floor (J/m).
    start_energy: Option<f64>,
    /// Kinds of warnings already given.
    energy: bool,
    overlap: bool,
    thin: bool,
    /// Frames whose pressure f32 did not resolve.
    unresolved: usize,
}

impl Monitor {
    /// Smallest stable macro step of any frame (s); infinite before the first.
    pub fn stable_step(&self) -> f64 {
        self.stable_step.unwrap_or(f64::INFINITY)
    }

    /// Restores the stable macro steps (s) of the frames before a run was resumed.
    pub fn resume(&mut self, bounds: impl Iterator<Item = f64>) {
        self.stable_step = bounds.reduce(f64::min);
    }

    /// New warnings for the present frame of a simulation.
    pub fn observe(&mut self, simulation: &Simulation, frame: &Frame) -> Vec<String> {
        let mut warnings = Vec::new();
        let time = frame.time;
        let mut warn = |text: String| warnings.push(format!("at t = {time:.3} s {text}"));
        self.observe_step(simulation.scene.step, frame, &mut warn);
        self.observe_energy(frame, &mut warn);
        if let SceneMaterial::Rve(rve) = &simulation.state.material {
            let (tally, p) = (&rve.tally, rve.parameters());
            if tally.overlap_steps > 0 && !self.overlap {
                self.overlap = true;
                warn(overlap(tally.max_overlap, p.overlap_warning));
            }
            if tally.thin_steps > 0 && !self.thin {
                self.thin = true;
                warn(thin(p.thin_width, tally.min_width));
            }
            if let Material::Rve(asked) = &simulation.scene.material
                && asked.precision == Precision::F32
                && let Some(pressure) = median_pressure(rve.states())
                && let Some(warning) =
                    unresolved("the pressure in half of the packings", pressure, p)
            {
                self.unresolved += 1;
                if self.unresolved == UNRESOLVED {
                    warn(warning);
                }
            }
        }
        warnings
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

    /// Mechanical energy can only come from the plate and from energy stored in the material.
    fn observe_energy(&mut self, frame: &Frame, warn: &mut impl FnMut(String)) {
        let scalar = |name: &str| frame.budget.get(name).copied().unwrap_or_default();
        let energy = scalar("kinetic_energy") + scalar("potential_energy") - scalar("plate_work");
        let start = *self.start_energy.get_or_insert(energy);
        let gain = energy - start;
        if start != 0.0 && gain > ENERGY_TOLERANCE * start.abs() && !self.energy {
            self.energy = true;
            let percent = 100.0 * gain / start.abs();
            warn(format!(
                "the mechanical energy is {percent:.0} % above its initial value: a shorter step or a \
                 more dissipative transfer may be needed"
            ));
        }
    }
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
        let mut monitor = Monitor::default();
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
        let mut monitor = Monitor::default();
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
        let mut monitor = Monitor::default();
        let mut frame = simulation.frame();
        monitor.observe(&simulation, &frame);
        let energy = frame.budget["potential_energy"];
        frame.budget.insert("kinetic_energy".into(), energy);
        frame.budget.insert("plate_work".into(), energy);
        assert_eq!(monitor.observe(&simulation, &frame), Vec::<String>::new());
    }
}
