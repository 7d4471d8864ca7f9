//! Runs of the suite's programs, each kept in a folder that is named after a hash of its inputs:
//! a report reuses what is there and continues what was interrupted.

mod cache;
mod hash;
mod job;
mod json;
mod process;
mod run;

pub use cache::RunCache;
pub use hash::{hash, hash_of_file};
pub use job::{Input, Job};
pub use json::{read_json, write_json};
pub use process::Interrupted;
pub use run::{About, DIFFERENCE, Run};
