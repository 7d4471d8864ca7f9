//! When everything has come to rest.

use serde::{Deserialize, Serialize};

use crate::scene::Scene;
use crate::trajectory::Frame;

/// How far points stray at rest, over the diameter of a grain: root mean square over the mass, and largest.
const MEAN_DISTANCE: f64 = 0.02;
const LARGEST_DISTANCE: f64 = 0.2;
/// For how long, over $\sqrt{d / g}$: in that time what falls from rest moves by eight diameters.
const INTERVAL: f64 = 4.0;
/// Root mean square of their speeds over $\sqrt{g d}$, at most: packings in points shake with a fifth of that for long.
const MEAN_SPEED: f64 = 0.05;

/// Looks for the time from which on everything is at rest, frame by frame: with the displacements $u_p$ of points of mass
/// $m_p$ since a frame, their speeds $v_p$, gravity $g$ and the diameter $d$ of a grain,
/// $\sum m_p u_p^2 \le (0.02 d)^2 \sum m_p$, $\max u_p \le 0.2 d$ and $\sum m_p v_p^2 \le 0.05^2 g d \sum m_p$ over
/// $4 \sqrt{d / g}$, after anything has moved. Where nothing falls, or a plate moves, nothing comes to rest.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Rest {
    /// Whether anything has moved.
    moved: bool,
    /// The first of the frames since which all points are near, and where they were.
    since: f64,
    places: Vec<[f64; 2]>,
    /// The frame that shows the rest (s).
    time: Option<f64>,
}

impl Rest {
    /// Takes the next frame of a scene into account; `mass` is that of its points.
    pub fn observe(&mut self, scene: &Scene, mass: &[f64], frame: &Frame) {
        let gravity = scene.gravity[0].hypot(scene.gravity[1]);
        let moves = scene.plate.is_some_and(|plate| plate.velocity != [0.0; 2]);
        if gravity == 0.0 || moves {
            return;
        }
        let diameter = match scene.material.grain() {
            (0.0, _) => scene.domain.spacing(),
            (diameter, _) => diameter,
        };
        let first = self.places.is_empty();
        if first || !self.is_near(mass, frame, diameter, gravity) {
            self.moved |= !first;
            (self.since, self.places) = (frame.time, frame.position.clone());
        } else if self.moved {
            let lasts = frame.time - self.since >= INTERVAL * (diameter / gravity).sqrt();
            self.time = self.time.or(lasts.then_some(frame.time));
        }
    }

    /// Whether all points are where they were, and hardly move.
    fn is_near(&self, mass: &[f64], frame: &Frame, diameter: f64, gravity: f64) -> bool {
        let square = |[x, y]: [f64; 2]| x * x + y * y;
        let pairs = || self.places.iter().zip(&frame.position);
        let strayed = || pairs().map(|(a, b)| square([0, 1].map(|k| b[k] - a[k])));
        let speeds = frame.velocity.iter().map(|&v| square(v));
        let total: f64 = mass.iter().sum();
        let mean = |squares: &mut dyn Iterator<Item = f64>| {
            squares.zip(mass).map(|(square, m)| m * square).sum::<f64>() / total
        };
        let far = LARGEST_DISTANCE * diameter;
        mean(&mut strayed()) <= (MEAN_DISTANCE * diameter).powi(2)
            && mean(&mut { speeds }) <= MEAN_SPEED * MEAN_SPEED * gravity * diameter
            && strayed().all(|square| square <= far * far)
    }

    /// The time (s) of the frame from which on everything is at rest.
    pub fn time(&self) -> Option<f64> {
        self.time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The time of rest of two points, of which one, with a hundredth of the mass, has this displacement (m) and speed
    /// (m/s) in frames every 0.05 s. Grains have 7.5 mm, so that sqrt(g d) = 0.271 m/s and 4 sqrt(d / g) = 0.111 s.
    fn rest_of(extra: &str, motion: &[[f64; 2]]) -> Option<f64> {
        let text = format!(
            "duration = 1.0\n{extra}\n[[column]]\nsize = [0.5, 0.5]\n[material]\nkind = \"mu-i\"\n\
             [domain]\nsize = [2.0, 1.0]\n"
        );
        let scene = Scene::parse(&text, "scene.toml").unwrap();
        let mut rest = Rest::default();
        for (k, &[x, v]) in motion.iter().enumerate() {
            let (position, velocity) = (vec![[x, 0.5], [1.0; 2]], vec![[v, 0.0], [0.0; 2]]);
            let frame = Frame { time: 0.05 * k as f64, position, velocity, ..Frame::default() };
            rest.observe(&scene, &[1.0, 99.0], &frame);
        }
        rest.time()
    }

    /// Moves far within the first two frames and then at a constant speed (m/s).
    fn slows_to(speed: f64, frames: usize) -> Vec<[f64; 2]> {
        let slow = (0..frames).map(|k| [0.5 + 0.05 * speed * k as f64, speed]);
        [[0.0, 0.0], [0.2, 5.0]].into_iter().chain(slow).collect()
    }

    #[test]
    fn rest_is_what_lasts() {
        // Three intervals of 0.05 s are more than 0.111 s, two are not.
        assert_eq!(rest_of("", &slows_to(0.005, 4)), Some(0.25));
        assert_eq!(rest_of("", &slows_to(0.005, 3)), None);
        // The top of a throw: there for a moment.
        assert_eq!(rest_of("", &[[0.0, 1.0], [0.1, 0.0], [0.1, 0.0], [0.0, -1.0]]), None);
    }

    /// A tenth of the displacement of the one point is the mean: within 0.15 mm over 0.15 s up to 0.01 m/s.
    #[test]
    fn slow_creep_is_rest() {
        assert!(rest_of("", &slows_to(0.0095, 9)).is_some());
        assert!(rest_of("", &slows_to(0.0105, 9)).is_none());
    }

    /// A tenth of the speed is the mean: shaking in one place is rest up to 0.0136 m/s.
    #[test]
    fn shaking_is_rest_up_to_a_limit() {
        let shakes = |speed: f64| [slows_to(0.0, 0), vec![[0.5, speed]; 9]].concat();
        assert!(rest_of("", &shakes(0.13)).is_some() && rest_of("", &shakes(0.14)).is_none());
    }

    #[test]
    fn what_has_not_moved_is_not_at_rest() {
        assert_eq!(rest_of("", &[[0.5, 0.0]; 10]), None);
    }

    #[test]
    fn plates_move_on_and_without_gravity_nothing_stops() {
        let plate = "[plate]\ncorner = [1.0, 0.5]\nsize = [0.5, 0.25]\nvelocity = [0.0, -0.1]";
        assert_eq!(rest_of(plate, &slows_to(0.0, 9)), None);
        assert_eq!(rest_of("gravity = [0.0, 0.0]", &slows_to(0.0, 9)), None);
        assert!(rest_of("", &slows_to(0.0, 9)).is_some());
    }
}
