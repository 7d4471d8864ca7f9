//! Figures and animations of a trajectory: every material point or grain as a disc, coloured
//! by a [`Quantity`].

mod animation;
mod bodies;
mod colour_bar;
mod error;
mod figure;
mod layout;
mod options;
mod panels;
mod quantity;
mod select;
mod undrawn;
mod view;

pub use animation::animate;
pub use error::FigureError;
pub use options::{Options, Selection};
pub use panels::draw;
pub use quantity::Quantity;
pub use undrawn::Undrawn;
