//! The trajectory file and what is made of it.

mod crafted;
mod damage;
mod formats;
#[cfg(unix)]
mod full_disk;
mod grains;
mod grid;
mod products;
mod python;
mod synthetic;
