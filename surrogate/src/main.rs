//! The `surrogate` command.

use std::env::args_os;
use std::process::ExitCode;

fn main() -> ExitCode {
    surrogate::program::main(args_os())
}
