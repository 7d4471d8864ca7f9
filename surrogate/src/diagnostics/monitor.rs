//! Monitors a rollout for motion that no material could show. A network cannot know where it is
//! wrong, but energy, density and rest have limits that always hold.

use std::collections::HashMap;

use crate::rollout::InitialFrames;

/// Tolerated gain of mechanical energy, as a fraction of the initial energy.
const ENERGY_TOLERANCE: f64 = 0.05;
/// A place is crowded if its points are this many times as dense as initially.
const DENSER: f64 = 2.0;
/// Tolerated fraction of the points in crowded places. Points of discs are means over grains, which mix: in direct
/// simulations up to 10 % of the points are in such places, in predictions that are as good as expected up to 23 %.
const CROWDED: f64 = 0.25;
/// Motion slower than this fraction of sqrt(g H), for a pile of height H, ends by friction within
/// 0.05 sqrt(H/g) / mu, an instant: if it lasts, it is no flow.
const SLOW: f64 = 0.05;
/// Time after which friction has stopped such motion, in units of sqrt(H/g).
const PATIENCE: f64 = 0.2;
/// Points slower than this (m/s) are at rest: those of the direct solver creep at 1 mm/s.
const CREEP: f64 = 0.005;
/// Creep lasts if its speed stays above this fraction of its earlier speed.
const LASTING: f64 = 0.5;

/// Observes every frame of a rollout; each kind of warning is given once.
pub struct Monitor {
    mass: Vec<f64>,
    /// Gravity, m/s².
    gravity: [f64; 2],
    /// Time between frames, s.
    interval: f64,
    /// Initial distance between points, m.
    spacing: f64,
    /// Mechanical energy of the last initial frame (J/m); none where a plate can add to it.
    initial_energy: Option<f64>,
    /// Whether a gain of energy was reported,
    energy_reported: bool,
    /// and crowded points.
    crowding_reported: bool,
    /// A quarter of the rollout, frames.
    quarter: usize,
    /// Number of the last frame.
    last: usize,
    /// Positions (m) a half and a quarter of the rollout before its end.
    late: Vec<Vec<[f64; 2]>>,
}

impl Monitor {
    /// Monitors a rollout of `frames` frames, the initial ones included, `interval` (s) apart.
    pub fn new(initial: &InitialFrames, interval: f64, frames: usize) -> Self {
        let last = frames.saturating_sub(1);
        let mut monitor = Self {
            mass: initial.points.mass.clone(),
            gravity: initial.scene.gravity,
            interval,
            spacing: initial.scene.domain.spacing(),
            initial_energy: None,
            energy_reported: false,
            crowding_reported: false,
            quarter: last / 4,
            last,
            late: Vec::new(),
        };
        if initial.scene.plate.is_none()
            && let [.., before, last] = initial.window(2, interval).as_slice()
        {
            monitor.initial_energy = Some(monitor.mechanical_energy(before, last));
        }
        monitor
    }

    /// Warnings about frame number `frame` with positions `now`, after those `before` it (m).
    pub fn observe(&mut self, frame: usize, before: &[[f64; 2]], now: &[[f64; 2]]) -> Vec<String> {
        let mut warnings = Vec::new();
        warnings.extend(self.energy_gain(frame, before, now));
        warnings.extend(self.crowding(frame, now));
        if frame + 2 * self.quarter == self.last || frame + self.quarter == self.last {
            self.late.push(now.to_vec());
        }
        if frame == self.last {
            warnings.extend(self.creep(now));
        }
        warnings
    }

    /// Mechanical energy above the initial one.
    fn energy_gain(
        &mut self,
        frame: usize,
        before: &[[f64; 2]],
        now: &[[f64; 2]],
    ) -> Option<String> {
        let initial = self.initial_energy.filter(|_| !self.energy_reported)?;
        let gain = self.mechanical_energy(before, now) - initial;
        self.energy_reported = initial != 0.0 && gain > ENERGY_TOLERANCE * initial.abs();
        self.energy_reported.then(|| {
            let percent = 100.0 * gain / initial.abs();
            format!(
                "frame {frame}: the mechanical energy is {percent:.0} % above its initial value; do \
                 not trust the prediction from here on"
            )
        })
    }

    /// Points denser than any compaction makes them.
    fn crowding(&mut self, frame: usize, now: &[[f64; 2]]) -> Option<String> {
        if self.crowding_reported {
            return None;
        }
        let share = self.crowded_share(now);
        self.crowding_reported = share > CROWDED;
        self.crowding_reported.then(|| {
            format!(
                "frame {frame}: {:.0} % of the points are packed {DENSER} times as densely as \
                 initially; do not trust the prediction from here on",
                100.0 * share
            )
        })
    }

    /// Slow motion at the end that nothing drives.
    fn creep(&self, now: &[[f64; 2]]) -> Option<String> {
        // A plate may push.
        self.initial_energy?;
        // None if the initial frames are more than half of the rollout.
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
                "at the end the deposit creeps on at {:.0} mm/s ({:.0} mm/s before) instead of resting",
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

    /// Fraction of the points in crowded squares of two initial spacings.
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

    /// A block in the air, at rest for two frames.
    fn start() -> InitialFrames {
        let text = "duration = 0.1\n[domain]\nsize = [2.0, 2.0]\n[[column]]\ncorner = [0.5, 1.0]\n\
                    size = [0.5, 0.5]\n[material]\nkind = \"mu-i\"\n";
        let scene = Scene::parse(text, "scene.toml").unwrap();
        let simulation = Simulation::new(scene.clone()).unwrap();
        let frame = simulation.frame();
        InitialFrames {
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
    fn a_free_fall_is_fine() {
        let start = start();
        let mut monitor = Monitor::new(&start, INTERVAL, 100);
        let (mut before, mut now) = (start.positions[0].clone(), start.positions[1].clone());
        for frame in 2..20 {
            let fall = |(x, b): (&[f64; 2], &[f64; 2])| {
                [x[0], 2.0 * x[1] - b[1] - 9.81 * INTERVAL * INTERVAL]
            };
            let next = now.iter().zip(&before).map(fall).collect();
            before = std::mem::replace(&mut now, next);
            assert_eq!(monitor.observe(frame, &before, &now), Vec::<String>::new());
        }
    }

    #[test]
    fn each_warning_is_given_once() {
        let start = start();
        let mut monitor = Monitor::new(&start, INTERVAL, 100);
        let up: Vec<[f64; 2]> = start.positions[1].iter().map(|x| [x[0], x[1] + 0.1]).collect();
        let warnings = monitor.observe(2, &start.positions[1], &up);
        assert!(warnings.len() == 1 && warnings[0].contains("mechanical energy"), "{warnings:?}");
        // The same points on a quarter of the area.
        let dense: Vec<[f64; 2]> = up.iter().map(|x| x.map(|x| 0.5 * x)).collect();
        let warnings = monitor.observe(3, &up, &dense);
        assert!(warnings.len() == 1 && warnings[0].contains("packed 2 times"), "{warnings:?}");
        assert_eq!(monitor.observe(4, &up, &dense), Vec::<String>::new());
    }

    /// A part of the block, pressed to a ninth of its area beside the rest.
    #[rstest]
    #[case::as_mixing_grains_do(0.2, false)]
    #[case::as_no_material_does(0.3, true)]
    fn crowds_may_form_up_to_a_quarter(#[case] part: f64, #[case] warns: bool) {
        let start = start();
        let mut now = start.positions[1].clone();
        let pressed = (part * now.len() as f64).round() as usize;
        for x in &mut now[..pressed] {
            *x = [1.2 + (x[0] - 0.5) / 3.0, (x[1] - 1.0) / 3.0];
        }
        let warnings = Monitor::new(&start, INTERVAL, 100).observe(2, &now, &now);
        assert_eq!(warnings.iter().any(|text| text.contains("packed 2 times")), warns);
    }

    /// Warnings about a rollout in which the block, on the floor, has moved to the right by `path`
    /// (m) at each time (s).
    fn warnings_at_the_end(path: impl Fn(f64) -> f64) -> Vec<String> {
        let mut start = start();
        let down = |x: &[f64; 2]| [x[0], x[1] - 1.0];
        start.positions = start.positions.iter().map(|f| f.iter().map(down).collect()).collect();
        let at = |frame: usize| -> Vec<[f64; 2]> {
            let moved = path(frame as f64 * INTERVAL);
            start.positions[0].iter().map(|x| [x[0] + moved, x[1]]).collect()
        };
        let mut monitor = Monitor::new(&start, INTERVAL, 81);
        let warnings = (2..81).map(|k| monitor.observe(k, &at(k - 1), &at(k))).collect::<Vec<_>>();
        warnings.concat()
    }

    #[test]
    fn creep_at_rest_is_warnings_at_the_end() {
        let warnings = warnings_at_the_end(|t| 0.012 * t);
        assert!(
            warnings.len() == 1 && warnings[0].contains("creeps on at 12 mm/s"),
            "{warnings:?}"
        );
    }

    #[rstest]
    #[case::as_the_direct_solver_at_rest(|t: f64| 0.001 * t)]
    #[case::a_slide_that_friction_stops(|t: f64| { let t = t.min(0.4); 0.4 * t - 0.5 * t * t })]
    #[case::an_exponential_decay(|t: f64| 0.05 * (1.0 - (-t / 0.2).exp()))]
    #[case::a_flow_that_goes_on(|t: f64| 0.45 * t)]
    fn what_comes_to_rest_or_flows_does_not_creep(#[case] path: fn(f64) -> f64) {
        assert_eq!(warnings_at_the_end(path), Vec::<String>::new());
    }
}
