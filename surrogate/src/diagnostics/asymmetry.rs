//! Mirror asymmetry: left and right are alike in physics, but not to every network.

use dempm::scene::{Rectangle, Scene};

use crate::evaluation::mean_square_distance;
use crate::rollout::{InitialFrames, Rollout};
use crate::simulator::Simulator;

/// Frames of each rollout that are compared.
const FRAMES: usize = 15;
/// Tolerated distance between the two after these frames, as a fraction of the motion. In ten
/// collapses of 1.2 s (five networks, a free column and one at a wall: `validation report`, "Mirror
/// asymmetry") the final distance was 0.4 to [`GROWTH`] times that, up to a tenth of the motion.
const TOLERANCE: f64 = 0.03;
/// Largest ratio of the final distance to that after [`FRAMES`] frames.
const GROWTH: f64 = 3.3;

/// Distance between a rollout and its mirror image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MirrorDifference {
    /// Predicted frames that were compared.
    pub frames: usize,
    /// Root mean square distance of the points, one rollout mirrored back, divided by their
    /// motion since the first frame, or by the motion under typical training accelerations if
    /// that is larger.
    pub ratio: f64,
}

/// Warning about a network whose rollout and mirrored rollout differ; none if it averages both.
pub fn asymmetry(simulator: &Simulator, initial: &InitialFrames) -> Option<String> {
    if simulator.mirror {
        return None;
    }
    let MirrorDifference { frames, ratio } = mirror_difference(simulator, initial)?;
    (ratio > TOLERANCE).then(|| {
        format!(
            "after {frames} frames, the prediction and its mirror image differ by {:.0} % of the \
             motion, and by up to {:.0} % at the end: --mirror averages both",
            100.0 * ratio,
            100.0 * GROWTH * ratio
        )
    })
}

/// Compares a rollout with that of the mirrored initial frames, in the last of `FRAMES` frames
/// that both reach; `None` if one fails at once.
pub fn mirror_difference(
    simulator: &Simulator,
    initial: &InitialFrames,
) -> Option<MirrorDifference> {
    let predicted = |initial: &InitialFrames| -> Vec<Vec<[f64; 2]>> {
        let mut rollout = Rollout::new(simulator, initial);
        (0..FRAMES).map_while(|_| Some(rollout.advance().ok()?.to_vec())).collect()
    };
    let width = initial.scene.domain.size[0];
    let (straight, image) = (predicted(initial), predicted(&mirror_image(initial)));
    let frames = straight.len().min(image.len());
    let (straight, image) = straight.iter().zip(&image).next_back()?;
    let back: Vec<[f64; 2]> = image.iter().map(|[x, y]| [width - x, *y]).collect();
    let apart = mean_square_distance(straight, &back).sqrt();
    let motion = mean_square_distance(straight, &initial.positions[0]).sqrt();
    let spread: f64 = simulator.normalisation.acceleration_std.iter().map(|s| s * s).sum();
    let usual = 0.5 * spread.sqrt() * (frames * frames) as f64;
    Some(MirrorDifference { frames, ratio: apart / motion.max(usual) })
}

/// Initial frames with left and right exchanged: positions, velocities, gravity and boxes.
pub fn mirror_image(initial: &InitialFrames) -> InitialFrames {
    let mut image = initial.clone();
    let width = initial.scene.domain.size[0];
    image.positions.iter_mut().flatten().for_each(|x| x[0] = width - x[0]);
    image.velocities.iter_mut().flatten().for_each(|v| v[0] = -v[0]);
    let Scene { gravity, obstacles, plate, .. } = &mut image.scene;
    gravity[0] = -gravity[0];
    let reflect = |place: &mut Rectangle| place.corner[0] = width - place.corner[0] - place.size[0];
    for obstacle in obstacles {
        reflect(&mut obstacle.place);
        std::mem::swap(&mut obstacle.faces.left, &mut obstacle.faces.right);
    }
    if let Some(plate) = plate {
        reflect(&mut plate.place);
        plate.velocity[0] = -plate.velocity[0];
        std::mem::swap(&mut plate.faces.left, &mut plate.faces.right);
    }
    image
}
