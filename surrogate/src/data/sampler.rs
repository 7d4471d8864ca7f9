//! The order in which windows are visited.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// Steps whose windows are sorted by size together.
const BUCKET_STEPS: usize = 16;

/// Random order of all windows, a new one for every pass (epoch), fixed by the seed. A window can appear several
/// times in a pass.
pub struct Sampler {
    seed: u64,
    pass: u64,
    windows: Vec<usize>,
    buckets: Option<Buckets>,
}

/// Sorts the windows of [`BUCKET_STEPS`] steps by size.
struct Buckets {
    /// Points of each window of the data set.
    points: Vec<usize>,
    /// Windows of a step.
    step: usize,
    /// Number of the bucket that `windows` holds.
    current: Option<u64>,
    windows: Vec<usize>,
}

impl Sampler {
    /// Samples `windows` windows, at least one, each once in a pass.
    pub fn new(seed: u64, windows: usize) -> Self {
        Self::repeated(seed, &vec![1; windows])
    }

    /// Samples windows, each as many times in a pass as `appearances` states.
    pub fn repeated(seed: u64, appearances: &[usize]) -> Self {
        let windows = appearances.iter().enumerate();
        let windows = windows.flat_map(|(window, &times)| std::iter::repeat_n(window, times));
        let mut sampler = Self { seed, pass: 0, windows: windows.collect(), buckets: None };
        sampler.shuffle(0);
        sampler
    }

    /// Groups windows of similar size: each step of `step` windows gets windows with similar
    /// `points` (those of all windows of the data set). The windows of consecutive steps are
    /// sorted by size, split into steps, and these are shuffled.
    #[must_use]
    pub fn bucketed(self, points: Vec<usize>, step: usize) -> Self {
        let buckets = Buckets { points, step, current: None, windows: Vec::new() };
        Self { buckets: Some(buckets), ..self }
    }

    /// The window at a position in the sequence, counted through all passes.
    pub fn window(&mut self, place: u64) -> usize {
        let Some(mut buckets) = self.buckets.take() else { return self.shuffled(place) };
        let count = (BUCKET_STEPS * buckets.step) as u64;
        let number = place / count;
        if buckets.current != Some(number) {
            let windows = (number * count..(number + 1) * count).map(|place| self.shuffled(place));
            let mut windows: Vec<usize> = windows.collect();
            windows.sort_by_key(|&window| buckets.points[window]);
            let mut steps: Vec<&[usize]> = windows.chunks(buckets.step).collect();
            // One bit away from the seeds of the passes and of the noise.
            let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 1 << 63);
            rng.set_stream(number);
            steps.shuffle(&mut rng);
            buckets.windows = steps.concat();
            buckets.current = Some(number);
        }
        let window = buckets.windows[(place % count) as usize];
        self.buckets = Some(buckets);
        window
    }

    fn shuffled(&mut self, place: u64) -> usize {
        let windows = self.windows.len() as u64;
        let pass = place / windows;
        if pass != self.pass {
            self.shuffle(pass);
        }
        self.windows[(place % windows) as usize]
    }

    fn shuffle(&mut self, pass: u64) {
        self.pass = pass;
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(pass);
        // Sorted first, so that a pass does not depend on how it was reached.
        self.windows.sort_unstable();
        self.windows.shuffle(&mut rng);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pass_has_every_window_once_and_can_be_entered_anywhere() {
        let mut sampler = Sampler::new(7, 50);
        let all: Vec<usize> = (0..150).map(|place| sampler.window(place)).collect();
        for pass in all.chunks(50) {
            let mut sorted = pass.to_vec();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..50).collect::<Vec<_>>());
        }
        assert_ne!(all[..50], all[50..100]);
        let mut later = Sampler::new(7, 50);
        assert!((70..150).all(|place| later.window(place) == all[place as usize]));
        assert!((0..50).any(|place| Sampler::new(8, 50).window(place) != all[place as usize]));
    }

    /// Windows bucketed by size: none is lost, those of a step differ little, steps of all sizes
    /// are mixed, and sampling can start at any step.
    #[test]
    fn windows_of_a_step_have_similar_sizes() {
        const STEP: usize = 4;
        let points: Vec<usize> = (0..500).map(|window| 100 + window * 37 % 500).collect();
        let sampler = || Sampler::new(7, 500).bucketed(points.clone(), STEP);
        let mut bucketed = sampler();
        // A whole number both of passes and of buckets.
        let all: Vec<usize> = (0..8000).map(|place| bucketed.window(place)).collect();
        let mut times = vec![0; 500];
        all.iter().for_each(|&window| times[window] += 1);
        assert!(times.iter().all(|&times| times == 16));

        let spread = |windows: &[usize]| {
            let sizes = windows.iter().map(|&window| points[window]);
            sizes.clone().max().unwrap() - sizes.min().unwrap()
        };
        let mean = |spreads: Vec<usize>| spreads.iter().sum::<usize>() / spreads.len();
        let mut plain = Sampler::new(7, 500);
        let random: Vec<usize> = (0..8000).map(|place| plain.window(place)).collect();
        let [bucketed_spread, random_spread] =
            [&all, &random].map(|all| mean(all.chunks(STEP).map(spread).collect()));
        // Of 64 windows between 100 and 600 points, four that follow one another: 3 / 65 of 500.
        assert!(bucketed_spread < 30 && random_spread > 250, "{bucketed_spread} {random_spread}");
        let rising = all.chunks(STEP).zip(all[STEP..].chunks(STEP));
        let rising = rising.filter(|(a, b)| points[a[0]] < points[b[0]]).count();
        assert!((900..1100).contains(&rising), "{rising} of 1999");

        let mut later = sampler();
        assert!((777..900).all(|place| later.window(place) == all[place as usize]));
    }
}
