//! How an RVE is driven through one stage: what the servo asks for, what is sampled, and when the stage ends.

use nalgebra::Matrix2;

use super::path::{Row, Sampler};
use super::servo::Servo;
use super::stage::{Control, End, Stage};
use crate::parameters::RveParameters;
use crate::state::RveState;

/// Relative stress error and unbalanced force at which a stage without duration ends.
const TOLERANCE: f64 = 1.0e-3;
/// Give up after this many DEM steps in a stage that ends at a state, not at a time.
pub(super) const MAX_STEPS: usize = 20_000_000;

/// A stage under way.
#[derive(Debug)]
pub(crate) struct Drive {
    control: Control,
    end: End,
    macro_step: f64,
    /// Macro steps done, the most of them, and those between two rows.
    done: usize,
    limit: usize,
    per_row: usize,
    servo: Servo,
    sampler: Sampler,
}

/// What a macro step of a stage leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Due {
    /// A row is complete.
    pub row: bool,
    /// The stage is over.
    pub end: bool,
}

impl Drive {
    /// Begins a stage that is driven in macro steps (s), with a row every `sampling` (s) and at the end.
    pub fn new(stage: &Stage, sampling: f64, p: &RveParameters, macro_step: f64) -> Self {
        let end = stage.end();
        Self {
            control: stage.control(),
            limit: match end {
                End::Duration(duration) => (duration / macro_step).round() as usize,
                End::Vertical { .. } | End::Balanced { .. } => {
                    MAX_STEPS / p.grains.substeps(macro_step)
                }
            },
            end,
            macro_step,
            done: 0,
            // Infinite sampling saturates: one row, at the end of the stage.
            per_row: ((sampling / macro_step).round() as usize).max(1),
            servo: Servo::default(),
            sampler: Sampler::default(),
        }
    }

    /// Whether no macro step is left.
    pub fn is_over(&self) -> bool {
        self.done == self.limit
    }

    /// The velocity gradient (1/s) of the next macro step, from the state after the last.
    pub fn velocity_gradient(&mut self, state: &RveState, p: &RveParameters) -> Matrix2<f64> {
        self.servo.velocity_gradient(&self.control, &state.stress, p, self.macro_step)
    }

    /// Counts a macro step under the velocity gradient `l` (1/s) that ended at `state`. `unbalanced` is asked for the
    /// mean resultant force on a disc over the mean normal force where the stage ends in equilibrium.
    pub fn after(
        &mut self,
        state: &RveState,
        l: &Matrix2<f64>,
        unbalanced: impl FnOnce() -> f64,
    ) -> Due {
        self.sampler.add(state, l);
        self.done += 1;
        let last = self.is_over() && matches!(self.end, End::Duration(_));
        let end = last || self.reached(state, unbalanced);
        Due { row: end || self.done.is_multiple_of(self.per_row), end }
    }

    /// The row of the interval that ends at time `t` (s) and `strain`; a new interval begins.
    pub fn row(&mut self, t: f64, strain: Matrix2<f64>, p: &RveParameters) -> Row {
        self.sampler.row(t, strain, p)
    }

    /// The state that a stage of all macro steps has not reached; `None` if it ends at a time.
    pub fn unreached(&self) -> Option<String> {
        match self.end {
            End::Duration(_) => None,
            End::Vertical { pressure, .. } => Some(format!("{pressure} Pa")),
            End::Balanced { pressure } => Some(format!("equilibrium at {pressure} Pa")),
        }
    }

    fn reached(&self, state: &RveState, unbalanced: impl FnOnce() -> f64) -> bool {
        let stress = &state.stress;
        match self.end {
            End::Duration(_) => false,
            End::Vertical { pressure, loading } => (stress[(1, 1)] >= pressure) == loading,
            End::Balanced { pressure } => {
                let near = |s: f64| (s / pressure - 1.0).abs() < TOLERANCE;
                near(stress[(0, 0)]) && near(stress[(1, 1)]) && unbalanced() < TOLERANCE
            }
        }
    }
}
