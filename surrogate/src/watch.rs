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
/// Motion slower than this part of sqrt(g H), with the height H of the pile, ends within
/// 0.05 sqrt(H/g) / mu, an instant, by friction: if it goes on, it is no flow.
const SLOW: f64 = 0.05;
/// Friction has had more than that time after so many sqrt(H/g).
const PATIENCE: f64 = 0.2;
/// Points that creep slower than this (m/s) are at rest: the direct solver's do at 1 mm/s.
const CREEP: f64 = 0.005;
/// Creep goes on with at least this part of the speed that it had before.
const LASTING: f64 = 0.5;

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
    /// Frames of a quarter of the rollout, and number of the last one.
    quarter: usize,
    last: usize,
    /// Positions a half and a quarter of the rollout before its end.
    late: Vec<Vec<[f64; 2]>>,
}

impl Watch {
    /// `interval` is the time between the model's frames, s; `frames` is the number of frames at the
    /// end of the rollout, those of the start included.
    pub fn new(start: &Start, interval: f64, frames: usize) -> Self {
        let last = frames.saturating_sub(1);
        let mut watch = Self {
            mass: start.points.mass.clone(),
            gravity: start.scene.gravity,
            interval,
            spacing: start.scene.domain.spacing(),
            start_energy: None,
            energy: false,
            crowded: false,
            quarter: last / 4,
            last,
            late: Vec::new(),
        };
        if start.scene.plate.is_none()
            && let [.., before, last] = start.window(2, interval).as_slice()
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
        if frame + 2 * self.quarter == self.last || frame + self.quarter == self.last {
            self.late.push(now.to_vec());
        }
        if frame == self.last {
            said.extend(self.creep(now));
        }
        said
    }

    /// Whether points go on moving at the end, slowly, though nothing keeps them in motion.
    fn creep(&self, now: &[[f64; 2]]) -> Option<String> {
        // A plate may push.
        self.start_energy?;
        // None if the start is longer than half of the rollout.
        let [half, quarter] = self.late.as_slice() else { return None };
        let time = self.quarter as f64 * self.interval;
        let square = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2);
        let speed = |to: &[[f64; 2]], from: &[[f64; 2]]| {
            let sum: f64 = to.iter().zip(from).map(square).sum();
            (sum / to.len().max(1) as f64).sqrt() / time
        };
        let (before, after) = (speed(quarter, half), speed(now, quarter));
        let end = |pick: fn(f64, f64) -> f64, from| now.iter().map(|x| x[1]).fold(from, pick);
        let height = end(f64::max, f64::MIN) - end(f64::min, f64::MAX);
        let gravity = self.gravity[0].hypot(self.gravity[1]);
        let slow = after < SLOW * (gravity * height).sqrt();
        let waited = time > PATIENCE * (height / gravity).sqrt();
        (slow && waited && after > CREEP && after > LASTING * before).then(|| {
            format!(
                "the end should be at rest, but points creep on at {:.0} mm/s ({:.0} mm/s before): \
                 do not trust the deposit",
                1e3 * after,
                1e3 * before
            )
        })
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
    use rstest::rstest;

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
        let mut watch = Watch::new(&start, INTERVAL, 100);
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
        let mut watch = Watch::new(&start, INTERVAL, 100);
        let up: Vec<[f64; 2]> = start.positions[1].iter().map(|x| [x[0], x[1] + 0.1]).collect();
        let said = watch.observe(2, &start.positions[1], &up);
        assert!(said.len() == 1 && said[0].contains("mechanical energy"), "{said:?}");
        // The same points on a quarter of the area.
        let dense: Vec<[f64; 2]> = up.iter().map(|x| x.map(|x| 0.5 * x)).collect();
        let said = watch.observe(3, &up, &dense);
        assert!(said.len() == 1 && said[0].contains("packed 2 times"), "{said:?}");
        assert_eq!(watch.observe(4, &up, &dense), Vec::<String>::new());
    }

    /// What is said of the last frame of a rollout of the block on the floor, all of which has moved
    /// to the right by `path` (m) at each time (s).
    fn said_at_the_end(path: impl Fn(f64) -> f64) -> Vec<String> {
        let mut start = start();
        let down = |x: &[f64; 2]| [x[0], x[1] - 1.0];
        start.positions = start.positions.iter().map(|f| f.iter().map(down).collect()).collect();
        let at = |frame: usize| -> Vec<[f64; 2]> {
            let moved = path(frame as f64 * INTERVAL);
            start.positions[0].iter().map(|x| [x[0] + moved, x[1]]).collect()
        };
        let mut watch = Watch::new(&start, INTERVAL, 81);
        let said = (2..81).map(|k| watch.observe(k, &at(k - 1), &at(k))).collect::<Vec<_>>();
        said.concat()
    }

    #[test]
    fn creep_at_rest_is_said_at_the_end() {
        let said = said_at_the_end(|t| 0.012 * t);
        assert!(said.len() == 1 && said[0].contains("creep on at 12 mm/s"), "{said:?}");
    }

    #[rstest]
    #[case::as_the_direct_solver_at_rest(|t: f64| 0.001 * t)]
    #[case::a_slide_that_friction_stops(|t: f64| { let t = t.min(0.4); 0.4 * t - 0.5 * t * t })]
    #[case::an_exponential_decay(|t: f64| 0.05 * (1.0 - (-t / 0.2).exp()))]
    #[case::a_flow_that_goes_on(|t: f64| 0.45 * t)]
    fn what_comes_to_rest_or_flows_does_not_creep(#[case] path: fn(f64) -> f64) {
        assert_eq!(said_at_the_end(path), Vec::<String>::new());
    }
}
