//! Sizes of the networks.

use burn::module::Module;
use rstest::rstest;
use surrogate::network::{Model, ModelConfig, PAPER_NETWORKS};

use super::{Cpu, cloud, input, model, small, values};

#[rstest]
#[case("baseline", 1_425_282)]
#[case("hidden1", 1_062_018)]
#[case("msg1", 1_276_546)]
#[case("msg0", 1_127_810)]
#[case("msg0-hidden1", 830_594)]
#[case("frame4", 1_127_810)]
#[case("frame4-msg0-hidden1", 599_170)]
#[case("frame4-msg1", 979_074)]
#[case("frame4-hidden1", 830_594)]
#[case("frame4-msg1-hidden1-edgemsg", 748_802)]
fn parameter_counts_are_those_of_table_6(#[case] name: &str, #[case] count: usize) {
    assert!(PAPER_NETWORKS.contains(&name));
    let config = ModelConfig::named(name).unwrap();
    assert_eq!(config.parameter_count(), count);
    assert_eq!(model::<Cpu>(&config).num_params(), count);
}

#[test]
fn the_count_holds_for_the_gns() {
    let config = ModelConfig::named("gns").unwrap();
    assert_eq!(model::<Cpu>(&config).num_params(), config.parameter_count());
}

#[test]
fn invalid_configurations_are_refused() {
    let default = ModelConfig::default;
    assert_eq!(default().validate(), Ok(()));
    assert!(ModelConfig::named("no such network").is_none());
    for wrong in [
        ModelConfig { dimensions: 3, ..default() },
        ModelConfig { width: usize::MAX, ..default() },
        ModelConfig { hidden_layers: 0, ..default() },
        ModelConfig { frames: 1, ..default() },
        ModelConfig { gns_layers: 0, ..default() },
        ModelConfig { leaky_slope: f64::NAN, ..default() },
        ModelConfig { connection_radius: 0.0, ..default() },
    ] {
        wrong.validate().unwrap_err();
    }
}

#[test]
fn weights_depend_on_the_seed_alone() {
    let config = small("baseline");
    let positions = cloud(20, 3, 1);
    let run = |seed| {
        let model = Model::<Cpu>::new(&config, seed, &Default::default());
        values(model.forward(&input(&config, &[(&positions, 20)])))
    };
    assert_eq!(run(3), run(3));
    assert_ne!(run(3), run(4));
}
