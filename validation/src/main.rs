//! The `validation` command.

use std::env::args_os;
use std::process::ExitCode;

fn main() -> ExitCode {
    validation::program::main(args_os())
}
