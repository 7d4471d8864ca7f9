//! The paper (Zhao, Chen, Zhao, CMAME 433, 2025, 117536), side by side with what is here.

mod ablation;
mod absent;
mod cases;
mod cells;
mod data;
mod list;
mod networks;
mod ranking;
mod resolutions;
mod stated_accuracy;
mod training_curves;
mod wall_times;

pub use list::all;
