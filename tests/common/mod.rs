//! What tests of `dempm run` share.

mod program;

use std::path::Path;
use std::process::{Child, Command};
use std::thread::sleep;
use std::time::{Duration, Instant};

use dempm::trajectory::Trajectory;

use program::program;

/// The program in a directory, with a cache of its own there.
pub fn dempm(directory: &Path) -> Command {
    program("dempm", directory)
}

/// Every number of every frame, as bits.
pub fn bits(path: &Path) -> Vec<u64> {
    let trajectory = Trajectory::open(path).unwrap();
    let mut bits = Vec::new();
    for index in 0..trajectory.frames() {
        let frame = trajectory.frame(index).unwrap();
        let vectors = frame.position.iter().chain(&frame.velocity).flatten();
        let doubles = vectors.chain(frame.budget.values()).chain([&frame.time]);
        bits.extend(doubles.map(|x| x.to_bits()));
        let stress = frame.stress.expect("the scene asks for stress");
        let scalars = [frame.solid_fraction, frame.coordination, frame.inertial_number];
        let singles = stress.iter().flatten().chain(scalars.iter().flatten().flatten());
        bits.extend(singles.map(|x| u64::from(x.to_bits())));
        if let Some(grid) = trajectory.grid_frame(index).unwrap() {
            let tensors = grid.velocity.iter().flatten().chain(grid.stress.iter().flatten());
            bits.extend(tensors.chain(&grid.density).map(|x| u64::from(x.to_bits())));
        }
        if let Some(grains) = trajectory.grain_frame(index).unwrap() {
            let vectors = grains.position.iter().chain(&grains.velocity).flatten();
            bits.extend(vectors.chain(&grains.pressure).map(|x| u64::from(x.to_bits())));
        }
    }
    bits
}

/// Waits until the file of a run holds so many frames. True if the run has ended before.
///
/// # Panics
/// After a minute, or if the run ends with an error.
pub fn wait_for_frames(run: &mut Child, path: &Path, frames: usize) -> bool {
    let start = Instant::now();
    loop {
        if let Some(status) = run.try_wait().unwrap() {
            assert!(status.success(), "{status}");
            return true;
        }
        if Trajectory::open(path).is_ok_and(|t| t.frames() >= frames) {
            return false;
        }
        assert!(start.elapsed() < Duration::from_secs(60), "no progress");
        sleep(Duration::from_millis(1));
    }
}

/// Ends a run without warning.
pub fn kill(run: &mut Child) {
    run.kill().unwrap();
    run.wait().unwrap();
}
