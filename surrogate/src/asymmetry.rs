//! Physics knows no left and right, but a network may: a start and its mirror image, a little way on.

use dempm::scene::{Rectangle, Scene};

use crate::metrics::mean_square_distance;
use crate::rollout::Rollout;
use crate::simulator::Simulator;
use crate::start::Start;

/// So many frames of each are predicted, if neither breaks down.
const FRAMES: usize = 15;
/// Part of the motion by which the two may be apart by then. In ten collapses of 1.2 s (five
/// networks, a free column and one at a wall: `validation report`, "Mirror asymmetry") they ended 0.4 to
/// 3.3 times as far apart, for which this is where a tenth of the motion begins.
const ASYMMETRY: f64 = 0.03;
/// The largest of those ratios.
const WORST: f64 = 3.3;

/// How far a rollout and that of its mirror image are apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apart {
    /// Predicted frames after which they are.
    pub frames: usize,
    /// Root mean square distance between the points of one and those of the other, mirrored back, over
    /// their motion since the first frame, or over what accelerations as in training would have moved
    /// them by if that is more.
    pub ratio: f64,
}

/// What there is to say of a network that does not average mirror images.
pub fn asymmetry(simulator: &Simulator, start: &Start) -> Option<String> {
    if simulator.mirror {
        return None;
    }
    let Apart { frames, ratio } = mirror_difference(simulator, start)?;
    (ratio > ASYMMETRY).then(|| {
        format!(
            "after {frames} frames the prediction is {:.0} % of the motion away from that of its mirror \
             image, and may end {:.0} % away: --mirror averages both",
            100.0 * ratio,
            100.0 * WORST * ratio
        )
    })
}

/// Compares a rollout with that of its mirror image, in the last of some frames that both have; nothing
/// if one breaks down at once.
pub fn mirror_difference(simulator: &Simulator, start: &Start) -> Option<Apart> {
    let predicted = |start: &Start| -> Vec<Vec<[f64; 2]>> {
        let mut rollout = Rollout::new(simulator, start);
        (0..FRAMES).map_while(|_| Some(rollout.advance().ok()?.to_vec())).collect()
    };
    let width = start.scene.domain.size[0];
    let (straight, image) = (predicted(start), predicted(&image(start)));
    let frames = straight.len().min(image.len());
    let (straight, image) = straight.iter().zip(&image).next_back()?;
    let back: Vec<[f64; 2]> = image.iter().map(|[x, y]| [width - x, *y]).collect();
    let apart = mean_square_distance(straight, &back).sqrt();
    let motion = mean_square_distance(straight, &start.positions[0]).sqrt();
    let spread: f64 = simulator.normalisation.acceleration_std.iter().map(|s| s * s).sum();
    let usual = 0.5 * spread.sqrt() * (frames * frames) as f64;
    Some(Apart { frames, ratio: apart / motion.max(usual) })
}

/// A start with left and right exchanged.
pub fn image(start: &Start) -> Start {
    let mut image = start.clone();
    let width = start.scene.domain.size[0];
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
