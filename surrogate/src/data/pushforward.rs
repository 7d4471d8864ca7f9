//! Pushforward (Brandstetter, Worrall, Welling, ICLR 2022): windows that the network itself has
//! unrolled, so that it learns to correct its own errors.

use super::Example;

/// Examples of one training step, mirrored and with noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Examples {
    /// Windows with the frame that follows.
    pub windows: Vec<Example>,
    /// Steps that the network makes by itself before it learns.
    pub unroll: usize,
    /// Positions (m) in the frames after each window, without noise.
    pub future: Vec<Vec<f64>>,
}

/// What it takes to unroll windows on a GPU. Frames are positions (m) of all windows side by side.
#[derive(Clone, Debug)]
pub struct Unrolling {
    /// Steps that the network makes by itself, at least one.
    pub steps: usize,
    /// The last two frames of the windows.
    pub last_two: [Vec<f64>; 2],
    /// The true frames before and after the step to learn.
    pub truth: [Vec<f64>; 2],
    /// Mean of the accelerations of each window, m/frame².
    pub mean: Vec<[f64; 2]>,
    /// Standard deviation of the accelerations, m/frame².
    pub std: [f64; 2],
}

impl Examples {
    /// Unrolls every window by `unroll` frames with the accelerations of `predict` (m/frame², of the
    /// points of all windows), through which no gradient flows. As with noise, the velocity after
    /// the step to learn is the true one, so the target undoes the error of the velocity.
    ///
    /// # Errors
    /// Those of `predict`.
    pub fn push_forward<E>(
        mut self,
        mut predict: impl FnMut(&Self) -> Result<Vec<f64>, E>,
    ) -> Result<Self, E> {
        for _ in 0..self.unroll {
            let accelerations = predict(&self)?;
            let mut rest = accelerations.as_slice();
            for example in &mut self.windows {
                let (mine, others) = rest.split_at(example.values());
                example.advance(mine);
                rest = others;
            }
        }
        for (example, future) in self.windows.iter_mut().zip(&self.future) {
            let values = example.values();
            if self.unroll > 0 {
                let [before, after] = truth(future, self.unroll, values);
                let now = &example.positions[example.positions.len() - values..];
                example.next = (0..values).map(|i| now[i] + (after[i] - before[i])).collect();
            }
        }
        self.unroll = 0;
        Ok(self)
    }

    /// The true frames before and after the step to learn.
    pub(super) fn truth(&self) -> [Vec<f64>; 2] {
        let mut both = [Vec::new(), Vec::new()];
        for (example, future) in self.windows.iter().zip(&self.future) {
            let frames = truth(future, self.unroll, example.values());
            both.iter_mut().zip(frames).for_each(|(all, frame)| all.extend(frame));
        }
        both
    }

    /// The last two frames of all windows.
    pub(super) fn last_two(&self) -> [Vec<f64>; 2] {
        let mut both = [Vec::new(), Vec::new()];
        for example in &self.windows {
            let (before, last) = example.last_two();
            both[0].extend(before);
            both[1].extend(last);
        }
        both
    }
}

/// The frames before and after the step that follows `unroll` others, at least one.
fn truth(future: &[f64], unroll: usize, values: usize) -> [&[f64]; 2] {
    [unroll - 1, unroll].map(|k| &future[k * values..][..values])
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use super::*;

    /// A point that falls: x = 1, 1 - 1/2, 1 - 3/2, ...
    fn examples(unroll: usize) -> Examples {
        let fall = |k: i32| [0.25 * f64::from(k), 1.0 - 0.5 * f64::from(k * (k + 1) / 2)];
        let mut example = Example {
            points: 1,
            positions: (0..5).flat_map(fall).collect(),
            next: fall(5).to_vec(),
            gravity: [0.0, -0.5],
            statics: Vec::new(),
            obstacles: Vec::new(),
        };
        let future = example.shorten(2);
        assert_eq!(example.next, fall(2));
        Examples { windows: vec![example], unroll, future: vec![future] }
    }

    fn push_forward(unroll: usize, mut predict: impl FnMut(&Example) -> Vec<f64>) -> Examples {
        let predict =
            |examples: &Examples| Ok(examples.windows.iter().flat_map(&mut predict).collect());
        examples(unroll).push_forward::<Infallible>(predict).unwrap()
    }

    #[test]
    fn a_perfect_network_stays_on_the_true_path() {
        for unroll in 0..4 {
            let pushed = push_forward(unroll, |example| example.gravity.to_vec());
            assert_eq!(pushed.unroll, 0);
            let example = &pushed.windows[0];
            assert_eq!(example.positions[2], 0.25 * (unroll + 1) as f64);
            assert_eq!(example.acceleration(), [0.0, -0.5]);
        }
    }

    #[test]
    fn the_target_undoes_the_error_of_the_velocity() {
        let mut calls = 0;
        let pushed = push_forward(2, |_| {
            calls += 1;
            vec![0.0; 2]
        });
        assert_eq!(calls, 2);
        // Two steps without gravity, then three of gravity at once.
        assert_eq!(pushed.windows[0].acceleration(), [0.0, -1.5]);
    }
}
