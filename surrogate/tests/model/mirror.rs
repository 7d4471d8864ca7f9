//! Predictions averaged with their mirror images.

use rstest::rstest;
use surrogate::features::Window;
use surrogate::simulator::{Simulator, Training};
use surrogate::train::Precision;

use super::{Cpu, cloud, model, normalisation, small};

#[rstest]
fn the_mirrored_window_has_the_mirrored_accelerations(
    #[values("baseline", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
    #[values(false, true)] mirror: bool,
) {
    let config = small(name, 2);
    let simulator = Simulator {
        model: model::<Cpu>(&config),
        config,
        normalisation: normalisation(2),
        training: Training {
            frame_interval: 0.01,
            without_gravity: true,
            before_start: 0,
            steps: 0,
            range: None,
            accuracy: None,
        },
        mirror,
        device: Default::default(),
        gpu: None,
        precision: Precision::F32,
    };
    let points = 40;
    let run = |positions: &[f32], gravity| {
        let window = Window { positions, points, statics: &[], obstacles: &[] };
        simulator.accelerations(&mut simulator.inference(), &window, [1.0, 1.0], gravity)
    };
    // 1 - x is exact for these positions, so the images are to the bit.
    let here = cloud(points, 2, 3, 15);
    let there: Vec<f32> = here.as_chunks::<2>().0.iter().flat_map(|[x, y]| [1.0 - x, *y]).collect();
    let straight = run(&here, [0.25, -1.0]);
    let image: Vec<f64> = straight.as_chunks::<2>().0.iter().flat_map(|[x, y]| [-x, *y]).collect();
    assert_eq!(run(&there, [-0.25, -1.0]) == image, mirror);
}
