//! The report as far as it has been computed.

use crate::render::block::Block;
use crate::render::figure::Figure;
use crate::section_cache::Computed;
use crate::text::slug;

/// Name of the fact that is shown at the top of the page.
pub const NOTE: &str = "note";

/// What a report was made with, as names and values.
pub type Facts = Vec<(String, String)>;

/// A chapter with its computed sections.
pub struct ReportChapter {
    /// The heading.
    pub title: String,
    /// What it is about, with the terms that its sections use.
    pub about: String,
    /// Its sections, in order.
    pub sections: Vec<ReportSection>,
}

/// A section with what it computed.
pub struct ReportSection {
    /// The heading.
    pub title: String,
    /// What it shows, in one sentence.
    pub lead: String,
    /// Its name in addresses and file names.
    pub slug: String,
    /// Its blocks; `None` if it has not been computed.
    pub computed: Option<Computed>,
}

impl ReportSection {
    /// A section named after its title.
    pub fn new(title: &str, lead: &str, computed: Option<Computed>) -> Self {
        Self { title: title.to_owned(), lead: lead.to_owned(), slug: slug(title), computed }
    }

    /// Its blocks; none if it has not been computed.
    pub fn blocks(&self) -> &[Block] {
        self.computed.as_ref().map_or(&[], |computed| &computed.blocks)
    }

    /// Name of the CSV file of a table or map.
    pub fn table_file(&self, title: &str) -> String {
        format!("tables/{}--{}.csv", self.slug, slug(title))
    }

    /// Name of the file of a figure.
    pub fn figure_file(&self, figure: &Figure) -> String {
        format!("figures/{}--{}.{}", self.slug, slug(&figure.title), figure.picture.suffix())
    }
}
