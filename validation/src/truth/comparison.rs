//! A model against the truth, over time.

use std::collections::BTreeMap;

use dempm::comparison::{Square, means};
use serde::{Deserialize, Serialize};

use super::misplaced::{Shares, misplaced};
use super::motion::{Motion, State};
use super::pairs::{mean_over_pairs, mean_square};
use super::reference::Reference;
use super::row::{Row, Seeds};

/// Least side of the squares in which mass is counted, m.
const LEAST_CELL: f64 = 0.0625;

/// A model against the truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Name of the model's run.
    pub name: String,
    /// Side of the compared squares of material, m.
    pub side: f64,
    /// Number of runs of the truth.
    pub seeds: usize,
    /// One row for each common time but the first.
    pub rows: Vec<Row>,
    /// From when on distances count, s.
    pub counted_from: f64,
    /// When the model comes to rest, s; `None` if not until the end.
    pub arrest: Option<f64>,
    /// When the truth does; `None` if one of its runs does not.
    pub true_arrest: Option<Seeds>,
    /// What stopped the model early.
    pub failure: Option<String>,
}

impl Comparison {
    /// The row with the largest ratio of distance to spread of those that count; the last row if the runs
    /// are too short for any. `None` of one seed, and of a model that failed before.
    pub fn worst(&self) -> Option<&Row> {
        let ratio = |row: &&Row| row.ratio();
        let counted = self.rows.iter().filter(|row| row.time >= self.counted_from - 1e-9);
        let worst = counted
            .filter(|row| ratio(row).is_some_and(f64::is_finite))
            .max_by(|a, b| a.ratio().unwrap_or(0.0).total_cmp(&b.ratio().unwrap_or(0.0)));
        let last = self.rows.last().filter(|_| self.failure.is_none());
        worst.or_else(|| last.filter(|row| ratio(row).is_some()))
    }

    /// The last row at or before a time (s).
    pub fn at(&self, time: f64) -> Option<&Row> {
        self.rows.iter().rev().find(|row| row.time <= time + 1e-6)
    }
}

/// Compares a model with the truth at all common times but the first, on the coarser squares of the two.
///
/// # Errors
/// A sentence, if they do not start with the same material in the same domain or have no time in common.
pub fn compare(model: &Motion, truth: &Reference) -> Result<Comparison, String> {
    let first = &truth.runs[0];
    let side = first.side.max(model.side);
    let groups: Vec<_> = truth.runs.iter().map(|run| run.squares(side)).collect();
    let own = model.squares(side);
    if model.domain != first.domain || !own.keys().eq(groups[0].keys()) {
        return Err(format!("{} does not start with the material of {}", model.name, first.name));
    }
    let cell = side.max(LEAST_CELL);
    let look = |run: &Motion, groups: &_, state: &State| Seen::of(run, groups, state, side, cell);
    let mut rows = Vec::new();
    for state in model.states.iter().skip(1) {
        let Some(states) = truth.at(state.time) else { continue };
        let seen: Vec<Seen> = truth
            .runs
            .iter()
            .zip(&groups)
            .zip(&states)
            .map(|((run, groups), state)| look(run, groups, state))
            .collect();
        rows.extend(row(state, &look(model, &own, state), &states, &seen));
    }
    if rows.is_empty() {
        return Err(format!("{} has no time in common with {}", model.name, first.name));
    }
    Ok(Comparison {
        name: model.name.clone(),
        side,
        seeds: truth.runs.len(),
        rows,
        counted_from: truth.counted_from,
        arrest: model.arrest(),
        true_arrest: truth.arrest,
        failure: (model.status != "finished").then(|| model.status.clone()),
    })
}

/// A state on common squares.
struct Seen {
    /// Mean positions of squares of material, m.
    squares: Vec<[f64; 2]>,
    /// Where the mass is.
    shares: Shares,
}

impl Seen {
    fn of(
        run: &Motion,
        groups: &BTreeMap<Square, Vec<usize>>,
        state: &State,
        side: f64,
        cell: f64,
    ) -> Self {
        let squares = means(&state.position, groups.values());
        let mass: Vec<f64> =
            groups.values().map(|group| group.iter().map(|&point| run.mass[point]).sum()).collect();
        let shares = Shares::of(&squares, &mass, side, cell, run.domain);
        Self { squares, shares }
    }
}

/// `None` without runs of the truth.
fn row(state: &State, model: &Seen, truths: &[&State], seen: &[Seen]) -> Option<Row> {
    let count = seen.len() as f64;
    let over_seeds = |of: &dyn Fn(&State) -> f64| {
        Seeds::of(&truths.iter().map(|state| of(state)).collect::<Vec<f64>>())
    };
    let square: f64 = seen.iter().map(|truth| mean_square(&model.squares, &truth.squares)).sum();
    let wrong: f64 = seen.iter().map(|truth| misplaced(&model.shares, &truth.shares)).sum();
    let connected: Option<Vec<f64>> = truths.iter().map(|state| state.connected_front).collect();
    Some(Row {
        time: state.time,
        distance: (square / count).sqrt(),
        spread: mean_over_pairs(seen, |a, b| mean_square(&a.squares, &b.squares)).map(f64::sqrt),
        misplaced: wrong / count,
        misplaced_spread: mean_over_pairs(seen, |a, b| misplaced(&a.shares, &b.shares)),
        front: state.front,
        true_front: over_seeds(&|state| state.front)?,
        connected_front: state.connected_front,
        true_connected_front: connected.and_then(|fronts| Seeds::of(&fronts)),
        centre: state.centre,
        true_centre: [over_seeds(&|s| s.centre[0])?, over_seeds(&|s| s.centre[1])?],
        kinetic_energy: state.kinetic_energy,
        true_kinetic_energy: over_seeds(&|state| state.kinetic_energy)?,
    })
}

#[cfg(test)]
mod tests {
    use dempm::comparison::Start;

    use super::*;

    /// A block of 16 x 8 points of side 0.0625 / `finer` m that has moved by `d` (m) after 1 s.
    fn block(seed: u64, finer: u32, d: [f64; 2]) -> Motion {
        let spacing = 0.0625 / f64::from(finer);
        let [columns, rows] = [16 * finer, 8 * finer];
        let middle = |k: u32| spacing * (f64::from(k) + 0.5);
        let start: Vec<[f64; 2]> =
            (0..columns * rows).map(|k| [middle(k % columns), middle(k / columns)]).collect();
        let state = |time: f64| {
            let position: Vec<[f64; 2]> =
                start.iter().map(|[x, y]| [x + time * d[0], y + time * d[1]]).collect();
            State {
                time,
                position,
                front: 1.0 + time * d[0],
                connected_front: None,
                centre: [0.5 + time * d[0], 0.25 + time * d[1]],
                kinetic_energy: 0.0,
            }
        };
        Motion {
            name: format!("block {seed}"),
            material: "discs".to_owned(),
            seed,
            status: "finished".to_owned(),
            domain: [4.0, 2.0],
            gravity: [0.0, -9.81],
            side: spacing,
            mass: vec![1.0 / f64::from(finer * finer); start.len()],
            starts: start.iter().map(|&place| Start { column: 0, place }).collect(),
            start_velocity: [0.0; 2],
            states: [0.0, 0.5, 1.0].map(state).to_vec(),
        }
    }

    #[test]
    fn a_model_moved_by_d_is_d_away_also_with_finer_points() {
        let truth = Reference::of(vec![block(1, 1, [0.0, 0.0])]).unwrap();
        for finer in [1, 2, 4] {
            let found = compare(&block(9, finer, [0.3, 0.4]), &truth).unwrap();
            let last = found.rows.last().unwrap();
            assert!((last.distance - 0.5).abs() < 1e-12);
            // What has moved by (0.3, 0.4) of (1, 0.5) overlaps by 0.7 x 0.1.
            assert!((last.misplaced - 0.86).abs() < 1e-12, "{}", last.misplaced);
            assert!((last.front - last.true_front.mean - 0.3).abs() < 1e-12);
            assert!((last.centre_distance() - 0.5).abs() < 1e-12);
            assert_eq!((last.spread, last.ratio()), (None, None));
        }
    }

    #[test]
    fn the_spread_is_the_distance_of_two_seeds() {
        // Three seeds at 0, 0.1 and 0.3 m: pairs are 0.1, 0.2 and 0.3 m apart.
        let seeds = [0.0, 0.1, 0.3].map(|d| block((10.0 * d) as u64, 1, [d, 0.0]));
        let truth = Reference::of(seeds.to_vec()).unwrap();
        let found = compare(&block(9, 2, [0.3, 0.0]), &truth).unwrap();
        let last = found.rows.last().unwrap();
        assert!((last.spread.unwrap() - (0.14_f64 / 3.0).sqrt()).abs() < 1e-12);
        // The model is 0.3, 0.2 and 0 m away.
        assert!((last.distance - (0.13_f64 / 3.0).sqrt()).abs() < 1e-12);
        assert!((last.misplaced_spread.unwrap() - 0.2).abs() < 1e-12);
        assert!((last.misplaced - 0.5 / 3.0).abs() < 1e-12);
        let worst = found.worst().unwrap();
        assert!((worst.ratio().unwrap() - (13.0_f64 / 14.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn the_worst_row_is_one_that_counts() {
        let seeds = [0.0, 0.1].map(|d| block((10.0 * d) as u64, 1, [d, 0.0]));
        let mut truth = Reference::of(seeds.to_vec()).unwrap();
        let model = block(9, 1, [0.3, 0.0]);
        let worst = |truth: &Reference, model: &Motion| {
            compare(model, truth).unwrap().worst().map(|row| row.time)
        };
        assert_eq!(worst(&truth, &model), Some(1.0));
        // Of runs that end before, the last row; of a model that failed before, none.
        truth.counted_from = 2.0;
        assert_eq!(worst(&truth, &model), Some(1.0));
        let failed = Motion { status: "failed".to_owned(), ..model };
        assert_eq!(worst(&truth, &failed), None);
    }

    #[test]
    fn coarser_points_are_compared_on_their_squares() {
        let truth = Reference::of(vec![block(1, 2, [0.0, 0.0]), block(2, 2, [0.1, 0.0])]).unwrap();
        let found = compare(&block(9, 1, [0.1, 0.0]), &truth).unwrap();
        assert_eq!(found.side, 0.0625);
        let last = found.rows.last().unwrap();
        assert!((last.spread.unwrap() - 0.1).abs() < 1e-12);
        assert!((last.distance - 0.005_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn other_material_and_equal_seeds_are_refused() {
        let truth = Reference::of(vec![block(1, 1, [0.0, 0.0])]).unwrap();
        let mut other = block(9, 1, [0.0, 0.0]);
        other.starts.truncate(64);
        assert!(compare(&other, &truth).unwrap_err().contains("does not start with the material"));
        let same = vec![block(1, 1, [0.0, 0.0]), block(1, 1, [0.1, 0.0])];
        assert!(Reference::of(same).unwrap_err().contains("the same seed"));
    }

    #[test]
    fn falls_count_from_their_impact_on() {
        let fall = |seed: u64| {
            let mut run = block(seed, 1, [0.0, 0.0]);
            run.states = (0..=20)
                .map(|k| {
                    let time = 0.05 * f64::from(k);
                    // It falls for 0.6 s.
                    let flight = time.min(0.6);
                    let y = 3.0 - 0.5 * 9.81 * flight * flight;
                    State { time, centre: [0.5, y], ..run.states[0].clone() }
                })
                .collect();
            run
        };
        let truth = Reference::of(vec![fall(1)]).unwrap();
        assert!((truth.counted_from - 0.65).abs() < 1e-9);
        assert_eq!(Reference::of(vec![block(1, 1, [0.0, 0.0])]).unwrap().counted_from, 0.5);
    }
}
