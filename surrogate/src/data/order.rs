//! The order in which windows are learnt.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

/// A new random order of all windows for every pass, fixed by the seed.
pub struct Order {
    seed: u64,
    pass: u64,
    windows: Vec<usize>,
}

impl Order {
    /// An order of `windows` windows, at least one.
    pub fn new(seed: u64, windows: usize) -> Self {
        let mut order = Self { seed, pass: 0, windows: (0..windows).collect() };
        order.shuffle(0);
        order
    }

    /// The window at a place, counted through all passes.
    pub fn window(&mut self, place: u64) -> usize {
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
}
