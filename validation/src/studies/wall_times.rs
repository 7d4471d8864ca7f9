//! Wall times of the solver and the Baseline on the paper's test set.

use dempm::trajectory::Trajectory;

use crate::context::{Context, Start};
use crate::literature::paper::{WALL_TIMES, WallTime};
use crate::models::{Model, baseline};
use crate::wall_time::computing;

/// Our times of a case of the paper.
pub struct CaseTimes {
    /// The paper's row.
    pub paper: &'static WallTime,
    /// Our trajectory; `None` if there is none.
    pub solver: Option<Solver>,
    /// Our rollout; `None` without a model or a trajectory, or if it ended early.
    pub network: Option<Timed>,
}

/// A trajectory of the solver.
pub struct Solver {
    /// Material points.
    pub points: usize,
    /// Steps.
    pub steps: usize,
    /// Its time.
    pub timed: Timed,
}

/// A wall time and where it was measured.
pub struct Timed {
    /// Wall time of the computation, s.
    pub seconds: f64,
    /// Device.
    pub device: String,
}

/// Our times of all cases of the paper, and the network they are of.
pub struct WallTimes {
    /// One entry for each row of [`WALL_TIMES`].
    pub cases: Vec<CaseTimes>,
    /// The Baseline, if there is such a model.
    pub model: Option<Model>,
}

impl CaseTimes {
    /// Whether our case has the paper's points and steps, so that times can be compared.
    pub fn is_comparable(&self) -> bool {
        let same = |s: &Solver| (s.points, s.steps) == (self.paper.points, self.paper.steps);
        self.solver.as_ref().is_some_and(same)
    }
}

impl Timed {
    fn of(trajectory: &Trajectory) -> Self {
        Self { seconds: computing(trajectory), device: trajectory.header().device.clone() }
    }
}

/// Reads the solver's times from the test set and times a rollout of each case.
///
/// # Errors
/// If a file cannot be read or the user interrupts.
pub fn measure(context: &mut Context) -> miette::Result<WallTimes> {
    let trajectories = context.cases("test");
    let model = baseline(&context.models);
    let mut cases = Vec::new();
    for paper in &WALL_TIMES {
        let path = trajectories.iter().find(|(name, _)| name == paper.case).map(|(_, path)| path);
        let trajectory = path.map(|path| Trajectory::open(path)).transpose()?;
        let run = match (&model, path) {
            // On its own: rollouts for accuracy may have been made several at a time.
            (Some(model), Some(path)) => {
                Some(context.rollout_again(model, &Start::Trajectory(path), 1)?)
            }
            _ => None,
        };
        // The time of a rollout that ended early cannot be compared.
        let ended = run.filter(|run| run.succeeded);
        let rollout = ended.map(|run| Trajectory::open(&run.output)).transpose()?;
        let network = rollout.as_ref().map(Timed::of);
        cases.push(CaseTimes { paper, solver: trajectory.as_ref().map(solver), network });
    }
    Ok(WallTimes { cases, model })
}

fn solver(trajectory: &Trajectory) -> Solver {
    let duration = trajectory.time().last().copied().unwrap_or_default();
    Solver {
        points: trajectory.points().mass.len(),
        steps: (duration / trajectory.header().time_step).round() as usize,
        timed: Timed::of(trajectory),
    }
}
