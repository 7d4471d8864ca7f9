//! The page: one HTML file with everything in it, for screens of any size and for paper.

mod first_screen;
mod page;
mod section;
mod table;
mod text;

pub use page::page;
