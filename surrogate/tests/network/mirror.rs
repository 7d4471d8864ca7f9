//! Predictions averaged with their mirror images.

use rstest::rstest;
use surrogate::features::Window;
use surrogate::simulator::{Simulator, Training};

use super::{Cpu, cloud, model, normalisation, small};

#[rstest]
fn the_mirrored_window_has_the_mirrored_accelerations(
    #[values("baseline", "frame4-msg1-hidden1-edgemsg", "gns")] name: &str,
    #[values(false, true)] mirror: bool,
) {
    let config = small(name);
    let training = Training::untrained(0.01, true);
    let model = model::<Cpu>(&config);
    let simulator =
        Simulator { mirror, ..Simulator::new(model, config, normalisation(), training) };
    let points = 40;
    let run = |positions: &[f32], gravity| {
        let window = Window { positions, points, statics: &[], obstacles: &[] };
        simulator.accelerations(&mut simulator.inference(), &window, [1.0, 1.0], gravity)
    };
    // 1 - x is exact for these positions, so the images are to the bit.
    let here = cloud(points, 3, 15);
    let there: Vec<f32> = here.as_chunks::<2>().0.iter().flat_map(|[x, y]| [1.0 - x, *y]).collect();
    let straight = run(&here, [0.25, -1.0]);
    let image: Vec<f64> = straight.as_chunks::<2>().0.iter().flat_map(|[x, y]| [-x, *y]).collect();
    assert_eq!(run(&there, [-0.25, -1.0]) == image, mirror);
}
