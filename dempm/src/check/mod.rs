//! The cost of a scene and warnings about it, without a simulation.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = "duration = 3.0\n[domain]\nsize = [10.0, 10.0]\n[[column]]\nsize = [3.0, 3.0]\n";
//! let scene = dempm::scene::Scene::parse(text, "column.toml")?;
//! let needs = dempm::check::Needs::of(&scene, &dempm::check::Rates::of_processor(1.0e8));
//! assert_eq!(needs.points, 36_864);
//! # Ok(())
//! # }
//! ```

mod accuracy;
mod disc_rate;
mod needs;
mod rates;
mod table;
mod units;

pub use accuracy::Accuracy;
pub use disc_rate::disc_steps_per_second;
pub use needs::{DemNeeds, Needs, RveNeeds};
pub use rates::Rates;
pub(crate) use rates::WHOLE_SCENES_ON_GPU;
pub use units::{bytes, duration, quantity};
