//! What a section of the report consists of.

use serde::{Deserialize, Serialize};

pub use crate::figure::Figure;
pub use crate::map::{Map, Outcome};
pub use crate::table::Table;

/// A piece of a section, in the order in which a person reads it.
///
/// Texts are plain; words between backticks are set as code.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Block {
    /// What matters most in the section, in a sentence or two: the first screen of the page has it.
    Headline(String),
    /// What the whole report is about: a word for the question, and the answer. Stands before
    /// everything else.
    Lead {
        question: String,
        answer: String,
    },
    /// A heading within the section.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// Remarks, one a line.
    List(Vec<String>),
    /// What came out, one a line.
    Findings(Vec<String>),
    /// What a program said, word for word.
    Quote(String),
    Table(Table),
    Figure(Figure),
    /// Parameter x parameter, and what happened.
    Map(Map),
    Missing(Missing),
}

/// Something that should be here and is not. Nothing is ever filled in for it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Missing {
    /// What is not shown.
    pub what: String,
    /// Why not.
    pub why: String,
    /// What to do to have it shown.
    pub remedy: String,
}

impl Block {
    pub fn headline(text: impl Into<String>) -> Self {
        Self::Headline(text.into())
    }

    pub fn lead(question: impl Into<String>, answer: impl Into<String>) -> Self {
        Self::Lead { question: question.into(), answer: answer.into() }
    }

    pub fn heading(text: impl Into<String>) -> Self {
        Self::Heading(text.into())
    }

    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    pub fn missing(
        what: impl Into<String>,
        why: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::Missing(Missing { what: what.into(), why: why.into(), remedy: remedy.into() })
    }
}
