//! What a section of the report is.

use crate::context::Context;
use crate::render::block::Block;

/// A part of the report: one case, one table of the paper, one kind of failure.
pub trait Section {
    /// Its heading; unique in the report, since files are named after it.
    fn title(&self) -> &'static str;

    /// What it shows, in one sentence.
    fn lead(&self) -> &'static str;

    /// Estimated time of [`run`](Self::run), s, without what is kept in the work directory.
    fn estimate(&self, _context: &Context) -> f64 {
        0.0
    }

    /// Whether every report writes it, whatever `--only` names. Such a section computes nothing: it
    /// summarises the others.
    fn always(&self) -> bool {
        false
    }

    /// Computes what is missing and returns the blocks of the section.
    ///
    /// # Errors
    /// If something unforeseen goes wrong, which the report shows in place of the section. A method
    /// that fails in the way under study is a result, not an error.
    fn run(&self, context: &mut Context) -> miette::Result<Vec<Block>>;
}

/// Sections under a common heading.
pub struct Chapter {
    /// The heading.
    pub title: &'static str,
    /// What it is about, with the terms that its sections use.
    pub about: &'static str,
    /// Its sections, in order.
    pub sections: Vec<Box<dyn Section>>,
}
