//! The summary of a finished run.

use std::fmt::Write;
use std::path::Path;

use crate::fronts::mass_front;
use crate::simulation::{Model, Simulation};

/// The summary of a finished run into `output`, with the smallest stable macro step of any frame (s).
pub(super) fn summary(simulation: &Simulation, stable_step: f64, output: &Path) -> String {
    let scene = &simulation.scene;
    let points = &simulation.points;
    let mut text = String::new();
    let mut line = |label: &str, value: String| {
        writeln!(text, "  {label:<22}{value}").expect("writing to a string cannot fail");
    };
    let front = points.position.iter().map(|x| x.x).fold(f64::MIN, f64::max);
    let top = points.position.iter().map(|x| x.y).fold(f64::MIN, f64::max);
    let spacing = scene.domain.spacing();
    // Points are centres of squares one spacing wide, which end at the walls.
    let [width, height] = scene.domain.size;
    let (front, top) = ((front + 0.5 * spacing).min(width), (top + 0.5 * spacing).min(height));
    line("front", format!("{front:.3} m"));
    let position: Vec<[f64; 2]> = points.position.iter().map(|&x| x.into()).collect();
    let edge = |front: f64| format!("{:.3} m", (front + 0.5 * spacing).min(width));
    line("front of 99 %", edge(mass_front(&position, &points.mass)));
    if let Some(front) = simulation.connected_front() {
        line("front of the pile", format!("{front:.3} m"));
    }
    line("final height", format!("{top:.3} m"));
    if let [column] = scene.columns.as_slice() {
        let [width, height] = column.place.size;
        let right = column.place.corner[0] + width;
        line("runout (L - L0) / L0", format!("{:.2}", (front - right) / width));
        line("height H / H0", format!("{:.2}", (top - column.place.corner[1]) / height));
    }

    if stable_step.is_finite() {
        let used = 100.0 * scene.step / stable_step;
        let bound = 1e6 * stable_step;
        line("stable macro step", format!("at least {bound:.0} µs, of which {used:.0} % used"));
    }

    let times = &simulation.wall_time;
    let total: f64 = times.values().sum();
    let phases: Vec<String> = times
        .iter()
        .map(|(phase, time)| format!("{phase} {time:.1} s ({:.0} %)", 100.0 * time / total))
        .collect();
    line("wall time", format!("{total:.1} s: {}", phases.join(", ")));

    if let Some(rve) = simulation.packings() {
        let tally = &rve.tally;
        let p = rve.parameters();
        let disc_steps = tally.steps as f64 * p.discs as f64 * p.grains.substeps(scene.step) as f64;
        let rate = disc_steps / times.get("rve").copied().unwrap_or(f64::NAN);
        line("disc-steps", format!("{disc_steps:.2e}, {rate:.2e} per second"));
        let share = |count: u64| 100.0 * count as f64 / tally.steps.max(1) as f64;
        line("neighbour searches", format!("{:.1} in 100 RVE steps", share(tally.searches)));
        line("stress-free", format!("{:.1} % of RVE steps", share(tally.free_steps)));
        line(
            "thinnest cell",
            format!("{:.1} mm, {} RVE steps held", 1e3 * tally.min_width, tally.thin_steps),
        );
        line(
            "largest overlap",
            format!(
                "{:.2} of a radius, {} RVE steps above {}",
                tally.max_overlap, tally.overlap_steps, p.grains.overlap_warning
            ),
        );
    }
    if let Model::Discs(discs) = &simulation.model {
        let steps = (simulation.step * discs.substeps()) as f64;
        let disc_steps = steps * discs.discs() as f64;
        // On a GPU, means are evaluated while it computes the next frame.
        let time: f64 = ["dem", "means"].iter().filter_map(|phase| times.get(*phase)).sum();
        let rate = disc_steps / time;
        line("discs", discs.discs().to_string());
        line("disc-steps", format!("{disc_steps:.2e}, {rate:.2e} per second"));
        let searches = 100.0 * discs.searches() as f64 / steps.max(1.0);
        line("neighbour searches", format!("{searches:.1} in 100 DEM steps"));
        line("largest overlap", format!("{:.2} of a radius", discs.max_overlap()));
    }
    line("written", output.display().to_string());
    format!("{}\n{text}", scene.title)
}
