//! The speed of a machine, by kind of work.

use super::disc_rate::disc_steps_per_second;

/// Disc-steps of packings in the time of one of a whole scene, on a processor: 4.7e7 and 4.0e7 a second.
const WHOLE_SCENE: f64 = 0.85;
/// Disc-steps of packings in the time in which a processor moves a point by a step under a law, and in that in which it
/// does with packings.
const POINT: f64 = 8.0;
const POINT_WITH_PACKING: f64 = 40.0;

/// Disc-steps of whole scenes per second of a busy H100, with searches, and with means every 400 steps
/// (`docs/notes/2026-11-26-steps-of-discs.md`).
pub(crate) const WHOLE_SCENES_ON_GPU: f64 = 8.0e9;

/// How fast a machine computes.
#[derive(Clone, Debug, PartialEq)]
pub struct Rates {
    /// Steps of discs in packings per second.
    pub packings: f64,
    /// Steps of discs of whole scenes per second.
    pub discs: f64,
    /// Steps of points under a law per second.
    pub law: f64,
    /// Steps of points with packings per second, without the packings.
    pub points: f64,
    /// Time of a macro step of the smallest scene with packings and under a law, and of a DEM step of the smallest whole
    /// scene (s): what launching kernels takes.
    pub least: [f64; 3],
    /// Steps of discs that are prepared, per second.
    pub preparation: f64,
    /// The same on the processor, which prepares packings.
    pub packing_preparation: f64,
}

impl Rates {
    /// A processor that makes so many disc-steps per second in packings.
    pub fn of_processor(disc_steps_per_second: f64) -> Self {
        let rate = disc_steps_per_second;
        Self {
            packings: rate,
            discs: WHOLE_SCENE * rate,
            law: rate / POINT,
            points: rate / POINT_WITH_PACKING,
            least: [0.0; 3],
            preparation: WHOLE_SCENE * rate,
            packing_preparation: rate,
        }
    }

    /// One H200 with a processor of this speed, from the wall times in `docs/notes/2026-11-23-truth.md`.
    pub fn of_gpu(disc_steps_per_second: f64) -> Self {
        Self {
            packings: 1.9e10,
            discs: WHOLE_SCENES_ON_GPU,
            law: 2.0e8,
            points: 2.0e8,
            least: [45.0e-6, 30.0e-6, 5.0e-6],
            preparation: 2.5e10,
            packing_preparation: disc_steps_per_second,
        }
    }

    /// This machine: its processor is measured, its GPU, if that computes, is taken for an H200.
    ///
    /// # Errors
    /// If the packing for the measurement cannot be prepared.
    pub fn measure(on_gpu: bool) -> Result<Self, dem::Error> {
        let rate = disc_steps_per_second()?;
        Ok(if on_gpu { Self::of_gpu(rate) } else { Self::of_processor(rate) })
    }
}
