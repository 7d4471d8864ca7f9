//! Signs that a computed state is no state of the material.
//!
//! They need what a trajectory holds, so that a run judges itself at every frame and a data set judges its
//! files by the same rules.

use std::cmp::Reverse;
use std::fmt::{self, Display, Formatter};

/// Mechanical energy may grow by this part of that at the start: the ground stores less under its own
/// weight.
const ENERGY_GAIN: f64 = 0.05;

/// The energy budget of discs may drift by this part of what was dissipated.
const DRIFT: f64 = 0.01;
/// This part of the kinetic energy counts as if dissipated: rounding of f32 velocities takes 0.05 % of it in free flight, where nothing
/// is dissipated.
const FLIGHT: f64 = 0.1;

/// So many times the points of a filled cell of the grid are material pressed into itself. Single cells under the
/// thin front of a collapse reach 4 with a relaxation of 10 1/s, and 2 with 500 1/s.
const CROWDED: f64 = 5.0;

/// More than this part of all points moved back in every step are held by walls. Single ones slide along
/// boxes.
const HELD: f64 = 0.05;

/// A continuum compressed to this part of its volume is beyond its law; grains at a solid fraction of 0.82
/// would fill all space at 0.82 of it.
const COMPRESSED: f64 = 0.5;

/// One sign, with the place and the likely cause.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unsound {
    /// Kinetic and potential energy, less the work of plates, grew by this part of that at the start.
    Energy {
        /// Part of the energy at the start.
        gain: f64,
    },
    /// The energy budget of discs does not close.
    Drift {
        /// Part of what was dissipated.
        part: f64,
    },
    /// A cell of the grid holds too many points.
    Crowded {
        /// Its centre (m).
        at: [f64; 2],
        /// Points in it over those of a filled cell.
        density: f64,
    },
    /// Points leave through walls or boxes and are moved back in every step.
    HeldAtWalls {
        /// How many are moved back in a step, on average since the last frame.
        points: f64,
    },
}

impl Display for Unsound {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Energy { gain } => write!(
                f,
                "the mechanical energy is {:.0} % above its initial value: a shorter `step` or a more \
                 dissipative transfer may be needed",
                100.0 * gain
            ),
            Self::Drift { part } => write!(
                f,
                "the energy of the grains is off by {:.1} % of what was dissipated: a smaller `step_factor` \
                 may be needed",
                100.0 * part
            ),
            Self::Crowded { at: [x, y], density } => write!(
                f,
                "a cell at ({x:.2}, {y:.2}) m holds {density:.1} times the material that fits into it: \
                 an impact or a box presses points together"
            ),
            Self::HeldAtWalls { points } => write!(
                f,
                "walls and boxes move {points:.0} points back in every step: the material is too soft for \
                 this load, or `relaxation` too small to calm its points"
            ),
        }
    }
}

/// Whether the energy grew: `start` and `now` are kinetic plus potential energy less the work of plates
/// (J/m), `stored` is the elastic energy that the material started with (J/m).
pub fn energy(start: f64, now: f64, stored: f64) -> Option<Unsound> {
    let gain = now - start;
    let allowed = ENERGY_GAIN * start.abs() + stored;
    // Where nothing moves and nothing could, there is only round-off.
    (start != 0.0 && gain > allowed).then(|| Unsound::Energy { gain: gain / start.abs() })
}

/// Whether the energy budget of discs drifts from what they dissipated, in a scene with this kinetic energy now
/// and this energy at the start (J/m).
pub fn drift(drift: f64, dissipated: f64, kinetic: f64, start: f64) -> Option<Unsound> {
    // Before anything is dissipated there is only round-off.
    let scale = dissipated + FLIGHT * kinetic + DRIFT * start.abs();
    (drift.abs() > DRIFT * scale).then(|| Unsound::Drift { part: drift.abs() / scale })
}

/// Upper bound (J/m) on the elastic energy of points with these volumes (m²) and squared norms of stress
/// (Pa²), in a material whose waves have the modulus `modulus` (Pa).
pub fn stored_energy(points: impl Iterator<Item = (f64, f64)>, modulus: f64) -> f64 {
    points.map(|(volume, stress)| volume * stress / modulus).sum()
}

/// Whether material is pressed into itself: cells of size `cell` (m), `full` points in a filled one.
pub fn crowding(position: &[[f64; 2]], cell: f64, full: usize) -> Option<Unsound> {
    // Points are inside of the domain: the casts cannot overflow. Sorted, not hashed: on a GPU this
    // is part of the time between two frames.
    let mut cells: Vec<[u32; 2]> = position.iter().map(|x| x.map(|x| (x / cell) as u32)).collect();
    cells.sort_unstable();
    let in_cells = cells.chunk_by(|a, b| a == b);
    let crowded = in_cells.max_by_key(|points| (points.len(), Reverse(points[0])))?;
    let density = crowded.len() as f64 / full as f64;
    let at = crowded[0].map(|i| (f64::from(i) + 0.5) * cell);
    // One point more than fits is no density where cells hold one or two.
    (density > CROWDED && crowded.len() > full + 2).then_some(Unsound::Crowded { at, density })
}

/// Whether walls and boxes hold many of `all` points by force: projections since the start of the run up to
/// two frames that are `steps` apart.
pub fn held_at_walls(before: f64, now: f64, steps: usize, all: usize) -> Option<Unsound> {
    let points = (now - before) / steps as f64;
    (points > HELD * all as f64).then_some(Unsound::HeldAtWalls { points })
}

/// The point of a continuum that is compressed beyond what its law describes, with the part of its volume
/// that is left.
pub fn compression(volume: &[f64], start: f64) -> Option<(usize, f64)> {
    let (point, least) =
        volume.iter().copied().enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b))?;
    (least < COMPRESSED * start).then_some((point, least / start))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_may_come_from_what_was_stored_but_not_from_nowhere() {
        assert_eq!(energy(100.0, 104.0, 0.0), None);
        assert_eq!(energy(100.0, 108.0, 4.0), None);
        assert_eq!(energy(100.0, 110.0, 4.0), Some(Unsound::Energy { gain: 0.1 }));
        // Potential energy may be negative, and there may be none at all.
        assert_eq!(energy(-100.0, -50.0, 0.0), Some(Unsound::Energy { gain: 0.5 }));
        assert_eq!(energy(0.0, 1.0, 0.0), None);
    }

    #[test]
    fn a_budget_may_drift_by_a_hundredth_of_the_losses() {
        assert_eq!(drift(0.9, 100.0, 0.0, 0.0), None);
        assert_eq!(drift(0.9, 0.0, 0.0, 1.0e4), None);
        assert_eq!(
            drift(-55.0, 0.0, 107.0e3, 219.0e3),
            None,
            "a column of 2 m after 0.5 s in the air"
        );
        assert_eq!(drift(-2.0, 100.0, 0.0, 0.0), Some(Unsound::Drift { part: 0.02 }));
    }

    /// A block of 2 m² under 10 kPa from all sides stores at most p² V / M.
    #[test]
    fn stored_energy_of_a_pressed_block() {
        let pressure: f64 = 1.0e4;
        let stored = stored_energy([(0.5, 2.0 * pressure.powi(2)); 4].into_iter(), 1.0e7);
        assert_eq!(stored, 2.0 * 2.0 * 1.0e8 / 1.0e7);
    }

    #[test]
    fn a_crowded_cell_is_found_where_it_is() {
        let block = |n: usize, spacing: f64| {
            (0..n * n).map(move |k| [k % n, k / n].map(|i| 1.0 + (i as f64 + 0.5) * spacing))
        };
        let filled: Vec<_> = block(8, 0.05).collect();
        assert_eq!(crowding(&filled, 0.1, 4), None);
        let pressed: Vec<_> = block(8, 0.05).chain(block(5, 0.015)).collect();
        let found = crowding(&pressed, 0.1, 4);
        let Some(Unsound::Crowded { at, density }) = found else { panic!("{found:?}") };
        assert!((at[0] - 1.05).abs() < 1e-9 && (at[1] - 1.05).abs() < 1e-9, "{at:?}");
        assert_eq!(density, 29.0 / 4.0);
        assert_eq!(crowding(&[], 0.1, 4), None);
        // Three points that meet where one fits are chance.
        assert_eq!(crowding(&[[0.5, 0.5]; 3], 1.0, 1), None);
    }

    #[test]
    fn points_that_are_moved_back_in_every_step_are_held() {
        assert_eq!(held_at_walls(5.0, 305.0, 100, 64), None);
        let held = held_at_walls(5.0, 1005.0, 100, 64).unwrap();
        assert_eq!(held, Unsound::HeldAtWalls { points: 10.0 });
        assert!(held.to_string().starts_with("walls and boxes move 10 points back"), "{held}");
    }

    #[test]
    fn a_continuum_has_a_least_volume() {
        assert_eq!(compression(&[1.0, 0.6, 2.0], 1.0), None);
        assert_eq!(compression(&[1.0, 0.8, 0.4, 2.0], 2.0), Some((2, 0.2)));
    }
}
