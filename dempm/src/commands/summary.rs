//! The summary of a finished run.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use crate::fronts::mass_front;
use crate::simulation::{Model, Simulation};

/// A finished run in numbers, in SI units.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Summary {
    /// Title of the scene.
    title: String,
    /// Edge of the foremost point (m).
    front: f64,
    /// Edge of the point with 99 % of the mass at or behind it (m).
    mass_front: f64,
    /// The foremost x that a layer connects to the pile (m).
    connected_front: Option<f64>,
    /// Edge of the highest point (m).
    height: f64,
    /// (L - L0) / L0 of a single column.
    runout: Option<f64>,
    /// H / H0 of a single column.
    height_ratio: Option<f64>,
    /// Macro step (s).
    step: f64,
    /// Smallest stable macro step of any frame (s).
    stable_step: Option<f64>,
    /// From when on the frames repeat a state at rest (s).
    rest_time: Option<f64>,
    /// Wall time of each phase (s).
    wall_time: BTreeMap<String, f64>,
    /// Packings of the points.
    packings: Option<Packings>,
    /// Discs of the whole scene.
    discs: Option<Discs>,
}

/// The packings of a run.
#[derive(Clone, Debug, Serialize)]
struct Packings {
    /// DEM steps times discs.
    disc_steps: f64,
    disc_steps_per_second: f64,
    /// Neighbour searches in an RVE step.
    searches: f64,
    /// Share of RVE steps without stress.
    stress_free: f64,
    /// Smallest width of a cell (m).
    thinnest_cell: f64,
    /// RVE steps in which a cell was too thin to follow.
    thin_steps: u64,
    /// RVE steps in which a cell was too dense to follow.
    dense_steps: u64,
    /// Largest overlap over the smaller radius.
    largest_overlap: f64,
    /// RVE steps with an overlap above the limit of warnings.
    overlap_steps: u64,
    /// That limit.
    overlap_warning: f64,
}

/// The discs of a run grain by grain.
#[derive(Clone, Debug, Serialize)]
struct Discs {
    /// Their number.
    count: usize,
    /// DEM steps of single discs that were computed, and all of them.
    disc_steps: f64,
    all_disc_steps: f64,
    disc_steps_per_second: f64,
    /// Largest displacement of a disc that was computed though it would have slept (m).
    sleep_audit: f64,
    /// Neighbour searches in a DEM step.
    searches: f64,
    /// Largest overlap over the smaller radius.
    largest_overlap: f64,
}

impl Summary {
    /// Of a run whose smallest stable macro step in any frame is `stable_step` (s).
    pub(super) fn of(simulation: &Simulation, stable_step: f64) -> Self {
        let scene = &simulation.scene;
        let points = &simulation.points;
        let most = |axis: usize| points.position.iter().map(|x| x[axis]).fold(f64::MIN, f64::max);
        // Points are centres of squares one spacing wide, which end at the walls.
        let half = 0.5 * scene.domain.spacing();
        let [width, height] = scene.domain.size;
        let (front, top) = ((most(0) + half).min(width), (most(1) + half).min(height));
        let position: Vec<[f64; 2]> = points.position.iter().map(|&x| x.into()).collect();
        let column = match scene.columns.as_slice() {
            [column] => Some(column.place),
            _ => None,
        };
        Self {
            title: scene.title.clone(),
            front,
            mass_front: (mass_front(&position, &points.mass) + half).min(width),
            connected_front: simulation.connected_front(),
            height: top,
            runout: column.map(|place| (front - place.corner[0] - place.size[0]) / place.size[0]),
            height_ratio: column.map(|place| (top - place.corner[1]) / place.size[1]),
            step: scene.step,
            stable_step: stable_step.is_finite().then_some(stable_step),
            rest_time: simulation.rest_time(),
            wall_time: simulation.wall_time.clone(),
            packings: packings(simulation),
            discs: discs(simulation),
        }
    }
}

fn packings(simulation: &Simulation) -> Option<Packings> {
    let rve = simulation.packings()?;
    let (tally, p) = (&rve.tally, rve.parameters());
    let substeps = p.grains.substeps(simulation.scene.step) as f64;
    let disc_steps = (tally.steps - tally.free_steps) as f64 * p.discs as f64 * substeps;
    let share = |count: u64| count as f64 / tally.steps.max(1) as f64;
    Some(Packings {
        disc_steps,
        disc_steps_per_second: disc_steps / wall_time(simulation, &["rve"]),
        searches: share(tally.searches),
        stress_free: share(tally.free_steps),
        thinnest_cell: tally.min_width,
        thin_steps: tally.thin_steps,
        dense_steps: tally.dense_steps,
        largest_overlap: tally.max_overlap,
        overlap_steps: tally.overlap_steps,
        overlap_warning: p.grains.overlap_warning,
    })
}

fn discs(simulation: &Simulation) -> Option<Discs> {
    let Model::Discs(discs) = &simulation.model else { return None };
    let steps = (simulation.computed_steps() * discs.substeps()) as f64;
    let disc_steps = discs.disc_steps();
    Some(Discs {
        count: discs.discs(),
        disc_steps,
        all_disc_steps: (simulation.step * discs.substeps() * discs.discs()) as f64,
        sleep_audit: discs.audit(),
        // On a GPU, means are evaluated while it computes the next frame.
        disc_steps_per_second: disc_steps / wall_time(simulation, &["dem", "means"]),
        searches: discs.searches() as f64 / steps.max(1.0),
        largest_overlap: discs.max_overlap(),
    })
}

/// Of some phases together (s).
fn wall_time(simulation: &Simulation, phases: &[&str]) -> f64 {
    phases.iter().filter_map(|phase| simulation.wall_time.get(*phase)).sum()
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.title)?;
        let mut line = |label: &str, value: String| writeln!(f, "  {label:<22}{value}");
        line("front", format!("{:.3} m", self.front))?;
        line("front of 99 %", format!("{:.3} m", self.mass_front))?;
        if let Some(front) = self.connected_front {
            line("front of the pile", format!("{front:.3} m"))?;
        }
        line("final height", format!("{:.3} m", self.height))?;
        if let (Some(runout), Some(height)) = (self.runout, self.height_ratio) {
            line("runout (L - L0) / L0", format!("{runout:.2}"))?;
            line("height H / H0", format!("{height:.2}"))?;
        }
        if let Some(stable) = self.stable_step {
            let (used, bound) = (100.0 * self.step / stable, 1e6 * stable);
            let text = format!("at least {bound:.0} µs, of which {used:.0} % used");
            line("stable macro step", text)?;
        }
        if let Some(time) = self.rest_time {
            line("at rest", format!("from {time:.3} s on, which later frames repeat"))?;
        }
        let total: f64 = self.wall_time.values().sum();
        let phases: Vec<String> = self
            .wall_time
            .iter()
            .map(|(phase, time)| format!("{phase} {time:.1} s ({:.0} %)", 100.0 * time / total))
            .collect();
        line("wall time", format!("{total:.1} s: {}", phases.join(", ")))?;
        if let Some(p) = &self.packings {
            let Packings { disc_steps, disc_steps_per_second: rate, thin_steps, .. } = p;
            line("disc-steps", format!("{disc_steps:.2e}, {rate:.2e} per second"))?;
            let searches = format!("{:.1} in 100 RVE steps", 100.0 * p.searches);
            line("neighbour searches", searches)?;
            line("stress-free", format!("{:.1} % of RVE steps", 100.0 * p.stress_free))?;
            let width = 1e3 * p.thinnest_cell;
            line("thinnest cell", format!("{width:.1} mm, {thin_steps} RVE steps held"))?;
            if p.dense_steps > 0 {
                line("too dense", format!("{} RVE steps held", p.dense_steps))?;
            }
            let (overlap, steps, limit) = (p.largest_overlap, p.overlap_steps, p.overlap_warning);
            let text = format!("{overlap:.2} of a radius, {steps} RVE steps above {limit}");
            line("largest overlap", text)?;
        }
        if let Some(d) = &self.discs {
            line("discs", d.count.to_string())?;
            let (rate, all) = (d.disc_steps_per_second, d.all_disc_steps);
            let text = format!("{:.2e} of {all:.2e}, {rate:.2e} per second", d.disc_steps);
            line("disc-steps", text)?;
            let text = format!("{:.3} mm at most beside sleeping grains", 1e3 * d.sleep_audit);
            line("sleep audit", text)?;
            let searches = format!("{:.1} in 100 DEM steps", 100.0 * d.searches);
            line("neighbour searches", searches)?;
            line("largest overlap", format!("{:.2} of a radius", d.largest_overlap))?;
        }
        Ok(())
    }
}
