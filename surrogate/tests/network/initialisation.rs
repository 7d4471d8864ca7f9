//! Where trainings start.

use surrogate::network::Model;

use super::{Cpu, Train, cloud, input, small, values};
use surrogate::network::ModelConfig;
use surrogate::network::parameters::weights as list;

/// Differences between the outputs of points, relative to the outputs.
fn contrast(model: &Model<Cpu>, config: &ModelConfig) -> f64 {
    let positions = cloud(60, config.frames, 3);
    let output = values(model.forward(&input(config, &[(&positions, 60)])));
    let mean = |k: usize| output.iter().skip(k).step_by(2).sum::<f64>() / 60.0;
    let means = [mean(0), mean(1)];
    let spread: f64 = output.iter().enumerate().map(|(k, a)| (a - means[k % 2]).powi(2)).sum();
    (spread / output.iter().map(|a| a * a).sum::<f64>()).sqrt()
}

/// From random weights all points get nearly the same answer; near the identity what distinguishes
/// them arrives at the end.
#[test]
fn near_the_identity_points_keep_their_differences() {
    let config = ModelConfig { width: 64, frames: 6, ..small("baseline") };
    let random = Model::<Cpu>::new(&config, 7, &Default::default());
    let near = random.clone().near_identity();
    let [random, near] = [random, near].map(|model| contrast(&model, &config));
    assert!(near > 2.0 * random, "{random} {near}");
}

/// The weights stay ones that learn, and those of the GNS stay as they are.
#[test]
fn the_start_changes_weights_and_nothing_else() {
    for name in ["baseline", "frame4-msg1-hidden1-edgemsg", "gns"] {
        let config = small(name);
        let random = Model::<Train>::new(&config, 7, &Default::default());
        let near = random.clone().near_identity();
        let (before, after) = (list(&random), list(&near));
        assert_eq!(before.len(), after.len());
        assert_eq!(before == after, name == "gns");
        if before == after {
            continue;
        }
        let positions = cloud(20, config.frames, 4);
        let output = near.forward(&input(&config, &[(&positions, 20)]));
        let gradients = output.powi_scalar(2).sum().backward();
        let learnt = surrogate::network::parameters::gradients(&near, &gradients);
        let still = learnt.iter().filter(|g| **g == 0.0).count();
        assert!(
            still * 10 < learnt.len(),
            "{name}: {still} of {} weights do not learn",
            learnt.len()
        );
    }
}
