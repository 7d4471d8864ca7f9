//! Training windows with noise, and their targets, made on the device. The kernel is `noise.cu`, the
//! CPU twin [`make_windows_on_cpu`].
//!
//! Noise comes from a generator that is a function of seed, window, frame and point (Philox), so it
//! does not depend on the device, nor on what was computed before.

use std::f64::consts::TAU;

use cudarc::driver::DeviceRepr;

use crate::data::Example;
use crate::features::Normalisation;

/// The source of the kernel.
pub const NOISE_SOURCE: &str = include_str!("noise.cu");

/// How training windows are made of examples.
#[derive(Clone, Debug)]
pub struct Augmentation {
    /// Seed of the noise.
    pub seed: u64,
    /// Standard deviation of the noise on the last velocity (m/frame).
    pub noise: f64,
    /// Whether targets are relative to free fall.
    pub without_gravity: bool,
    /// Width of the domain (m).
    pub width: f64,
}

/// An example of a batch.
#[derive(Clone, Debug)]
pub struct Member {
    pub example: Example,
    /// Number of the window in the training, counted through all passes: fixes its noise.
    pub place: u64,
    /// Whether to take the mirror image.
    pub mirror: bool,
}

/// `Walk` of `noise.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub(super) struct Walk {
    seed: u64,
    step: f64,
    width: f64,
    acceleration_mean: [f64; 3],
    acceleration_std: [f64; 3],
    values: u32,
    frames: u32,
}

// SAFETY: plain numbers without padding, laid out as in `noise.cu`.
unsafe impl DeviceRepr for Walk {}

impl Walk {
    pub fn new(augmentation: &Augmentation, norm: &Normalisation, batch: &HostBatch) -> Self {
        let mut walk = Self {
            seed: augmentation.seed,
            // The errors of all velocities but the first add up to the last one's.
            step: augmentation.noise / ((batch.frames - 1) as f64).sqrt(),
            width: augmentation.width,
            acceleration_mean: [0.0; 3],
            acceleration_std: [1.0; 3],
            values: batch.values as u32,
            frames: batch.frames as u32,
        };
        let d = norm.acceleration_mean.len();
        walk.acceleration_mean[..d].copy_from_slice(&norm.acceleration_mean);
        walk.acceleration_std[..d].copy_from_slice(&norm.acceleration_std);
        walk
    }
}

/// `Member` of `noise.cu`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MemberRecord {
    place: u64,
    gravity: [f64; 3],
    first: u32,
    mirror: u32,
}

// SAFETY: plain numbers without padding, laid out as in `noise.cu`.
unsafe impl DeviceRepr for MemberRecord {}

/// Examples as the arrays that the kernel reads.
pub(super) struct HostBatch {
    /// Numbers in a frame of all windows.
    pub values: usize,
    /// Frames of a window, without the one after it.
    pub frames: usize,
    /// (frames + 1) x points of all windows x dimensions (m).
    pub truth: Vec<f64>,
    pub members: Vec<MemberRecord>,
}

impl HostBatch {
    /// The examples side by side; all have `frames` frames.
    pub fn new(members: &[Member], frames: usize, without_gravity: bool) -> Self {
        let values = members.iter().map(|member| member.example.values()).sum();
        let mut truth = Vec::with_capacity((frames + 1) * values);
        for frame in 0..frames {
            for Member { example, .. } in members {
                truth.extend(&example.positions[frame * example.values()..][..example.values()]);
            }
        }
        members.iter().for_each(|member| truth.extend(&member.example.next));
        let mut first = 0;
        let members = members
            .iter()
            .map(|member| {
                let [x, y] = member.example.gravity;
                let gravity = if without_gravity { [x, y, 0.0] } else { [0.0; 3] };
                let (place, mirror) = (member.place, u32::from(member.mirror));
                let record = MemberRecord { place, gravity, first, mirror };
                first += member.example.values() as u32;
                record
            })
            .collect();
        Self { values, frames, truth, members }
    }
}

/// The twin of `make_windows` in `noise.cu`: positions of each frame (frames x points x dimensions)
/// and the normalised accelerations to learn (points x dimensions), of all windows side by side.
///
/// # Panics
/// If there is no example, or examples differ in their number of frames.
pub fn make_windows_on_cpu(
    augmentation: &Augmentation,
    norm: &Normalisation,
    members: &[Member],
) -> (Vec<f32>, Vec<f32>) {
    let example = &members[0].example;
    let frames = example.positions.len() / example.values();
    let batch = HostBatch::new(members, frames, augmentation.without_gravity);
    let walk = Walk::new(augmentation, norm, &batch);
    let mut positions = vec![0.0; frames * batch.values];
    let mut targets = vec![0.0; batch.values];
    let owner = members.iter().zip(&batch.members);
    let owner = owner.flat_map(|(m, record)| std::iter::repeat_n(record, m.example.values()));
    for (value, member) in owner.enumerate() {
        let axis = value % norm.acceleration_mean.len();
        let mirrored = member.mirror != 0 && axis == 0;
        let number = value as u32 - member.first;
        let (mut drift, mut error, mut before, mut last) = (0.0, 0.0, 0.0, 0.0);
        for frame in 0..=frames {
            let mut x = batch.truth[frame * batch.values + value];
            if mirrored {
                x = walk.width - x;
            }
            if frame > 0 && frame < frames && walk.step > 0.0 {
                drift += walk.step * normal(walk.seed, member.place, frame as u32, number);
                error += drift;
            }
            x += error;
            if frame < frames {
                positions[frame * batch.values + value] = x as f32;
                (before, last) = (last, x);
            } else {
                let gravity = member.gravity[axis] * if mirrored { -1.0 } else { 1.0 };
                let acceleration = (x - last) - (last - before) - gravity;
                let scaled =
                    (acceleration - walk.acceleration_mean[axis]) / walk.acceleration_std[axis];
                targets[value] = scaled as f32;
            }
        }
    }
    (positions, targets)
}

/// Standard normal deviate number `value` of a frame of a window (Box and Muller).
fn normal(seed: u64, place: u64, frame: u32, value: u32) -> f64 {
    let [a, b, c, d] = philox(
        [value, frame, place as u32, (place >> 32) as u32],
        [seed as u32, (seed >> 32) as u32],
    );
    let uniform = |high: u32, low: u32| {
        let bits = u64::from(high) << 32 | u64::from(low);
        (bits >> 11) as f64 / (1_u64 << 53) as f64
    };
    // 1 - [0, 1) has a logarithm.
    (-2.0 * (1.0 - uniform(a, b)).ln()).sqrt() * (TAU * uniform(c, d)).cos()
}

/// Philox4x32-10 (Salmon et al., SC 2011): random bits that depend on counter and key alone.
fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    let product = |a: u32, b: u32| {
        let wide = u64::from(a) * u64::from(b);
        ((wide >> 32) as u32, wide as u32)
    };
    for _ in 0..10 {
        let (high_0, low_0) = product(0xD251_1F53, counter[0]);
        let (high_1, low_1) = product(0xCD9E_8D57, counter[2]);
        counter = [high_1 ^ counter[1] ^ key[0], low_1, high_0 ^ counter[3] ^ key[1], low_0];
        key = [key[0].wrapping_add(0x9E37_79B9), key[1].wrapping_add(0xBB67_AE85)];
    }
    counter
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Welford;

    /// The known answers of the authors' Random123 (kat_vectors).
    #[test]
    fn known_answers_of_philox() {
        assert_eq!(philox([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(
            philox([u32::MAX; 4], [u32::MAX; 2]),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
        assert_eq!(
            philox(
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0]
            ),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn the_last_velocity_carries_the_whole_noise_and_the_target_undoes_it() {
        let (points, frames, noise) = (20_000, 6, 3e-4);
        let example = Example {
            points,
            positions: vec![1.0; frames * 2 * points],
            next: vec![1.0; 2 * points],
            gravity: [0.0; 2],
            statics: Vec::new(),
        };
        let augmentation = Augmentation { seed: 5, noise, without_gravity: false, width: 10.0 };
        let norm = Normalisation {
            velocity_mean: vec![0.0; 2],
            velocity_std: vec![1.0; 2],
            acceleration_mean: vec![0.0; 2],
            acceleration_std: vec![1.0; 2],
            ..Normalisation::default()
        };
        let member = Member { example, place: 3, mirror: false };
        let (positions, targets) = make_windows_on_cpu(&augmentation, &norm, &[member]);
        assert!(positions[..2 * points].iter().all(|&x| x == 1.0));
        let (last, before) = (&positions[10 * points..], &positions[8 * points..10 * points]);
        let mut spread = Welford::default();
        for ((last, before), target) in last.iter().zip(before).zip(&targets) {
            let velocity = f64::from(last - before);
            spread.add(velocity);
            let rounding = 2.0 * f64::from(f32::EPSILON);
            assert!((velocity + f64::from(*target)).abs() <= rounding, "the next one is the truth");
        }
        assert!((spread.deviation() / noise - 1.0).abs() < 0.02, "{}", spread.deviation());
        assert!(spread.mean().abs() < 0.02 * noise);
    }
}
