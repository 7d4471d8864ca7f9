//! Mirror images: left and right are alike, as gravity points down.

use super::Example;

impl Example {
    /// Mirrors the example in a domain from 0 to `width` along x.
    pub(super) fn mirror(&mut self, width: f64) {
        for frame in [&mut self.positions, &mut self.next] {
            for x in frame.iter_mut().step_by(2) {
                *x = width - *x;
            }
        }
        self.gravity[0] = -self.gravity[0];
        for obstacle in &mut self.obstacles {
            *obstacle = obstacle.mirrored(width);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::data::Example;
    use crate::features::Obstacle;

    #[test]
    fn the_image_moves_and_falls_like_the_original() {
        let example = Example {
            points: 1,
            positions: vec![1.0, 0.5, 1.25, 0.5],
            next: vec![1.75, 0.25],
            gravity: [0.5, -1.0],
            statics: Vec::new(),
            obstacles: vec![Obstacle::fixed([[0.5, 0.0], [1.5, 0.25]])],
        };
        let mut image = example.clone();
        image.mirror(4.0);
        assert_eq!(image.positions, [3.0, 0.5, 2.75, 0.5]);
        assert_eq!(image.velocity(), [-0.25, 0.0]);
        assert_eq!(image.acceleration(), [-0.25, -0.25]);
        assert_eq!(image.gravity, [-0.5, -1.0]);
        assert_eq!(image.obstacles, [Obstacle::fixed([[2.5, 0.0], [3.5, 0.25]])]);
        image.mirror(4.0);
        assert_eq!(image, example);
    }
}
