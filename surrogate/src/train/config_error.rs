//! Errors of training files.

use std::path::PathBuf;
use std::sync::Arc;

use miette::{NamedSource, SourceSpan};

use crate::network;
use crate::network::weights::WeightsError;

/// A training file that cannot be used.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("{}: cannot read it", path.display())]
    Read {
        /// The training file.
        path: PathBuf,
        /// The error of the file system.
        source: std::io::Error,
    },
    /// Not TOML, an unknown key or a value of another type.
    #[error("{file}: {message}")]
    Syntax {
        /// The training file.
        file: String,
        /// The error of the parser.
        message: String,
        /// Text of the file.
        #[source_code]
        text: Arc<NamedSource<String>>,
        /// Where in the text.
        #[label("here")]
        place: Option<SourceSpan>,
    },
    /// A value out of range.
    #[error("{file}: `{key}` is {value}, but must be {range}")]
    Range {
        /// The training file.
        file: String,
        /// The key.
        key: &'static str,
        /// Its value.
        value: String,
        /// Valid values.
        range: String,
    },
    /// A network by name and by architecture.
    #[error("{file}: `network` and [model] exclude each other")]
    #[diagnostic(help("remove one of them"))]
    Both {
        /// The training file.
        file: String,
    },
    /// An invalid architecture.
    #[error("{file}")]
    Model {
        /// The training file.
        file: String,
        /// The key and its valid values.
        source: network::ConfigError,
    },
    /// The weights to start from cannot be used.
    #[error("{file}: `start`")]
    Start {
        /// The training file.
        file: String,
        /// The error of the weights file.
        source: Box<WeightsError>,
    },
    /// The weights to start from belong to another network.
    #[error("{file}: the network is not that of `start` = {}: {differences}", weights.display())]
    #[diagnostic(help("without `network` and [model], the network of `start` is trained"))]
    OtherNetwork {
        /// The training file.
        file: String,
        /// The weights file.
        weights: PathBuf,
        /// The keys that differ.
        differences: String,
    },
}
