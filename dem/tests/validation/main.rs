//! The RVE against closed forms, against itself and against published granular mechanics.
//!
//! `cargo test -p dem --release` runs the fast ones. The statistical ones take minutes:
//! `cargo test -p dem --release -- --ignored --nocapture` prints the figures of
//! docs/validation-dem.md.

mod batch;
mod biaxial;
mod common;
mod energy;
mod free;
mod kinematics;
mod ladder;
mod lattice;
mod moduli;
mod neighbours;
mod objectivity;
mod pair;
mod precision;
mod restart;
mod rolling;
mod shear;
mod stability;
mod statics;
mod thin_cell;
