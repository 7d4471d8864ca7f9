//! Trajectories: open and read everything.
#![no_main]

use dempm::trajectory::Trajectory;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    dempm_fuzz::with_file(bytes, "t.h5", |path| {
        let Ok(trajectory) = Trajectory::open(path) else { return };
        let frames = trajectory.frames().min(64);
        for index in 0..frames {
            let _ = trajectory.frame(index);
        }
        let _ = trajectory.positions(0..frames);
        let _ = trajectory.velocities(0..frames);
        let _ = trajectory.boxes(0..frames);
    });
});
