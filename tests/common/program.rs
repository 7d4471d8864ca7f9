//! The programs, as a user starts them.

use std::path::Path;
use std::process::Command;

use assert_cmd::cargo::cargo_bin;

/// A program in a directory, with a cache of its own there.
pub fn program(name: &str, directory: &Path) -> Command {
    let mut command = Command::new(cargo_bin(name));
    command.current_dir(directory).env("DEMPM_CACHE_DIR", directory.join("cache"));
    command
}
