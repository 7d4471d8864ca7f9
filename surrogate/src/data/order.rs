//! The order in which windows are learnt.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// Steps whose windows are dealt out by size together.
const DEALT: usize = 16;

/// A new random order of all windows for every pass, fixed by the seed.
pub struct Order {
    seed: u64,
    pass: u64,
    windows: Vec<usize>,
    dealing: Option<Dealing>,
}

/// Windows of some steps, dealt out by size.
struct Dealing {
    /// Points of each window of the data.
    points: Vec<usize>,
    /// Windows of a step.
    step: usize,
    /// Number of the steps that are dealt out, [`DEALT`] at a time, and their windows.
    now: Option<u64>,
    windows: Vec<usize>,
}

impl Order {
    /// An order of `windows` windows, at least one.
    pub fn new(seed: u64, windows: usize) -> Self {
        let mut order = Self { seed, pass: 0, windows: (0..windows).collect(), dealing: None };
        order.shuffle(0);
        order
    }

    /// Gives the windows of a step, `step` at a time, about as many `points`, which are those of all
    /// windows: the windows of some steps that follow one another are sorted by them, dealt out, and
    /// the steps shuffled.
    #[must_use]
    pub fn alike(self, points: Vec<usize>, step: usize) -> Self {
        let dealing = Dealing { points, step, now: None, windows: Vec::new() };
        Self { dealing: Some(dealing), ..self }
    }

    /// The window at a place, counted through all passes.
    pub fn window(&mut self, place: u64) -> usize {
        let Some(mut dealing) = self.dealing.take() else { return self.shuffled(place) };
        let count = (DEALT * dealing.step) as u64;
        let number = place / count;
        if dealing.now != Some(number) {
            let windows = (number * count..(number + 1) * count).map(|place| self.shuffled(place));
            let mut windows: Vec<usize> = windows.collect();
            windows.sort_by_key(|&window| dealing.points[window]);
            let mut steps: Vec<&[usize]> = windows.chunks(dealing.step).collect();
            // One bit apart from the seeds of passes and of noise.
            let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 1 << 63);
            rng.set_stream(number);
            steps.shuffle(&mut rng);
            dealing.windows = steps.concat();
            dealing.now = Some(number);
        }
        let window = dealing.windows[(place % count) as usize];
        self.dealing = Some(dealing);
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
        // From the start, so that a pass does not depend on how it was reached.
        self.windows.sort_unstable();
        self.windows.shuffle(&mut rng);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pass_has_every_window_once_and_can_be_entered_anywhere() {
        let mut order = Order::new(7, 50);
        let all: Vec<usize> = (0..150).map(|place| order.window(place)).collect();
        for pass in all.chunks(50) {
            let mut sorted = pass.to_vec();
            sorted.sort_unstable();
            assert_eq!(sorted, (0..50).collect::<Vec<_>>());
        }
        assert_ne!(all[..50], all[50..100]);
        let mut later = Order::new(7, 50);
        assert!((70..150).all(|place| later.window(place) == all[place as usize]));
        assert!((0..50).any(|place| Order::new(8, 50).window(place) != all[place as usize]));
    }

    /// Windows dealt out by size: none is lost, those of a step differ little, steps of all sizes
    /// are mixed, and any step can be the first.
    #[test]
    fn windows_of_a_step_are_alike() {
        const STEP: usize = 4;
        let points: Vec<usize> = (0..500).map(|window| 100 + window * 37 % 500).collect();
        let order = || Order::new(7, 500).alike(points.clone(), STEP);
        let mut dealt = order();
        // As many as a whole number both of passes and of dealings.
        let all: Vec<usize> = (0..8000).map(|place| dealt.window(place)).collect();
        let mut times = vec![0; 500];
        all.iter().for_each(|&window| times[window] += 1);
        assert!(times.iter().all(|&times| times == 16));

        let spread = |windows: &[usize]| {
            let sizes = windows.iter().map(|&window| points[window]);
            sizes.clone().max().unwrap() - sizes.min().unwrap()
        };
        let mean = |spreads: Vec<usize>| spreads.iter().sum::<usize>() / spreads.len();
        let mut plain = Order::new(7, 500);
        let random: Vec<usize> = (0..8000).map(|place| plain.window(place)).collect();
        let [dealt_spread, random_spread] =
            [&all, &random].map(|all| mean(all.chunks(STEP).map(spread).collect()));
        // Of 64 windows between 100 and 600 points, four that follow one another: 3 / 65 of 500.
        assert!(dealt_spread < 30 && random_spread > 250, "{dealt_spread} {random_spread}");
        let rising = all.chunks(STEP).zip(all[STEP..].chunks(STEP));
        let rising = rising.filter(|(a, b)| points[a[0]] < points[b[0]]).count();
        assert!((900..1100).contains(&rising), "{rising} of 1999");

        let mut later = order();
        assert!((777..900).all(|place| later.window(place) == all[place as usize]));
    }
}
