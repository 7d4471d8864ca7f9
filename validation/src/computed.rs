//! What a section came to, kept in the work directory: a part of a report can be computed anew, or
//! on another machine, while the rest stays as it is.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::block::Block;
use crate::context::Context;
use crate::work::{Run, read_json, write_json};

/// A section that has been computed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Computed {
    pub made: Made,
    /// Wall time, s; near zero if everything was there.
    pub seconds: f64,
    /// It could not be computed; its only block says why.
    pub failed: bool,
    pub blocks: Vec<Block>,
    /// The runs that it rests on.
    pub runs: Vec<Run>,
}

/// When, where and by what a section was computed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Made {
    pub when: String,
    pub command: String,
    pub version: String,
    pub device: String,
}

impl Made {
    /// Here and now.
    pub fn now(context: &Context) -> Self {
        let command: Vec<String> = std::env::args().collect();
        Self {
            when: files::utc_now(),
            command: command.join(" "),
            version: format!("{} (build {})", env!("CARGO_PKG_VERSION"), context.work.build()),
            device: context.device_name.clone(),
        }
    }
}

impl Computed {
    /// What is kept of a section of this suite.
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
    let suite = format!("{:?}", context.suite).to_lowercase();
    Path::new(context.work.root()).join("sections").join(format!("{suite}--{slug}.json"))
}
