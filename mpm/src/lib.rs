//! Two-dimensional material point method (MPM), on the CPU and, by its twin in [`cuda`], on a GPU.
//!
//! Material points carry mass, velocity and stress through a fixed background grid of square
//! cells; [`Solver::advance`] is one explicit step. The constitutive law is a [`Material`]: the
//! solver hands it the velocity gradients of all points at once and takes back stresses and
//! volumes.
//!
//! Everything is per unit thickness (m², kg/m), plane strain, SI, and **tension positive**.
//! Results are bitwise the same for any number of threads.
//!
//! ```
//! use mpm::{Domain, DruckerPrager, DruckerPragerParameters, Friction, Numerics, Points, Solver, Vec2, Walls};
//!
//! let walls = Walls { bottom: Friction::Coulomb(0.5), ..Walls::default() };
//! let domain = Domain { size: Vec2::new(4.0, 2.0), walls, cell: 0.125 };
//! let law = DruckerPragerParameters::default();
//! let mut points = Points::rectangle(Vec2::zeros(), Vec2::new(1.0, 1.0), 0.0625, law.density);
//! let mut material = DruckerPrager::new(law, &points.stress)?;
//! let mut solver = Solver::new(domain, Numerics::default(), Vec2::new(0.0, -9.81), vec![])?;
//! for _ in 0..100 {
//!     solver.advance(&mut points, &mut material, 1.0e-4)?;
//! }
//! assert!(solver.stable_step(&points, &material)?.gershgorin > 1.0e-4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

mod basis;
mod bins;
mod boundary;
mod budget;
mod cell_average;
mod confine;
pub mod cuda;
mod density;
mod error;
mod friction;
mod g2p;
mod grid;
mod grid_update;
mod material;
mod numerics;
mod obstacle;
mod p2g;
mod points;
mod solver;
mod stable_step;
mod stencil;
mod velocity_gradient;

pub use basis::{Basis, SUPPORT, ShapeFunctions};
pub use budget::{Budget, Ledger};
pub use error::Error;
pub use friction::{Friction, Walls};
pub use grid::Domain;
pub use material::{
    DruckerPrager, DruckerPragerParameters, Elastic, ElasticParameters, Material, MaterialError,
};
pub use numerics::{Numerics, Scheme, Transfer, WallContact};
pub use obstacle::Obstacle;
pub use points::Points;
pub use solver::Solver;
pub use stable_step::StableStep;

/// A vector in the plane (x to the right, y up).
pub type Vec2 = nalgebra::Vector2<f64>;
/// A tensor in the plane; `m[(i, j)]` is row `i`, column `j`.
pub type Mat2 = nalgebra::Matrix2<f64>;

/// Fewest points or nodes worth handing to another thread.
const PARALLEL_GRAIN: usize = 256;
