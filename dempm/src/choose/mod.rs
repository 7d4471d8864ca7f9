//! No more than a scene needs: the cheapest model whose result is near enough to the truth.
//!
//! The truth is the same scene with every grain as a disc. [`candidates`] are the ways to compute a scene,
//! [`ErrorModel`] says how far from the truth each is expected to be, fitted to a table of measured [`Case`]s, and
//! [`Choice`] takes the cheapest that is [`Within`] a distance.

mod after;
mod candidate;
mod choice;
mod conformal;
mod error_model;
mod evaluation;
mod family;
mod features;
mod judgement;
mod kernel_regression;
mod learned;
mod library;
mod standardisation;
mod table;
mod within;

pub use after::distance;
pub use candidate::{Candidate, candidates, discs_on_grids};
pub use choice::{Choice, ChoiceError, Entry};
pub use conformal::quantile;
pub use error_model::{ErrorModel, Expected, LEVEL, Prediction};
pub use evaluation::{Evaluation, FACTOR, Outcome, Trial};
pub use family::Family;
pub use features::{Features, features};
pub use judgement::Judgement;
pub use learned::{Learned, LearnedError};
pub use library::{Case, Distance, head, read};
pub use standardisation::Standardisation;
pub use within::Within;
