//! Files of element tests.

use std::ops::Range;
use std::path::{Path, PathBuf};

use dem::element::Stage;
use dem::{Grains, Packing, RveParameters, consolidate};
use serde::Deserialize;
use toml::Spanned;
use toml::de::DeTable;

use super::packing_csv::{PackingError, read_packing};
use crate::scene::{moved::new_place, parameters::outside};
use crate::toml_error::TomlError;

/// An element test.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ElementTest {
    #[serde(default)]
    grains: Grains,
    /// Parameters of the RVE; its grains are those of `[grains]`.
    #[serde(default)]
    pub rve: RveParameters,
    /// Seed of the packing, which is consolidated with `[rve.preparation]`.
    #[serde(default = "first_seed")]
    pub seed: u64,
    /// A packing to start from instead, as written by `--dump-packing`, relative to the test file. It
    /// has no contact history, so an isotropic stage should come first.
    pub packing: Option<PathBuf>,
    /// Macro step (s): the velocity gradient is constant, and the servo acts once.
    #[serde(default = "default_macro_step")]
    macro_step: Spanned<f64>,
    /// Time between rows of the path (s).
    sampling: Spanned<f64>,
    stage: Spanned<Vec<Spanned<Stage>>>,
}

fn first_seed() -> u64 {
    1
}

fn default_macro_step() -> Spanned<f64> {
    Spanned::new(0..0, 1.0e-4)
}

/// A test that cannot be read or prepared.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
pub enum TestError {
    /// The file cannot be read.
    #[error("cannot read {}", path.display())]
    Read {
        /// The test file.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is wrong at one place.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Invalid(#[from] TomlError),
    /// A parameter of the RVE is outside its limits.
    #[error("{}: {problem}", path.display())]
    Parameter {
        /// The test file.
        path: PathBuf,
        /// Key, value and limits.
        problem: String,
    },
    /// The packing file cannot be used.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Packing(#[from] PackingError),
    /// The packing cannot be consolidated.
    #[error(transparent)]
    Consolidation(#[from] dem::Error),
}

impl ElementTest {
    /// Reads and checks a test file.
    ///
    /// # Errors
    /// If the file cannot be read, or a key or value is wrong.
    pub fn load(path: &Path) -> Result<Self, TestError> {
        let text = std::fs::read_to_string(path)
            .map_err(|source| TestError::Read { path: path.to_owned(), source })?;
        let at = |span: Range<usize>, label: &str, message: String| {
            TestError::Invalid(TomlError::at(path, &text, span, label, message))
        };
        if let Some((message, place)) = moved(&text) {
            return Err(at(place, "no longer here", message));
        }
        let mut test: Self = TomlError::read(path, &text)?;
        test.rve.grains.clone_from(&test.grains);
        let problem = outside("grains", &test.grains).or_else(|| outside("rve", &test.rve));
        if let Some(problem) = problem {
            return Err(TestError::Parameter { path: path.to_owned(), problem });
        }
        for (key, value) in [("macro_step", &test.macro_step), ("sampling", &test.sampling)] {
            if !(*value.get_ref() > 0.0 && value.get_ref().is_finite()) {
                return Err(at(value.span(), key, format!("{key} must be positive")));
            }
        }
        if test.sampling() < test.macro_step() {
            let message = format!("sampling must be at least macro_step, {} s", test.macro_step());
            return Err(at(test.sampling.span(), "sampling", message));
        }
        if test.stage.get_ref().is_empty() {
            let message = "stage is empty: a test needs at least one [[stage]]".to_owned();
            return Err(at(test.stage.span(), "stage", message));
        }
        for (k, stage) in test.stage.get_ref().iter().enumerate() {
            if let Err((key, reason)) = stage.get_ref().check() {
                return Err(at(stage.span(), key, format!("stage {}: {key} {reason}", k + 1)));
            }
        }
        Ok(test)
    }

    /// Macro step (s).
    pub fn macro_step(&self) -> f64 {
        *self.macro_step.get_ref()
    }

    /// Time between rows of the path (s).
    pub fn sampling(&self) -> f64 {
        *self.sampling.get_ref()
    }

    /// The stages of the path.
    pub fn stages(&self) -> impl Iterator<Item = &Stage> {
        self.stage.get_ref().iter().map(Spanned::get_ref)
    }

    /// The packing file to start from, if there is one; `folder` is that of the test file.
    pub fn packing_file(&self, folder: &Path) -> Option<PathBuf> {
        self.packing.as_ref().map(|path| folder.join(path))
    }

    /// The packing at the start of the path, with scaled masses; `folder` is that of the test file.
    ///
    /// # Errors
    /// If the packing cannot be read or consolidated.
    pub fn prepare(&self, folder: &Path) -> Result<Packing<f64>, TestError> {
        let mut packing = match self.packing_file(folder) {
            Some(path) => read_packing(&path, &self.rve)?,
            None => consolidate(&self.rve, self.seed)?,
        };
        packing.scale_mass(self.rve.grains.mass_scale);
        Ok(packing)
    }
}

/// The first key that older files have in another table, with its place.
fn moved(text: &str) -> Option<(String, Range<usize>)> {
    let document = DeTable::parse(text).ok()?.into_inner();
    let rve = document.get("rve")?.get_ref().as_table()?;
    let preparation = rve.get("preparation").and_then(|value| value.get_ref().as_table());
    let keys = rve.keys().map(|key| (format!("rve.{}", key.get_ref()), key.span()));
    let deeper = preparation.into_iter().flat_map(DeTable::keys);
    let deeper = deeper.map(|key| (format!("rve.preparation.{}", key.get_ref()), key.span()));
    keys.chain(deeper).find_map(|(path, place)| Some((new_place(&path)?, place)))
}
