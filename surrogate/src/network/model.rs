//! A network of either kind.

use burn::module::Module;
use burn::tensor::Tensor;
use burn::tensor::backend::Backend;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::config::{ModelConfig, ModelKind};
use super::gns::Gns;
use super::tgnns::Tgnns;
use crate::features::WindowInput;

/// A TGNNS or a GNS.
#[derive(Module, Debug)]
#[allow(clippy::large_enum_variant)] // a handful exist at a time
pub enum Model<B: Backend> {
    /// One graph per frame.
    Tgnns(Tgnns<B>),
    /// One graph, of the last frame.
    Gns(Gns<B>),
}

impl<B: Backend> Model<B> {
    /// A network with random weights, the same for the same seed on every device.
    ///
    /// # Panics
    /// If the configuration is not valid ([`ModelConfig::validate`]).
    pub fn new(config: &ModelConfig, seed: u64, device: &B::Device) -> Self {
        config.validate().expect("a valid configuration");
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        match config.kind {
            ModelKind::Tgnns => Self::Tgnns(Tgnns::new(config, &mut rng, device)),
            ModelKind::Gns => Self::Gns(Gns::new(config, &mut rng, device)),
        }
    }

    /// Normalised accelerations in the last frame, points x 2.
    pub fn forward(&self, input: &WindowInput<B>) -> Tensor<B, 2> {
        match self {
            Self::Tgnns(network) => network.forward(input),
            Self::Gns(network) => network.forward(input),
        }
    }
}
