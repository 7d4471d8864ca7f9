//! When everything has come to rest.

use serde::{Deserialize, Serialize};

use crate::scene::Scene;
use crate::trajectory::Frame;

/// Speeds of a state at rest over $\sqrt{g d}$: root mean square over the mass, and largest.
const MEAN_SPEED: f64 = 0.01;
const LARGEST_SPEED: f64 = 0.1;
/// How long it lasts, over $\sqrt{d / g}$: what falls from rest is then forty times as fast.
const INTERVAL: f64 = 4.0;

/// Looks for the time from which on everything is at rest, frame by frame: with the speeds $v_p$ of the points, their
/// mass $m_p$, gravity $g$ and the diameter $d$ of a grain,
/// $\sum m_p v_p^2 \le 0.01^2 g d \sum m_p$ and $\max v_p \le 0.1 \sqrt{g d}$ over $4 \sqrt{d / g}$, after anything has moved.
/// Where nothing falls, or a plate moves, nothing comes to rest.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Rest {
    /// Whether anything has been faster.
    moved: bool,
    /// The first of the present frames that are slow (s).
    since: Option<f64>,
    /// The frame that shows the rest (s).
    time: Option<f64>,
}

impl Rest {
    /// Takes the next frame of a scene into account; `mass` is that of its points.
    pub fn observe(&mut self, scene: &Scene, mass: &[f64], frame: &Frame) {
        let gravity = scene.gravity[0].hypot(scene.gravity[1]);
        let diameter = match scene.material.grain() {
            (0.0, _) => scene.domain.spacing(),
            (diameter, _) => diameter,
        };
        if !is_slow(&frame.velocity, mass, gravity * diameter) {
            (self.moved, self.since) = (true, None);
        } else if self.moved && !scene.plate.is_some_and(|plate| plate.velocity != [0.0; 2]) {
            let since = *self.since.get_or_insert(frame.time);
            let lasts = frame.time - since >= INTERVAL * (diameter / gravity).sqrt();
            self.time = self.time.or(lasts.then_some(frame.time));
        }
    }

    /// The time (s) of the frame from which on everything is at rest.
    pub fn time(&self) -> Option<f64> {
        self.time
    }
}

/// Whether points of these velocities (m/s) and masses are slow beside a `square` of a speed (m²/s²).
fn is_slow(velocity: &[[f64; 2]], mass: &[f64], square: f64) -> bool {
    let squares = || velocity.iter().map(|[u, v]| u * u + v * v);
    let energy: f64 = squares().zip(mass).map(|(v2, m)| m * v2).sum();
    let largest = LARGEST_SPEED * LARGEST_SPEED * square;
    energy <= MEAN_SPEED * MEAN_SPEED * square * mass.iter().sum::<f64>()
        && squares().all(|v2| v2 <= largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames of two points at these speeds (m/s), every 0.05 s; the time of rest. The grains have 7.5 mm, so that
    /// sqrt(g d) = 0.271 m/s and 4 sqrt(d / g) = 0.111 s.
    fn rest_of(extra: &str, speeds: &[f64]) -> Option<f64> {
        let text = format!(
            "duration = 1.0\n{extra}\n[[column]]\nsize = [0.5, 0.5]\n[material]\nkind = \"mu-i\"\n\
             [domain]\nsize = [2.0, 1.0]\n"
        );
        let scene = Scene::parse(&text, "scene.toml").unwrap();
        let mut rest = Rest::default();
        for (k, &speed) in speeds.iter().enumerate() {
            let (time, velocity) = (0.05 * k as f64, vec![[0.0, -speed], [0.0, 0.0]]);
            let frame = Frame { time, velocity, ..Frame::default() };
            // The second point has 99 times the mass: the mean is a tenth of the speed.
            rest.observe(&scene, &[1.0, 99.0], &frame);
        }
        rest.time()
    }

    #[test]
    fn rest_is_what_lasts() {
        // Three intervals of 0.05 s are more than 0.111 s.
        assert_eq!(rest_of("", &[0.0, 1.0, 0.02, 0.02, 0.02, 0.02, 0.02]), Some(0.25));
        assert_eq!(rest_of("", &[0.0, 1.0, 0.02, 0.02, 0.02]), None);
        // The top of a throw lasts for one frame.
        assert_eq!(rest_of("", &[1.0, 0.5, 0.0, 0.5, 1.0, 0.0, 0.0]), None);
    }

    #[test]
    fn what_has_not_moved_is_not_at_rest() {
        assert_eq!(rest_of("", &[0.0; 10]), None);
        assert_eq!(rest_of("", &[0.02; 10]), None);
    }

    #[test]
    fn the_limits_are_those_of_the_speed_of_a_grain() {
        let settles_at = |speed: f64| rest_of("", &[&[1.0][..], &[speed; 9]].concat()).is_some();
        assert!(settles_at(0.9 * 0.0271) && !settles_at(1.1 * 0.0271));
    }

    #[test]
    fn plates_move_on_and_without_gravity_nothing_stops() {
        let plate = "[plate]\ncorner = [1.0, 0.5]\nsize = [0.5, 0.25]\nvelocity = [0.0, -0.1]";
        let speeds = [&[1.0][..], &[0.0; 19]].concat();
        assert_eq!(rest_of(plate, &speeds), None);
        assert_eq!(rest_of("gravity = [0.0, 0.0]", &speeds), None);
        assert_eq!(rest_of("", &speeds), Some(0.2));
    }
}
