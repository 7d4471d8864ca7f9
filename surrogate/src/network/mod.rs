//! The networks: architecture, layers, weights and files.
//!
//! Layers are plain Burn operations, readable and on any backend. They are the reference for
//! [`inference`](crate::inference) on the CPU and for the CUDA kernels ([`cuda`](crate::cuda)).

mod blocks;
pub mod burn_backend;
mod config;
mod gns;
mod initialisation;
mod message;
mod mlp;
mod model;
mod node_feature;
pub mod parameters;
mod precision;
mod tgnns;
pub mod weights;

pub(crate) use config::is_zero;
pub use config::{ConfigError, DIMENSIONS, ModelConfig, ModelKind, PAPER_NETWORKS, differences};
pub use gns::Gns;
pub use initialisation::Initialisation;
pub use message::MessageLayer;
pub use mlp::{Mlp, MlpShape};
pub use model::Model;
pub use node_feature::{NodeFeature, feature_columns};
pub use precision::Precision;
pub use tgnns::Tgnns;
