//! Rigid boxes as networks see them.

use mpm::Friction;

/// Friction of a face on which nothing slides, and the largest that networks see.
const STICK: f32 = 1.0;

/// A rigid box: at rest, then moving at a constant velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Obstacle {
    /// Lower and upper corner while it rests, m.
    pub corners: [[f64; 2]; 2],
    /// Velocity when it moves, m/frame; zero of a fixed box.
    pub velocity: [f64; 2],
    /// Frames from its start to the newest frame of the window; negative before it moves.
    pub elapsed: f64,
    /// Friction coefficients of the faces: left, right, bottom, top.
    pub friction: [f32; 4],
}

impl Obstacle {
    /// A box that never moves, with smooth faces.
    pub fn fixed(corners: [[f64; 2]; 2]) -> Self {
        Self { corners, velocity: [0.0; 2], elapsed: 0.0, friction: [0.0; 4] }
    }

    /// Whether it never moves.
    pub fn is_fixed(&self) -> bool {
        self.velocity == [0.0; 2]
    }

    /// Lower and upper corner (m), `back` frames before the newest of the window.
    pub fn corners_at(&self, back: usize) -> [[f32; 2]; 2] {
        let moved = self.moving(back).max(0.0);
        self.corners.map(|corner| [0, 1].map(|k| (corner[k] + self.velocity[k] * moved) as f32))
    }

    /// Velocity (m/frame), `back` frames before the newest of the window.
    pub fn velocity_at(&self, back: usize) -> [f32; 2] {
        if self.moving(back) > 0.0 { self.velocity.map(|v| v as f32) } else { [0.0; 2] }
    }

    /// Frames that it has been moving for.
    fn moving(&self, back: usize) -> f64 {
        self.elapsed - back as f64
    }

    /// Makes the next frame the newest of the window.
    pub fn advance(&mut self) {
        self.elapsed += 1.0;
    }

    /// The same with left and right exchanged in a domain of this width (m).
    #[must_use]
    pub fn mirrored(mut self, width: f64) -> Self {
        let [[left, _], [right, _]] = &mut self.corners;
        (*left, *right) = (width - *right, width - *left);
        self.velocity[0] = -self.velocity[0];
        self.friction.swap(0, 1);
        self
    }
}

/// The friction coefficient of a wall or face as networks see it.
pub fn friction_coefficient(friction: Friction) -> f32 {
    match friction {
        Friction::Slip => 0.0,
        Friction::Coulomb(mu) => (mu as f32).min(STICK),
        Friction::Stick => STICK,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plate_rests_and_then_moves() {
        let plate = Obstacle {
            corners: [[1.0, 2.0], [2.0, 3.0]],
            velocity: [0.25, -0.5],
            elapsed: 1.5,
            friction: [0.1, 0.2, 0.3, 0.4],
        };
        // It began to move half a frame after the last frame but two.
        assert_eq!(plate.corners_at(0), [[1.375, 1.25], [2.375, 2.25]]);
        assert_eq!(plate.corners_at(1), [[1.125, 1.75], [2.125, 2.75]]);
        assert_eq!(plate.corners_at(2), [[1.0, 2.0], [2.0, 3.0]]);
        assert_eq!([1, 2].map(|back| plate.velocity_at(back)), [[0.25, -0.5], [0.0; 2]]);
        let mut later = plate;
        later.advance();
        assert_eq!(later.corners_at(1), plate.corners_at(0));

        let image = plate.mirrored(4.0);
        assert_eq!(image.corners_at(0), [[1.625, 1.25], [2.625, 2.25]]);
        assert_eq!(image.velocity, [-0.25, -0.5]);
        assert_eq!(image.friction, [0.2, 0.1, 0.3, 0.4]);
        assert_eq!(image.mirrored(4.0), plate);
    }
}
