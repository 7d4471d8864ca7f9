//! Computed sections, kept in the work directory: part of a report can be computed again, or on
//! another machine, while the rest stays.

use std::path::PathBuf;

use files::utc_now;
use serde::{Deserialize, Serialize};

use crate::context::Context;
use crate::render::block::Block;
use crate::run_cache::{Run, read_json, write_json};

/// A computed section.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Computed {
    /// When, where and by what it was computed.
    pub made: Made,
    /// Wall time, s; near zero if all runs were there.
    pub seconds: f64,
    /// Whether it failed; its only block then says why.
    pub failed: bool,
    /// What it shows.
    pub blocks: Vec<Block>,
    /// The runs that it uses.
    pub runs: Vec<Run>,
}

/// When, where and by what a section was computed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Made {
    /// Time, UTC.
    pub when: String,
    /// The command.
    pub command: String,
    /// Version of the program and hash of its file.
    pub version: String,
    /// Device in words.
    pub device: String,
}

impl Made {
    /// By this command, now.
    pub fn now(context: &Context) -> Self {
        let command: Vec<String> = std::env::args().collect();
        Self {
            when: utc_now(),
            command: command.join(" "),
            version: format!("{} (build {})", env!("CARGO_PKG_VERSION"), context.cache.build()),
            device: context.device_name.clone(),
        }
    }
}

impl Computed {
    /// The kept section of the same suite; `None` if there is none.
    pub fn kept(context: &Context, slug: &str) -> Option<Self> {
        read_json(&file(context, slug))
    }

    /// Keeps it for later reports of the same suite.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn keep(&self, context: &Context, slug: &str) -> miette::Result<()> {
        write_json(&file(context, slug), self)
    }
}

fn file(context: &Context, slug: &str) -> PathBuf {
    let suite = context.suite.name();
    context.cache.root().join("sections").join(format!("{suite}--{slug}.json"))
}
