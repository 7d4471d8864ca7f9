//! `validation report` as a user meets it: one command, a page, tables, figures, numbers.

use std::path::Path;
use std::process::{Command, Output};

use assert_cmd::cargo::cargo_bin;
use tempfile::TempDir;

fn report(directory: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(cargo_bin("validation"));
    command.current_dir(directory).env("HDF5_USE_FILE_LOCKING", "FALSE");
    command.arg("report").args(arguments).output().unwrap()
}

#[test]
fn a_folder_that_is_not_there_is_refused() {
    let directory = TempDir::new().unwrap();
    let output = report(directory.path(), &["--data", "nowhere"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("nowhere: there is no such folder"));
}
