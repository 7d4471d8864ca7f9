//! Trained networks: their files, which network of the paper they are, and what they cost.

mod cost;
mod model;
mod networks;

pub use cost::ModelCost;
pub use model::{Model, is_of_discs, models_in};
pub use networks::{
    ablation, baseline, baseline_and_others, belongs, is_of_paper, is_on_finest_data, of_packings,
    trained_on,
};
