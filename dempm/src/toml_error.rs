//! Errors at a place of a TOML file.

use std::ops::Range;
use std::path::Path;

use miette::{LabeledSpan, NamedSource};
use serde::de::DeserializeOwned;

/// A TOML file that is wrong at one place.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("{message}")]
pub struct TomlError {
    /// What is wrong.
    message: String,
    /// The text of the file.
    #[source_code]
    text: NamedSource<String>,
    /// The place.
    #[label(collection)]
    place: Vec<LabeledSpan>,
}

impl TomlError {
    /// Wrong in a range of bytes of the `text` of a file, which gets a label.
    pub fn at(path: &Path, text: &str, span: Range<usize>, label: &str, message: String) -> Self {
        Self {
            message,
            text: NamedSource::new(path.to_string_lossy(), text.to_owned()).with_language("TOML"),
            place: vec![LabeledSpan::new_with_span(Some(label.to_owned()), span)],
        }
    }

    /// Reads the `text` of a file.
    ///
    /// # Errors
    /// The text is not TOML, or a key or the type of its value is wrong.
    pub fn read<T: DeserializeOwned>(path: &Path, text: &str) -> Result<T, Self> {
        toml::from_str(text).map_err(|error| {
            let span = error.span().unwrap_or(0..0);
            Self::at(path, text, span, "here", error.message().to_owned())
        })
    }
}
