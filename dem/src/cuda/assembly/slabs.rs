//! The division of a domain among ranks. Memory is in the order of columns of tiles, so that a part of it is a
//! vertical slab; all parts have as many discs.

use std::ops::Range;

/// Parts begin at multiples of this many discs.
const ALIGNED: usize = 32;

/// The parts of memory that ranks advance, and the discs around them that they read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Slabs {
    /// Discs on all ranks.
    pub discs: usize,
    /// Number of ranks.
    pub ranks: usize,
    /// Discs before and after its own that a rank receives.
    pub halo: usize,
}

/// Discs that a rank sends to another one and receives from it in every step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Message {
    /// The other rank.
    pub peer: usize,
    /// Own discs in the window of the other rank.
    pub sent: Range<usize>,
    /// Discs of the other rank in the own window.
    pub received: Range<usize>,
}

impl Slabs {
    /// The discs that a rank advances: as many on each rank, fewer on the last ones.
    pub fn own(&self, rank: usize) -> Range<usize> {
        let chunk = self.discs.div_ceil(self.ranks).next_multiple_of(ALIGNED);
        (rank * chunk).min(self.discs)..((rank + 1) * chunk).min(self.discs)
    }

    /// The discs that are up to date on a rank.
    pub fn window(&self, rank: usize) -> Range<usize> {
        let own = self.own(rank);
        if own.is_empty() {
            return own;
        }
        own.start.saturating_sub(self.halo)..(own.end + self.halo).min(self.discs)
    }

    /// What a rank exchanges with each other one in every step.
    pub fn messages(&self, rank: usize) -> Vec<Message> {
        let message = |peer: usize| Message {
            peer,
            sent: common(&self.own(rank), &self.window(peer)),
            received: common(&self.own(peer), &self.window(rank)),
        };
        (0..self.ranks).filter(|&peer| peer != rank).map(message).collect()
    }

    /// The own discs of a rank that no other one receives.
    pub fn inner(&self, rank: usize) -> Range<usize> {
        let own = self.own(rank);
        let sent = self.messages(rank).into_iter().filter(|message| !message.sent.is_empty());
        let (before, after): (Vec<_>, Vec<_>) = sent.partition(|message| message.peer < rank);
        let start = before.iter().map(|message| message.sent.end).max().unwrap_or(own.start);
        let end = after.iter().map(|message| message.sent.start).min().unwrap_or(own.end);
        let start = start.next_multiple_of(ALIGNED);
        let end = if end == own.end { end } else { end / ALIGNED * ALIGNED };
        if start < end { start..end } else { own.end..own.end }
    }

    /// The smallest halo whose windows hold all discs up to `margin` columns of tiles around those of the own
    /// discs. Column `c` has the discs from `columns[c]` to before `columns[c + 1]`.
    pub fn needed_halo(&self, columns: &[usize], margin: usize) -> usize {
        let column_of = |disc: usize| columns.partition_point(|&first| first <= disc) - 1;
        let last = columns.len() - 1;
        let needed = (0..self.ranks).map(|rank| self.own(rank)).filter(|own| !own.is_empty());
        let needed = needed.map(|own| {
            let before = columns[column_of(own.start).saturating_sub(margin)];
            let after = columns[(column_of(own.end - 1) + 1 + margin).min(last)];
            (own.start - before).max(after.saturating_sub(own.end))
        });
        needed.max().unwrap_or(0)
    }
}

fn common(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    let start = a.start.max(b.start);
    start..a.end.min(b.end).max(start)
}

/// Largest displacement since the sort, in bins, at which discs that come into each other's reach were at most
/// `margin` columns apart: twice the displacement and a bin are less than `margin` columns of `tile` bins, by
/// one more bin.
pub(super) fn displacement_within(margin: usize, tile: usize) -> usize {
    (margin * tile - 2) / 2
}

/// The least margin for a displacement of this many bins.
pub(super) fn margin_for(displacement: f64, tile: usize) -> usize {
    ((2.0 * displacement + 2.0) / tile as f64).ceil().max(1.0) as usize
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const TILE: usize = 8;

    /// Positions of discs (bins) in the order of columns, and where each column begins.
    fn sorted(discs: usize, columns: usize, rng: &mut ChaCha8Rng) -> (Vec<f64>, Vec<usize>) {
        let length = (columns * TILE) as f64;
        // Discs in a part of the domain only: some columns are empty.
        let [a, b] = [(); 2].map(|()| rng.random_range(0.0..length));
        let mut x: Vec<f64> =
            (0..discs).map(|_| a.min(b) + (a - b).abs() * rng.random_range(0.0..1.0)).collect();
        let column = |x: f64| (x / TILE as f64) as usize;
        x.sort_by_key(|&x| column(x));
        let starts = (0..=columns).map(|c| x.partition_point(|&x| column(x) < c)).collect();
        (x, starts)
    }

    proptest! {
        #[test]
        fn every_disc_is_advanced_by_one_rank(discs in 1_usize..3000, ranks in 1_usize..20) {
            let slabs = Slabs { discs, ranks, halo: 0 };
            let mut next = 0;
            for rank in 0..ranks {
                let own = slabs.own(rank);
                prop_assert!(own.is_empty() || own.start == next && own.start.is_multiple_of(ALIGNED));
                prop_assert!(own.len() <= discs.div_ceil(ranks) + ALIGNED);
                next = next.max(own.end);
            }
            prop_assert_eq!(next, discs);
        }

        #[test]
        fn what_one_rank_sends_another_one_expects(
            discs in 1_usize..3000, ranks in 1_usize..20, halo in 0_usize..4000,
        ) {
            let slabs = Slabs { discs, ranks, halo };
            for rank in 0..ranks {
                for message in slabs.messages(rank) {
                    let back = slabs.messages(message.peer);
                    let back = back.iter().find(|back| back.peer == rank).unwrap();
                    prop_assert_eq!(&message.sent, &back.received);
                    prop_assert_eq!(&message.received, &back.sent);
                }
            }
        }

        #[test]
        fn nobody_receives_inner_discs(
            discs in 1_usize..3000, ranks in 1_usize..20, halo in 0_usize..4000,
        ) {
            let slabs = Slabs { discs, ranks, halo };
            for rank in 0..ranks {
                let (own, inner) = (slabs.own(rank), slabs.inner(rank));
                prop_assert!(own.start <= inner.start && inner.end <= own.end);
                let messages = slabs.messages(rank);
                prop_assert!(messages.iter().all(|message| common(&inner, &message.sent).is_empty()));
                // All but these and what fills a warp are sent.
                let sent = |disc: usize| messages.iter().any(|message| message.sent.contains(&disc));
                let outer = own.filter(|disc| !inner.contains(disc));
                prop_assert!(outer.filter(|&disc| !sent(disc)).count() < 2 * ALIGNED);
            }
        }

        /// Ranks that each hold all discs, advance their own, and exchange them: their windows are up to date,
        /// however many ranks they reach over.
        #[test]
        fn windows_are_up_to_date_after_every_step(
            discs in 1_usize..1000, ranks in 1_usize..9, halo in 0_usize..1200,
        ) {
            let slabs = Slabs { discs, ranks, halo };
            let mut memory = vec![vec![0; discs]; ranks];
            for step in 1..4 {
                for (rank, discs) in memory.iter_mut().enumerate() {
                    discs[slabs.own(rank)].fill(step);
                }
                let before = memory.clone();
                for (rank, discs) in memory.iter_mut().enumerate() {
                    for Message { peer, received, .. } in slabs.messages(rank) {
                        discs[received.clone()].copy_from_slice(&before[peer][received]);
                    }
                }
                for (rank, discs) in memory.iter().enumerate() {
                    prop_assert!(discs[slabs.window(rank)].iter().all(|&version| version == step));
                }
            }
        }

        /// Discs that come within a bin of an own disc, after all have moved as far as the margin allows, lie in
        /// the window.
        #[test]
        fn windows_hold_all_that_may_come_near(
            seed: u64,
            discs in 1_usize..600,
            columns in 1_usize..40,
            ranks in 1_usize..9,
            margin in 1_usize..4,
            slack in 0_usize..50,
        ) {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let (start, columns) = sorted(discs, columns, &mut rng);
            let mut slabs = Slabs { discs, ranks, halo: 0 };
            slabs.halo = slabs.needed_halo(&columns, margin) + slack;
            let far = displacement_within(margin, TILE) as f64;
            let now: Vec<f64> = start.iter().map(|x| x + rng.random_range(-far..=far)).collect();
            for rank in 0..ranks {
                let window = slabs.window(rank);
                for i in slabs.own(rank) {
                    for j in (0..discs).filter(|&j| (now[i] - now[j]).abs() <= 1.0) {
                        prop_assert!(window.contains(&j), "{rank}: {i} {j}");
                    }
                }
            }
        }

        #[test]
        fn the_margin_for_a_displacement_allows_it(displacement in 0.0_f64..1e4) {
            let margin = margin_for(displacement, TILE);
            prop_assert!(displacement_within(margin, TILE) as f64 >= displacement);
            let less = margin - 1;
            prop_assert!(less == 0 || (displacement_within(less, TILE) as f64) < displacement);
        }
    }
}
