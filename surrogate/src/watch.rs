//! What a rollout says about itself: a prediction that no material could follow. A network cannot
//! know where it is wrong, but it can be held to what always holds.

use std::collections::HashMap;

use crate::simulator::Simulator;
use crate::start::Start;

/// Mechanical energy may grow by this part of that of the start.
const ENERGY_TOLERANCE: f64 = 0.05;
/// Points on the area of one are as many as this at least before they are too many: twice as dense
/// as at the start.
const DENSER: f64 = 2.0;
/// Part of the points that may be in such places.
const CROWDED: f64 = 0.05;

/// Root mean square of velocities or accelerations in units of the training's standard deviations
/// (1 in training) from which on a start is unlike all training.
const STRANGE: f64 = 4.0;

/// What there is to say of a start before anything is predicted from it.
pub fn doubts(simulator: &Simulator, start: &Start) -> Vec<String> {
    let mut said = Vec::new();
    if !start.scene.obstacles.is_empty() || start.scene.plate.is_some() {
        said.push(
            "obstacles and plates stop points that touch them: the network itself does not see them"
                .to_owned(),
        );
    }
    let [.., first, second, third] = start.positions.as_slice() else { return said };
    let n = &simulator.normalisation;
    let free_fall = start.scene.gravity.map(|g| g * simulator.training.frame_interval.powi(2));
    let fall = if simulator.training.without_gravity { free_fall } else { [0.0; 2] };
    let rms = |value: &dyn Fn(usize, usize) -> f64| {
        let axis = |k: usize| (0..third.len()).map(|p| value(p, k).powi(2)).sum::<f64>();
        ((axis(0) + axis(1)) / (2.0 * third.len().max(1) as f64)).sqrt()
    };
    let velocity =
        |p: usize, k: usize| (third[p][k] - second[p][k] - n.velocity_mean[k]) / n.velocity_std[k];
    let acceleration = |p: usize, k: usize| {
        let a = third[p][k] - 2.0 * second[p][k] + first[p][k];
        (a - fall[k] - n.acceleration_mean[k]) / n.acceleration_std[k]
    };
    for (what, size) in [("fast", rms(&velocity)), ("much accelerated", rms(&acceleration))] {
        if size > STRANGE {
            said.push(format!(
                "the start is {size:.0} times as {what} as the training data were on average: do \
                 not trust the prediction"
            ));
        }
    }
    said
}

/// Looks at every frame of a rollout. Each kind of doubt is said once.
pub struct Watch {
    mass: Vec<f64>,
    gravity: [f64; 2],
    interval: f64,
    spacing: f64,
    /// Mechanical energy of the last given frame (J/m); none where a plate can add to it.
    start_energy: Option<f64>,
    energy: bool,
    crowded: bool,
}

impl Watch {
    /// `interval` is the time between the model's frames, s.
    pub fn new(start: &Start, interval: f64) -> Self {
        let mut watch = Self {
            mass: start.points.mass.clone(),
            gravity: start.scene.gravity,
            interval,
            spacing: start.scene.domain.spacing(),
            start_energy: None,
            energy: false,
            crowded: false,
        };
        if start.scene.plate.is_none()
            && let [.., before, last] = start.positions.as_slice()
        {
            watch.start_energy = Some(watch.mechanical_energy(before, last));
        }
        watch
    }

    /// What there is to say about a frame with the one before it.
    pub fn observe(&mut self, frame: usize, before: &[[f64; 2]], now: &[[f64; 2]]) -> Vec<String> {
        let mut said = Vec::new();
        if let Some(start) = self.start_energy.filter(|_| !self.energy) {
            let gain = self.mechanical_energy(before, now) - start;
            if start != 0.0 && gain > ENERGY_TOLERANCE * start.abs() {
                self.energy = true;
                let percent = 100.0 * gain / start.abs();
                said.push(format!(
                    "frame {frame}: the mechanical energy is {percent:.0} % above that of the \
                     start: do not trust the prediction from here on"
                ));
            }
        }
        let crowded = self.crowded_share(now);
        if !self.crowded && crowded > CROWDED {
            self.crowded = true;
            said.push(format!(
                "frame {frame}: {:.0} % of the points are packed {DENSER} times as densely as at \
                 the start: do not trust the prediction from here on",
                100.0 * crowded
            ));
        }
        said
    }

    /// Kinetic and potential energy, the latter from the corner of the domain (J/m).
    fn mechanical_energy(&self, before: &[[f64; 2]], now: &[[f64; 2]]) -> f64 {
        let of_point = |((x, b), m): ((&[f64; 2], &[f64; 2]), &f64)| {
            let axis = |k: usize| {
                let v = (x[k] - b[k]) / self.interval;
                0.5 * v * v - self.gravity[k] * x[k]
            };
            m * (axis(0) + axis(1))
        };
        now.iter().zip(before).zip(&self.mass).map(of_point).sum()
    }

    /// Part of the points in squares, two spacings wide, that hold too many.
    fn crowded_share(&self, now: &[[f64; 2]]) -> f64 {
        let side = 2.0 * self.spacing;
        let mut counts: HashMap<[i64; 2], u32> = HashMap::new();
        for x in now {
            *counts.entry(x.map(|x| (x / side).floor() as i64)).or_default() += 1;
        }
        let crowded = counts.values().filter(|&&n| f64::from(n) > DENSER * 4.0).sum::<u32>();
        f64::from(crowded) / now.len().max(1) as f64
    }
}

#[cfg(test)]
mod tests {
    use dempm::scene::Scene;
    use dempm::simulation::Simulation;

    use super::*;

    const INTERVAL: f64 = 0.01;

    /// A block that hangs in the air for two frames.
    fn start() -> Start {
        let text = "duration = 0.1\n[domain]\nsize = [2.0, 2.0]\n[[column]]\ncorner = [0.5, 1.0]\n\
                    size = [0.5, 0.5]\n[material]\nkind = \"mu-i\"\n";
        let scene = Scene::parse(text, "scene.toml").unwrap();
        let simulation = Simulation::new(scene.clone()).unwrap();
        let frame = simulation.frame();
        Start {
            scene,
            header: simulation.header(String::new()),
            points: simulation.static_points(),
            positions: vec![frame.position.clone(), frame.position],
            velocities: vec![frame.velocity.clone(), frame.velocity],
            time: 0.0,
            statics: Vec::new(),
            frames: 2,
            simulated_in: 0.0,
        }
    }

    #[test]
    fn a_free_fall_is_believed() {
        let start = start();
        let mut watch = Watch::new(&start, INTERVAL);
        let (mut before, mut now) = (start.positions[0].clone(), start.positions[1].clone());
        for frame in 2..20 {
            let fall = |(x, b): (&[f64; 2], &[f64; 2])| {
                [x[0], 2.0 * x[1] - b[1] - 9.81 * INTERVAL * INTERVAL]
            };
            let next = now.iter().zip(&before).map(fall).collect();
            before = std::mem::replace(&mut now, next);
            assert_eq!(watch.observe(frame, &before, &now), Vec::<String>::new());
        }
    }

    #[test]
    fn what_no_material_does_is_said_once() {
        let start = start();
        let mut watch = Watch::new(&start, INTERVAL);
        let up: Vec<[f64; 2]> = start.positions[1].iter().map(|x| [x[0], x[1] + 0.1]).collect();
        let said = watch.observe(2, &start.positions[1], &up);
        assert!(said.len() == 1 && said[0].contains("mechanical energy"), "{said:?}");
        // The same points on a quarter of the area.
        let dense: Vec<[f64; 2]> = up.iter().map(|x| x.map(|x| 0.5 * x)).collect();
        let said = watch.observe(3, &up, &dense);
        assert!(said.len() == 1 && said[0].contains("packed 2 times"), "{said:?}");
        assert_eq!(watch.observe(4, &up, &dense), Vec::<String>::new());
    }
}
