//! The pieces that a section consists of.

use serde::{Deserialize, Serialize};

use crate::render::figure::Figure;
use crate::render::map::Map;
use crate::render::table::Table;

/// A piece of a section. Texts are plain; words between backticks are set as code.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Block {
    /// The main result of the section, in a sentence or two; also listed after the first screen.
    Headline(String),
    /// A main result of the whole report; the first screen shows it.
    Lead {
        /// What it is about, in a word.
        question: String,
        /// The result in one sentence that needs no explanation.
        answer: String,
    },
    /// A heading within the section.
    Heading(String),
    /// A paragraph.
    Text(String),
    /// A list of remarks.
    List(Vec<String>),
    /// A list of results.
    Findings(Vec<String>),
    /// A message of a program, verbatim.
    Quote(String),
    /// A table.
    Table(Table),
    /// A picture with its caption.
    Figure(Figure),
    /// Outcomes over two parameters.
    Map(Map),
    /// Something that could not be shown.
    Missing(Missing),
}

/// Something that could not be shown. Nothing is ever filled in for it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Missing {
    /// What is not shown.
    pub what: String,
    /// Why not.
    pub why: String,
    /// How to have it shown.
    pub remedy: String,
}

impl Block {
    /// A [`Block::Headline`].
    pub fn headline(text: impl Into<String>) -> Self {
        Self::Headline(text.into())
    }

    /// A [`Block::Lead`].
    pub fn lead(question: impl Into<String>, answer: impl Into<String>) -> Self {
        Self::Lead { question: question.into(), answer: answer.into() }
    }

    /// A [`Block::Heading`].
    pub fn heading(text: impl Into<String>) -> Self {
        Self::Heading(text.into())
    }

    /// A [`Block::Text`].
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    /// A [`Block::Missing`].
    pub fn missing(
        what: impl Into<String>,
        why: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self::Missing(Missing { what: what.into(), why: why.into(), remedy: remedy.into() })
    }
}
