//! Reading an input within this process, with the limits that a program of its own would have.

use std::alloc::{GlobalAlloc, Layout, System};
use std::any::Any;
use std::cell::Cell;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use crate::campaign::{Finding, Promise};

/// What reading some kilobytes may take.
const TIME: Duration = Duration::from_secs(10);
/// Memory that one thread may hold at a time, bytes.
const MEMORY: isize = 1 << 29;

/// The allocator of the system, which counts the bytes that each thread holds.
struct Counting;

#[global_allocator]
static COUNTING: Counting = Counting;

thread_local! {
    /// Bytes held by the thread, and the most of them so far.
    static HELD: Cell<[isize; 2]> = const { Cell::new([0; 2]) };
}

fn count(bytes: isize) {
    // A thread that ends has nothing to count with.
    let _ = HELD.try_with(|held| {
        let [now, most] = held.get();
        held.set([now + bytes, most.max(now + bytes)]);
    });
}

// SAFETY: all is left to the allocator of the system.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: the caller's promises are those of this call.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: as above.
        unsafe { System.dealloc(place, layout) }
    }

    unsafe fn realloc(&self, place: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as isize - layout.size() as isize);
        // SAFETY: as above.
        unsafe { System.realloc(place, layout, size) }
    }
}

/// How reading ended: with a value, or with an error as a user would see it.
pub type Read<T> = Result<T, String>;

/// Reads in a thread of its own. Errors have to name `file`.
pub fn read<T: Send + 'static>(
    how: &str,
    file: &str,
    reader: impl FnOnce() -> miette::Result<T> + Send + 'static,
) -> Result<Read<T>, Finding> {
    let (sender, receiver) = channel();
    let thread = thread::spawn(move || {
        let read = reader().map_err(|report| format!("{report:?}"));
        let [_, most] = HELD.get();
        // Nobody listens any more if it took too long.
        let _ = sender.send((read, most));
    });
    let (read, most) = match receiver.recv_timeout(TIME) {
        Ok(ended) => ended,
        Err(RecvTimeoutError::Timeout) => {
            return Promise::NoHang.broken(format!("{how}: took more than {TIME:?}"));
        }
        Err(RecvTimeoutError::Disconnected) => {
            let panic = thread.join().err().as_deref().map_or_else(String::new, message);
            return Promise::NoPanic.broken(format!("{how}: panicked: {panic}"));
        }
    };
    if most > MEMORY {
        return Promise::Memory.broken(format!("{how}: took {} MiB", most >> 20));
    }
    if let Err(error) = &read {
        // Messages are wrapped to the width of a terminal.
        let text: String = error.chars().filter(|c| !c.is_whitespace() && *c != '│').collect();
        if !text.contains(file) {
            return Promise::NamedError.broken(format!("{how}: {error}"));
        }
    }
    Ok(read)
}

fn message(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message").to_owned()
}
