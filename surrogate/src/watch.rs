//! What a rollout says about itself: a prediction that no material could follow. A network cannot
//! know where it is wrong, but it can be held to what always holds.

use std::collections::HashMap;

use crate::start::Start;

/// Mechanical energy may grow by this part of that of the start.
const ENERGY_TOLERANCE: f64 = 0.05;
/// Points on the area of one are as many as this at least before they are too many: twice as dense
/// as at the start.
const DENSER: f64 = 2.0;
/// Part of the points that may be in such places.
const CROWDED: f64 = 0.05;

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
