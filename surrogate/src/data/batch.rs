//! Batches: what a model learns from in one step.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{DataError, DataSet, Draft, Example, Order, Unrolling};
use crate::features::{Normalisation, Obstacle};

/// Windows and what should follow, ready for the model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Batch {
    /// Positions of each window, m, frame after frame, the oldest first.
    pub windows: Vec<Vec<f32>>,
    /// Points of each window.
    pub points: Vec<usize>,
    /// Features of the points of each window that never change.
    pub statics: Vec<Vec<f32>>,
    /// Obstacles of each window.
    pub obstacles: Vec<Vec<Obstacle>>,
    /// Normalised accelerations of the points of all windows.
    pub targets: Vec<f32>,
}

/// Which windows of a step a process takes, of those that train one network together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    pub rank: usize,
    pub ranks: usize,
}

/// How batches are made of windows.
#[derive(Clone, Debug)]
pub struct Recipe {
    /// Seed of order, noise and mirror images.
    pub seed: u64,
    /// Windows in a batch.
    pub batch: usize,
    pub shard: Shard,
    /// Whether the windows of a step have about as many points each.
    pub alike: bool,
    /// Frames of a window. The examples of the data set are longer by as many frames as
    /// `unroll` may have.
    pub frames: usize,
    /// Steps that the model makes by itself before it learns, at most (pushforward),
    pub unroll: usize,
    /// and the training step from which on it does.
    pub unroll_from: u64,
    /// Standard deviation of the noise on the last velocity, m/frame.
    pub noise: f64,
    /// Mirrors every other window, at random.
    pub mirror: bool,
    /// Learns accelerations relative to free fall.
    pub without_gravity: bool,
    /// The normalisation of the targets.
    pub normalisation: Normalisation,
}

impl Recipe {
    /// The order of all windows.
    pub fn order(&self, data: &DataSet) -> Order {
        let order = Order::new(self.seed, data.len());
        if self.alike { order.alike(data.points(), self.shard.ranks * self.batch) } else { order }
    }

    /// The windows of a step, in an order that has to be that of [`order`](Self::order). Those of all ranks of a
    /// step follow one another, so n ranks learn what one with n times the batch would.
    pub fn windows(&self, order: &mut Order, step: u64) -> Vec<usize> {
        self.places(step).map(|place| order.window(place)).collect()
    }

    /// The places of the windows of a step in the order.
    fn places(&self, step: u64) -> impl Iterator<Item = u64> + use<> {
        let Shard { rank, ranks } = self.shard;
        let first = (step * ranks as u64 + rank as u64) * self.batch as u64;
        first..first + self.batch as u64
    }

    /// The examples of a step, made of its `windows`. The same step always gives the same examples.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn draft(&self, data: &DataSet, windows: &[usize], step: u64) -> Result<Draft, DataError> {
        let [[_, width], _] = data.bounds();
        let mut draft = Draft { examples: Vec::new(), future: Vec::new(), unroll: 0 };
        if self.unroll > 0 && step >= self.unroll_from {
            draft.unroll = self.rng(u64::MAX - step).random_range(0..=self.unroll);
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
            draft.examples.push(example);
            draft.future.push(future);
        }
        Ok(draft)
    }

    /// Random numbers that are not those of the order, which has the seed itself.
    fn rng(&self, stream: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(!self.seed);
        rng.set_stream(stream);
        rng
    }

    /// What the model gets of examples.
    pub fn batch(&self, draft: &Draft) -> Batch {
        let mut batch = Batch::default();
        for example in &draft.examples {
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

    /// Accelerations in m/frame² of what the model says of examples.
    pub fn accelerations(&self, draft: &Draft, normalised: &[f32]) -> Vec<f64> {
        let scales = draft.examples.iter().flat_map(|e| self.scales(e).take(e.values()));
        normalised.iter().zip(scales).map(|(&a, [mean, std])| f64::from(a) * std + mean).collect()
    }

    /// What it takes to move the windows on elsewhere, if that is to be done.
    pub fn unrolling(&self, draft: &Draft) -> Option<Unrolling> {
        (draft.unroll > 0).then(|| Unrolling {
            steps: draft.unroll,
            last_two: draft.last_two(),
            truth: draft.truth(),
            mean: draft.examples.iter().map(|example| self.mean(example)).collect(),
            std: self.std(),
        })
    }

    /// Mean and standard deviation that accelerations are normalised with, for x and y in turn.
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

    /// What the model learns and what is made of its answers are inverses, also relative to free
    /// fall, which a mirror or another scene may change from example to example.
    #[test]
    fn accelerations_come_back_from_what_the_model_should_say() {
        let example = |points: usize, gravity| Example {
            points,
            positions: (0..6 * points).map(|k| 0.1 * (k as f64).sin()).collect(),
            next: vec![0.25; 2 * points],
            gravity,
            statics: Vec::new(),
            obstacles: Vec::new(),
        };
        let examples = vec![example(3, [0.5, -1.0]), example(2, [-0.5, -1.0])];
        let draft = Draft { examples, future: Vec::new(), unroll: 0 };
        let expected: Vec<f64> = draft.examples.iter().flat_map(Example::acceleration).collect();
        for without_gravity in [false, true] {
            let recipe = Recipe {
                seed: 1,
                batch: 2,
                shard: Shard { rank: 0, ranks: 1 },
                alike: false,
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
            let targets = recipe.batch(&draft).targets;
            assert_eq!(targets.len(), expected.len());
            for (a, b) in recipe.accelerations(&draft, &targets).iter().zip(&expected) {
                assert!((a - b).abs() < 1e-6, "{a} {b}"); // targets are f32, accelerations about 1
            }
        }
    }
}
