//! Batches: the examples of one training step, normalised.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::emphasis::appearances;
use super::{DataError, DataSet, Example, Examples, Sampler, Unrolling};
use crate::features::{Normalisation, Obstacle};

/// Windows and targets of one step, as the network gets them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// Positions (m) of each window, frame by frame, the oldest first.
    pub windows: Vec<Vec<f32>>,
    /// Points of each window.
    pub points: Vec<usize>,
    /// Static features of the points of each window.
    pub statics: Vec<Vec<f32>>,
    /// Obstacles of each window.
    pub obstacles: Vec<Vec<Obstacle>>,
    /// Normalised accelerations of the points of all windows.
    pub targets: Vec<f32>,
}

/// The share of a process in the windows of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Number of the process, from 0.
    pub rank: usize,
    /// Number of processes.
    pub ranks: usize,
}

/// How windows become batches.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// Seed of the order, noise and mirror images.
    pub seed: u64,
    /// Windows in a batch.
    pub batch: usize,
    /// Share of this process.
    pub shard: Shard,
    /// Whether the windows of a step have similar numbers of points.
    pub alike: bool,
    /// Most appearances of a window in a pass.
    pub emphasis: usize,
    /// Frames of a window. Examples of the data set have `unroll` more.
    pub frames: usize,
    /// Largest number of steps that the network unrolls by itself before it learns (pushforward).
    pub unroll: usize,
    /// First training step with pushforward.
    pub unroll_from: u64,
    /// Standard deviation of the noise on the last velocity, m/frame.
    pub noise: f64,
    /// Whether to mirror half of the windows, at random.
    pub mirror: bool,
    /// Whether targets are relative to free fall.
    pub without_gravity: bool,
    /// Normalisation of the targets.
    pub normalisation: Normalisation,
}

impl Recipe {
    /// The order in which all windows are visited.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn sampler(&self, data: &DataSet) -> Result<Sampler, DataError> {
        let sampler = match self.emphasis {
            1 => Sampler::new(self.seed, data.len()),
            most => {
                let deviation = [0, 1].map(|k| self.normalisation.acceleration_std[k]);
                Sampler::repeated(self.seed, &appearances(data, self.frames, deviation, most)?)
            }
        };
        Ok(match self.alike {
            true => sampler.bucketed(data.points(), self.shard.ranks * self.batch),
            false => sampler,
        })
    }

    /// The windows of a step, drawn with [`sampler`](Self::sampler). The windows of all ranks
    /// follow one another, so n ranks learn from the same windows as one rank with n times the
    /// batch.
    pub fn windows(&self, sampler: &mut Sampler, step: u64) -> Vec<usize> {
        self.places(step).map(|place| sampler.window(place)).collect()
    }

    /// Positions of a step's windows in the sampler's sequence.
    fn places(&self, step: u64) -> impl Iterator<Item = u64> + use<> {
        let Shard { rank, ranks } = self.shard;
        let first = (step * ranks as u64 + rank as u64) * self.batch as u64;
        first..first + self.batch as u64
    }

    /// The examples of a step from its `windows`: a function of seed and step alone.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn examples(
        &self,
        data: &DataSet,
        windows: &[usize],
        step: u64,
    ) -> Result<Examples, DataError> {
        let [[_, width], _] = data.bounds();
        let mut examples = Examples { windows: Vec::new(), future: Vec::new(), unroll: 0 };
        if self.unroll > 0 && step >= self.unroll_from {
            examples.unroll = self.rng(u64::MAX - step).random_range(0..=self.unroll);
        }
        for (place, &window) in self.places(step).zip(windows) {
            let mut example = data.example(window)?;
            let mut rng = self.rng(place);
            if self.mirror && rng.random() {
                example.mirror(width);
            }
            let future = example.shorten(self.frames);
            if self.noise > 0.0 {
                example.add_noise(self.noise, &mut rng);
            }
            examples.windows.push(example);
            examples.future.push(future);
        }
        Ok(examples)
    }

    /// Random numbers independent of the order, which uses the seed itself.
    fn rng(&self, stream: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(!self.seed);
        rng.set_stream(stream);
        rng
    }

    /// Windows and normalised targets of examples.
    pub fn batch(&self, examples: &Examples) -> Batch {
        let mut batch = Batch::default();
        for example in &examples.windows {
            let scales = self.scales(example);
            let normalised = |(a, [mean, std]): (f64, [f64; 2])| ((a - mean) / std) as f32;
            batch.targets.extend(example.acceleration().into_iter().zip(scales).map(normalised));
            batch.points.push(example.points);
            batch.windows.push(example.window());
            batch.statics.push(example.statics.clone());
            batch.obstacles.push(example.obstacles.clone());
        }
        batch
    }

    /// Accelerations (m/frame²) from the normalised output of the network; inverse of the targets of
    /// [`batch`](Self::batch).
    pub fn accelerations(&self, examples: &Examples, normalised: &[f32]) -> Vec<f64> {
        let scales = examples.windows.iter().flat_map(|e| self.scales(e).take(e.values()));
        normalised.iter().zip(scales).map(|(&a, [mean, std])| f64::from(a) * std + mean).collect()
    }

    /// What it takes to unroll the windows on a GPU; none without pushforward.
    pub fn unrolling(&self, examples: &Examples) -> Option<Unrolling> {
        (examples.unroll > 0).then(|| Unrolling {
            steps: examples.unroll,
            last_two: examples.last_two(),
            truth: examples.truth(),
            mean: examples.windows.iter().map(|example| self.mean(example)).collect(),
            std: self.std(),
        })
    }

    /// Mean and standard deviation of the normalisation, for x and y in turn.
    fn scales(&self, example: &Example) -> impl Iterator<Item = [f64; 2]> + use<> {
        let (mean, std) = (self.mean(example), self.std());
        [0, 1].map(|axis| [mean[axis], std[axis]]).into_iter().cycle()
    }

    fn mean(&self, example: &Example) -> [f64; 2] {
        [0, 1].map(|axis| {
            let gravity = if self.without_gravity { example.gravity[axis] } else { 0.0 };
            self.normalisation.acceleration_mean[axis] + gravity
        })
    }

    fn std(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.normalisation.acceleration_std[axis])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Targets and predicted accelerations are inverses, also relative to free fall, which may differ
    /// from example to example.
    #[test]
    fn accelerations_follow_from_targets() {
        let example = |points: usize, gravity| Example {
            points,
            positions: (0..6 * points).map(|k| 0.1 * (k as f64).sin()).collect(),
            next: vec![0.25; 2 * points],
            gravity,
            statics: Vec::new(),
            obstacles: Vec::new(),
        };
        let examples = vec![example(3, [0.5, -1.0]), example(2, [-0.5, -1.0])];
        let examples = Examples { windows: examples, future: Vec::new(), unroll: 0 };
        let expected: Vec<f64> = examples.windows.iter().flat_map(Example::acceleration).collect();
        for without_gravity in [false, true] {
            let recipe = Recipe {
                seed: 1,
                batch: 2,
                shard: Shard { rank: 0, ranks: 1 },
                alike: false,
                emphasis: 1,
                frames: 3,
                unroll: 0,
                unroll_from: 0,
                noise: 0.0,
                mirror: false,
                without_gravity,
                normalisation: Normalisation {
                    acceleration_mean: vec![0.1, -0.2],
                    acceleration_std: vec![0.5, 2.0],
                    ..Normalisation::default()
                },
            };
            let targets = recipe.batch(&examples).targets;
            assert_eq!(targets.len(), expected.len());
            for (a, b) in recipe.accelerations(&examples, &targets).iter().zip(&expected) {
                assert!((a - b).abs() < 1e-6, "{a} {b}"); // targets are f32, accelerations about 1
            }
        }
    }
}
