//! Each method pushed until it fails.

mod direct;
mod glance;
mod learned;
mod list;
mod study;

pub use list::all;
