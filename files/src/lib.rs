//! Output files of long computations.
//!
//! - [`write_atomically`] and [`AtomicFile`]: a file appears complete under its name, or not at all;
//! - [`FileLock`]: one process at a time writes a file;
//! - [`refuse_input`] and [`refuse_same`]: an output never replaces what it is made from, nor another
//!   output;
//! - [`OutputFile`]: keeps the system's reason for a failed write;
//! - [`SealedWriter`] and [`read_sealed`]: a file that is read back shows any damage;
//! - [`Interrupt`]: Ctrl-C and SIGTERM end a computation in order;
//! - [`note!`] and [`print_result`]: printing never ends a computation;
//! - [`Heartbeat`]: lines of progress where there is no terminal.
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let directory = tempfile::tempdir()?;
//! # let path = directory.path().join("results/table.csv");
//! let _lock = files::FileLock::take(&path)?;
//! files::write_text(&path, "time,front\n0.0,1.0\n")?;
//! assert_eq!(std::fs::read_to_string(&path)?.lines().count(), 2);
//! # Ok(())
//! # }
//! ```
#![warn(missing_docs)]

mod atomic;
mod csv;
mod heartbeat;
mod interrupt;
mod lock;
mod output_file;
mod overwrite;
mod sealed;
mod terminal;
mod timestamp;

pub use atomic::{
    AtomicFile, WriteError, check_writable, path_beside, write_atomically, write_text,
};
pub use csv::csv_cell;
pub use heartbeat::{Heartbeat, Pace, duration};
pub use interrupt::{Guard, INTERRUPTED, Interrupt, InterruptError, report_size_limits_as_errors};
pub use lock::{FileLock, LockError};
pub use output_file::OutputFile;
pub use overwrite::{ReplacesInput, SameOutput, is_same, refuse_input, refuse_same};
pub use sealed::{SealError, SealedWriter, read_sealed, seal};
pub use terminal::{
    PrintError, announces, divert_notes, is_quiet, print_note, print_result, printable, set_json,
    set_quiet,
};
pub use timestamp::utc_now;
