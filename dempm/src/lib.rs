//! Hierarchical MPM x DEM for granular flow: scene file -> simulation -> trajectory file.
//!
//! The material point method (crate `mpm`) advances material points on a background grid; every point
//! may carry its own packing of discs (crate `dem`), which answers the velocity gradient with a
//! stress. A scene is read and checked, simulated, and its trajectory written and read:
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! use dempm::scene::Scene;
//! use dempm::simulation::Simulation;
//! use dempm::trajectory::{Trajectory, TrajectoryWriter};
//!
//! let text = r#"
//!     duration = 0.02
//!     [domain]
//!     size = [2.0, 1.0]
//!     [[column]]
//!     size = [0.5, 0.5]
//!     [material]
//!     kind = "mu-i"
//! "#;
//! let mut simulation = Simulation::new(Scene::parse(text, "column.toml")?)?;
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("column.h5");
//! let header = simulation.header(files::utc_now());
//! let mut writer = TrajectoryWriter::create(&path, &header, &simulation.static_points())?;
//! for _ in 0..simulation.scene.steps_per_frame() {
//!     simulation.advance()?;
//! }
//! writer.push(simulation.frame())?;
//! writer.finish("finished")?;
//!
//! let trajectory = Trajectory::open(&path)?;
//! assert_eq!((trajectory.frames(), trajectory.points().mass.len()), (1, 1024));
//! # Ok(())
//! # }
//! ```
#![warn(missing_docs)]
#![warn(clippy::print_stdout, clippy::print_stderr)]

pub mod bench;
pub mod calibrate;
pub mod check;
pub mod choose;
pub mod commands;
pub mod comparison;
pub mod dataset;
pub mod device;
pub mod element;
pub mod export;
pub mod figures;
pub mod fronts;
pub mod import;
pub mod memory;
pub mod packings;
pub mod program;
pub mod run;
pub mod scene;
pub mod simulation;
pub mod soundness;
pub mod toml_error;
pub mod trajectory;
