//! Errors and warnings about a scene, shown at their places in the file.

use std::fmt;
use std::ops::Range;
use std::path::PathBuf;

use miette::{Diagnostic, LabeledSpan, NamedSource, Severity, SourceCode};

/// A scene that cannot be used.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum SceneError {
    /// The file cannot be read.
    #[error("cannot read the scene {}", path.display())]
    Read {
        /// The scene file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is wrong in one or more places.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Invalid(Box<Problems>),
}

/// An error or a warning with its places in the scene file and a remedy.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// What is wrong or doubtful.
    pub message: String,
    /// The remedy.
    pub help: Option<String>,
    /// Places in the text (byte ranges) with labels.
    pub places: Vec<(Range<usize>, String)>,
    /// An error makes the scene unusable; a warning does not.
    pub severity: Severity,
}

impl Problem {
    /// An error without a place yet.
    pub(super) fn error(message: impl Into<String>) -> Self {
        Self { message: message.into(), help: None, places: Vec::new(), severity: Severity::Error }
    }

    /// A warning without a place yet.
    pub(super) fn warning(message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, ..Self::error(message) }
    }

    /// Adds a place; `None` (a key that was left to its default) adds nothing.
    pub(super) fn at(mut self, place: Option<Range<usize>>, label: impl Into<String>) -> Self {
        self.places.extend(place.map(|place| (place, label.into())));
        self
    }

    /// Adds a remedy.
    pub(super) fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Problem {}

impl Diagnostic for Problem {
    fn severity(&self) -> Option<Severity> {
        Some(self.severity)
    }

    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        Some(Box::new(
            self.places.iter().map(|(place, label)| {
                LabeledSpan::new_with_span(Some(label.clone()), place.clone())
            }),
        ))
    }
}

/// All errors and warnings about one scene file, with its text.
#[derive(Debug)]
pub struct Problems {
    name: String,
    source: NamedSource<String>,
    /// At least one; in the order of the file as far as they have a place.
    pub problems: Vec<Problem>,
}

impl Problems {
    /// `name` is the name of the file and `text` its content.
    pub(super) fn new(name: &str, text: &str, mut problems: Vec<Problem>) -> Self {
        problems.sort_by_key(|p| p.places.first().map_or(0, |(place, _)| place.start));
        Self {
            name: name.to_owned(),
            source: NamedSource::new(name, text.to_owned()).with_language("TOML"),
            problems,
        }
    }
}

impl fmt::Display for Problems {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = |severity| self.problems.iter().filter(|p| p.severity == severity).count();
        let part = |n, word: &str| match n {
            0 => None,
            1 => Some(format!("1 {word}")),
            n => Some(format!("{n} {word}s")),
        };
        let parts =
            [part(count(Severity::Error), "error"), part(count(Severity::Warning), "warning")];
        let counts: Vec<_> = parts.into_iter().flatten().collect();
        write!(f, "{} in the scene {}", counts.join(" and "), self.name)
    }
}

impl std::error::Error for Problems {}

impl Diagnostic for Problems {
    fn severity(&self) -> Option<Severity> {
        self.problems.iter().map(|p| p.severity).max()
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        Some(&self.source)
    }

    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        Some(Box::new(self.problems.iter().map(|p| p as &dyn Diagnostic)))
    }
}
