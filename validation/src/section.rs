//! What a section of the report is.

use crate::block::Block;
use crate::context::Context;

/// A part of the report: one case, one table of the paper, one kind of failure.
pub trait Section {
    /// Its heading; unique in the report, since file names come from it.
    fn title(&self) -> &'static str;

    /// About how long [`run`](Self::run) will compute, s; what is in the work directory already
    /// costs nothing. Progress and its estimate come from this.
    fn estimate(&self, _context: &Context) -> f64 {
        0.0
    }

    /// Whether it is written with every report, whatever part of that is asked for; it computes
    /// nothing then.
    fn always(&self) -> bool {
        false
    }

    /// Computes what is missing and says what came out.
    ///
    /// # Errors
    /// When something unforeseen goes wrong; the report then says so in place of the section. A
    /// method that fails in the way under study is no error but a result.
    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>>;
}

/// Sections under a common heading.
pub struct Chapter {
    pub title: &'static str,
    pub sections: Vec<Box<dyn Section>>,
}
