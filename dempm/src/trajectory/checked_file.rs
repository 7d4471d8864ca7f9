//! Checks on a trajectory while it is opened: format, shapes and values of its datasets.

use std::path::Path;

use hdf5::{Dataset, File, H5Type};

use super::attributes::{has, read_scalar};
use super::error::{Result, TrajectoryError};
use super::layout::{FORMAT, FORMAT_VERSION, MASS, TIME};
use super::links;
use super::texts::read_text;

/// Deflate compresses at most 1032 times. A file that claims more is damaged, and allocating the claimed
/// memory would abort the program.
const MOST_COMPRESSION: u64 = 1100;

/// Refuses other HDF5 files and trajectories of later formats.
pub(super) fn check_format(path: &Path, file: &File) -> Result<()> {
    // Damage must not pass for another kind of file.
    let format = match has(file, "format").map_err(TrajectoryError::at(path, "the attributes"))? {
        true => read_text(file, "format").map_err(TrajectoryError::at(path, "format"))?,
        false => String::new(),
    };
    if format != FORMAT {
        return Err(TrajectoryError::NotATrajectory { path: path.to_owned() });
    }
    let version: u64 =
        read_scalar(file, "format_version").map_err(TrajectoryError::at(path, "format_version"))?;
    if version > FORMAT_VERSION {
        return Err(TrajectoryError::NewerFormat {
            path: path.to_owned(),
            found: version,
            known: FORMAT_VERSION,
        });
    }
    Ok(())
}

/// Splits values in C order into rows of `N`.
pub(super) fn to_rows<T: Copy, const N: usize>(values: Vec<T>) -> Vec<[T; N]> {
    values.as_chunks().0.to_vec()
}

/// An open file whose datasets are checked before they are read.
pub(super) struct CheckedFile<'a> {
    /// Where the file is.
    pub path: &'a Path,
    /// The file.
    pub file: &'a File,
    /// Size of the file, bytes.
    pub size: u64,
}

impl CheckedFile<'_> {
    pub(super) fn open(&self, name: &str) -> Result<Dataset> {
        let dataset =
            links::dataset(self.file, name).map_err(TrajectoryError::at(self.path, name))?;
        let number = dataset.dtype().map_err(TrajectoryError::at(self.path, name))?.size() as u64;
        let bytes = dataset
            .shape()
            .iter()
            .map(|&size| size as u64)
            .try_fold(number, u64::checked_mul)
            .unwrap_or(u64::MAX);
        if bytes / MOST_COMPRESSION > self.size {
            return Err(self.shape_error(name, &dataset, "what fits into the file"));
        }
        Ok(dataset)
    }

    /// Opens a dataset that may be absent.
    pub(super) fn find(&self, name: &str) -> Result<Option<Dataset>> {
        match links::exists(self.file, name).map_err(TrajectoryError::at(self.path, name))? {
            true => self.open(name).map(Some),
            false => Ok(None),
        }
    }

    /// Refuses masses that are not above zero, and times that do not follow each other.
    pub(super) fn check_numbers(&self, mass: &[f64], time: &[f64]) -> Result<()> {
        if let Some(point) = mass.iter().position(|m| !(*m > 0.0 && m.is_finite())) {
            let problem = format!("of point {point} is {} kg/m, it must be above 0", mass[point]);
            return Err(self.value_error(MASS, problem));
        }
        let follows = |&frame: &usize| {
            time[frame].is_finite() && (frame == 0 || time[frame] > time[frame - 1])
        };
        match (0..time.len()).find(|frame| !follows(frame)) {
            Some(frame) => {
                let problem = format!(
                    "of frame {frame} is {} s, it must be later than the frame before",
                    time[frame]
                );
                Err(self.value_error(TIME, problem))
            }
            None => Ok(()),
        }
    }

    pub(super) fn value_error(&self, item: &str, problem: String) -> TrajectoryError {
        TrajectoryError::Value { path: self.path.to_owned(), item: item.to_owned(), problem }
    }

    /// Reads a one-dimensional dataset.
    pub(super) fn whole<T: H5Type>(&self, name: &str, length: Option<usize>) -> Result<Vec<T>> {
        let dataset = self.open(name)?;
        match (dataset.shape().as_slice(), length) {
            (&[found], Some(expected)) => self.expect_length(name, found, expected)?,
            (&[_], None) => {}
            _ => return Err(self.shape_error(name, &dataset, "one dimension")),
        }
        dataset.read_raw().map_err(TrajectoryError::at(self.path, name))
    }

    /// Reads a dataset of shape (rows, N).
    pub(super) fn rows<T: H5Type + Copy, const N: usize>(
        &self,
        dataset: &Dataset,
        name: &str,
    ) -> Result<Vec<[T; N]>> {
        let rows = dataset.shape().first().copied().unwrap_or(0);
        self.expect_shape(name, dataset, &[rows, N])?;
        dataset.read_raw().map(to_rows).map_err(TrajectoryError::at(self.path, name))
    }

    pub(super) fn expect_shape(
        &self,
        name: &str,
        dataset: &Dataset,
        expected: &[usize],
    ) -> Result<()> {
        if dataset.shape() == expected {
            Ok(())
        } else {
            Err(self.shape_error(name, dataset, &format!("{expected:?}")))
        }
    }

    pub(super) fn expect_length(&self, name: &str, found: usize, expected: usize) -> Result<()> {
        if found == expected {
            return Ok(());
        }
        Err(TrajectoryError::Shape {
            path: self.path.to_owned(),
            item: name.to_owned(),
            found: vec![found],
            expected: format!("[{expected}]"),
        })
    }

    fn shape_error(&self, name: &str, dataset: &Dataset, expected: &str) -> TrajectoryError {
        TrajectoryError::Shape {
            path: self.path.to_owned(),
            item: name.to_owned(),
            found: dataset.shape(),
            expected: expected.to_owned(),
        }
    }
}
