//! Figures and animations: every material point or grain as a disc, coloured by a [`Quantity`], of one trajectory or
//! of several in comparison; and charts of the paths of element tests.

mod animation;
mod average;
mod bodies;
mod colour_bar;
mod error;
mod figure;
mod key;
mod layout;
mod options;
mod panel;
mod panels;
mod paths;
mod quantity;
mod run;
mod select;
mod shorten;
mod shown;
mod time_text;
mod undrawn;
mod view;

pub use animation::animate;
pub use error::FigureError;
pub use options::{Average, Compare, Options, Selection};
pub use panels::draw;
pub use paths::{PathError, draw_paths};
pub use quantity::Quantity;
pub use undrawn::Undrawn;
