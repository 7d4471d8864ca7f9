//! The truth: runs of one scene as discs, which differ in their seeds.

use std::collections::BTreeSet;

use super::motion::{Motion, State};
use super::row::Seeds;

/// From when on distances of a column at rest count, s: before, they are too small to divide by.
const SETTLED: f64 = 0.5;
/// Departure from free flight at which material has hit something, m.
const DEPARTURE: f64 = 0.01;
/// What departs earlier than this (s) rests at the start.
const AT_ONCE: f64 = 0.1;

/// The runs of the truth.
#[derive(Clone, Debug)]
pub struct Reference {
    /// One run for each seed.
    pub runs: Vec<Motion>,
    /// From when on distances count, s: 0.5 s for columns at rest, the impact for falling ones.
    pub counted_from: f64,
    /// When the runs come to rest, s; `None` if one of them does not.
    pub arrest: Option<Seeds>,
}

impl Reference {
    /// The truth of some runs.
    ///
    /// # Errors
    /// A sentence, if there are none, or they differ in their material, in their points or not in their
    /// seeds.
    pub fn of(runs: Vec<Motion>) -> Result<Self, String> {
        let first = runs.first().ok_or("there are no runs of the truth")?;
        let squares = first.squares(first.side);
        for other in &runs[1..] {
            if other.side != first.side || other.domain != first.domain {
                return Err(format!("{} and {}: other points or domain", first.name, other.name));
            }
            if !other.squares(other.side).keys().eq(squares.keys()) {
                return Err(format!("{} and {}: not the same material", first.name, other.name));
            }
        }
        let seeds: BTreeSet<u64> = runs.iter().map(|run| run.seed).collect();
        if seeds.len() < runs.len() {
            return Err("two runs of the truth have the same seed".to_owned());
        }
        let counted_from = impact(first).unwrap_or(SETTLED);
        let arrests: Option<Vec<f64>> = runs.iter().map(Motion::arrest).collect();
        let arrest = arrests.and_then(|arrests| Seeds::of(&arrests));
        Ok(Self { counted_from, arrest, runs })
    }

    /// The states of all runs at a time (s); `None` if one lacks it.
    pub(super) fn at(&self, time: f64) -> Option<Vec<&State>> {
        /// Tolerance on equal times, s.
        const ROUNDING: f64 = 1e-6;
        let of_run = |run: &'_ Motion| {
            let place = run.states.partition_point(|state| state.time < time - ROUNDING);
            (run.states.get(place)?.time - time).abs().le(&ROUNDING).then_some(place)
        };
        self.runs.iter().map(|run| Some(&run.states[of_run(run)?])).collect()
    }
}

/// When falling material hits something, s; `None` if it rests at the start.
fn impact(run: &Motion) -> Option<f64> {
    let start = run.states.first()?;
    let departs = |state: &&State| {
        let t = state.time - start.time;
        let away = [0, 1].map(|k| {
            let flight = start.centre[k] + t * (run.start_velocity[k] + 0.5 * t * run.gravity[k]);
            state.centre[k] - flight
        });
        away[0].hypot(away[1]) > DEPARTURE
    };
    let time = run.states.iter().find(departs)?.time;
    (time - start.time > AT_ONCE).then_some(time)
}
