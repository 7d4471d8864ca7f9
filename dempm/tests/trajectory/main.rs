//! The trajectory file and what is made of it.

mod damage;
mod formats;
mod products;
mod python;
mod synthetic;
