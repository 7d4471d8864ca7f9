//! The models of a scene.

use super::discs::DiscModel;
use super::mpm_model::MpmModel;

/// The model of a scene with its state.
pub enum Model {
    /// The material point method with packings or a continuum law.
    Mpm(Box<MpmModel>),
    /// Every grain as a disc.
    Discs(Box<DiscModel>),
}
