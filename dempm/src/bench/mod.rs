//! Speed of this machine, as tables in Markdown.

pub mod discs;
mod extent;
pub mod kernel;
mod markdown;
pub mod scenes;

pub use extent::Extent;
