//! Networks that the kernels can compute.

use super::error::CudaError;
use super::ops::tile::{MAX_HIDDEN_LAYERS, WIDTH};
use crate::network::{ModelConfig, ModelKind};

/// Most features of a node whose products fit into shared memory.
const MAX_FEATURES: usize = 32;

/// Checks that the kernels can compute networks like this.
///
/// # Errors
/// If one of its sizes is too large: which.
pub fn supports(config: &ModelConfig) -> Result<(), CudaError> {
    let mut limits = vec![
        ("width", config.width, WIDTH),
        ("hidden_layers", config.hidden_layers, MAX_HIDDEN_LAYERS),
    ];
    if config.kind == ModelKind::Gns {
        let velocities = MAX_FEATURES.saturating_sub(config.first_node_features());
        limits.push(("frames", config.frames, velocities / config.dimensions + 1));
    } else {
        let most = MAX_FEATURES - 3 * config.dimensions;
        limits.push(("node_features", config.further_node_features(), most));
    }
    for (key, value, most) in limits {
        if value > most {
            return Err(CudaError::Unsupported { key, value, most });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_too_large_is_named_with_a_way_out() {
        let wide = ModelConfig { width: 160, ..ModelConfig::default() };
        let long = ModelConfig { frames: 16, ..ModelConfig::named("gns").unwrap() };
        for (config, key) in [(wide, "`width` is 160"), (long, "`frames` is 16")] {
            let error = supports(&config).unwrap_err().to_string();
            let way = if cfg!(feature = "burn-cuda") { "Burn" } else { "--features burn-cuda" };
            assert!(error.contains(key) && error.contains(way), "{error}");
        }
    }
}

/// What a network has memory for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capacity {
    /// Points of all windows together.
    pub points: usize,
    /// Edges of a frame.
    pub edges: usize,
}
