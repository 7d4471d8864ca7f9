//! The `dempm` command.

use std::env::args_os;
use std::process::ExitCode;

fn main() -> ExitCode {
    dempm::program::main(args_os())
}
