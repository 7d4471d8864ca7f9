//! Studies of the direct solver or its parts.

use crate::context::Context;
use crate::render::block::Block;
use crate::render::section::Section;
use crate::render::sections::stability::study::blocks;
use crate::studies::stability::{Study, StudyError};
use crate::suite::Suite;

/// The full suite takes about this many times as long as the quick one.
pub(super) const FULL: f64 = 20.0;

/// A study of the direct solver or its parts.
pub(super) struct Direct {
    pub title: &'static str,
    pub lead: &'static str,
    pub study: fn(Suite) -> Result<Study, StudyError>,
    /// Estimated time of the quick suite, s.
    pub seconds: f64,
}

impl Section for Direct {
    fn title(&self) -> &'static str {
        self.title
    }

    fn lead(&self) -> &'static str {
        self.lead
    }

    fn estimate(&self, context: &Context) -> f64 {
        if context.cache.has_cached(self.title, &key(context)) {
            return 0.0;
        }
        self.seconds * context.suite.pick(1.0, FULL)
    }

    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>> {
        let (suite, estimate) = (context.suite, self.estimate(context));
        let study =
            context.cached(self.title, &key(context), estimate, || Ok((self.study)(suite)?))?;
        Ok(blocks(&study)?)
    }
}

/// A study depends on the suite and on the program.
pub(super) fn key(context: &Context) -> String {
    format!("{:?} {}", context.suite, context.cache.build())
}
