//! Disc-steps per second of a whole scene of discs on the CPU, on one thread and on all.

use std::time::Instant;

use dem::Grains;
use dem::assembly::{Assembly, Boundary, ColumnBox, Faces, Floor};
use miette::IntoDiagnostic;

use super::extent::Extent;
use super::markdown::table;
use crate::packings;

const GRAVITY: [f64; 2] = [0.0, -9.81];
/// Side of the column (m): some 18 000 discs, and some 1600 which take seconds to prepare.
const LARGE: f64 = 1.0;
const SMALL: f64 = 0.3;
/// When the collapse is measured, in times of a free fall from the top of the column.
const COLLAPSE: f64 = 0.7;
/// DEM steps between two looks at the clock.
const STEPS: usize = 50;

/// A table of a column at rest and in collapse.
///
/// # Errors
/// If the column cannot be prepared or a step fails.
pub fn report(extent: Extent) -> miette::Result<String> {
    let side = if extent.full { LARGE } else { SMALL };
    let grains = Grains::default();
    let boundary = Boundary {
        corner: [0.0; 2],
        size: [4.0 * side, 2.0 * side],
        walls: Faces::default(),
        floor: Floor::Rough,
        boxes: Vec::new(),
        seed: 7,
    };
    let place = ColumnBox { corner: [0.0; 2], size: [side; 2], loaded: true };
    let packed = packings::column::<f32>(&grains, &boundary, GRAVITY, &place, 1, None);
    let packed = packed.into_diagnostic()?;
    let dt = grains.step();
    let gate = Boundary { size: [side, 2.0 * side], ..boundary.clone() };
    let rest = Assembly::<f32>::new(&grains, &gate, GRAVITY, dt, &packed).into_diagnostic()?;
    let mut collapse =
        Assembly::<f32>::new(&grains, &boundary, GRAVITY, dt, &packed).into_diagnostic()?;
    let fall = COLLAPSE * (2.0 * side / -GRAVITY[1]).sqrt();
    collapse.advance((fall / dt) as usize).into_diagnostic()?;

    let mut threads = vec![1, rayon::current_num_threads()];
    threads.dedup();
    let mut rows = Vec::new();
    for (state, start) in [("at rest", rest), ("collapse", collapse)] {
        for &threads in &threads {
            let (steps, seconds, searches) = measure(start.clone(), threads, extent)?;
            rows.push(vec![
                state.to_owned(),
                start.len().to_string(),
                threads.to_string(),
                format!("{:.1}", 1e-6 * (start.len() * steps) as f64 / seconds),
                format!("{:.2}", 1e3 * searches as f64 / steps as f64),
            ]);
        }
    }
    let head = ["column", "discs", "threads", "1e6 disc-steps/s", "sorts in 1000 steps"];
    Ok(table(&head, &rows))
}

/// Steps made, the time they took (s), and how often discs were sorted.
fn measure(
    mut scene: Assembly<f32>,
    threads: usize,
    extent: Extent,
) -> miette::Result<(usize, f64, u64)> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().into_diagnostic()?;
    pool.install(|| {
        // The first steps list neighbours and touch memory.
        scene.advance(STEPS).into_diagnostic()?;
        let (before, start, mut steps) = (scene.searches(), Instant::now(), 0);
        while start.elapsed() < extent.time {
            scene.advance(STEPS).into_diagnostic()?;
            steps += STEPS;
        }
        Ok((steps, start.elapsed().as_secs_f64(), scene.searches() - before))
    })
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_column_is_measured_at_rest_and_in_collapse() {
        let text = report(Extent { full: false, time: Duration::from_millis(20) }).unwrap();
        let rows: Vec<&str> = text.lines().skip(2).collect();
        assert!(rows.len() == 2 || rows.len() == 4, "{text}");
        assert!(rows[0].contains("at rest") && text.contains("collapse"), "{text}");
    }
}
