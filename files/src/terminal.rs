//! Text for people: printing never ends a computation, and never controls the terminal.

use std::borrow::Cow;
use std::cell::RefCell;
use std::fmt::Display;
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether nobody wants information besides results, warnings and errors.
static QUIET: AtomicBool = AtomicBool::new(false);
/// Whether the standard output belongs to one JSON object.
static JSON: AtomicBool = AtomicBool::new(false);

/// Takes the notes of a thread.
type Listener = Box<dyn Fn(&str)>;

thread_local! {
    /// Who gets the notes of this thread instead of the terminal.
    static LISTENER: RefCell<Option<Listener>> = const { RefCell::new(None) };
}

/// Hands what the calling thread [notes](print_note) to `listener`, and prints none of its [results](print_result): for a
/// program that embeds a command and returns its result in another way.
pub fn divert_notes(listener: impl Fn(&str) + 'static) {
    LISTENER.set(Some(Box::new(listener)));
}

/// Standard output is closed or full.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("cannot write to the standard output")]
pub struct PrintError(#[from] io::Error);

impl PrintError {
    /// Whether the reader has seen enough, as `head` has.
    pub fn is_closed(&self) -> bool {
        self.0.kind() == io::ErrorKind::BrokenPipe
    }
}

/// Whether [`inform!`](crate::inform) and [`announce!`](crate::announce) write nothing from now on, and there are no lines of progress: `--quiet`.
pub fn set_quiet(quiet: bool) {
    QUIET.store(quiet, Ordering::Relaxed);
}

/// What [`set_quiet`] has set.
pub fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Whether [`announce!`](crate::announce) writes nothing from now on: the standard output is for [`print_result`] alone.
pub fn set_json(json: bool) {
    JSON.store(json, Ordering::Relaxed);
}

/// Whether [`announce!`](crate::announce) writes anything.
pub fn announces() -> bool {
    !is_quiet() && !JSON.load(Ordering::Relaxed)
}

/// Writes `text` and a line feed to the standard error stream. Where nobody reads it, it is lost, and the
/// computation goes on.
pub fn print_note(text: impl Display) {
    let text = format!("{text}\n");
    let is_diverted = LISTENER.with_borrow(|listener| {
        listener.as_ref().map(|listener| listener(&printable(&text))).is_some()
    });
    if is_diverted {
        return;
    }
    let _ = io::stderr().lock().write_all(printable(&text).as_bytes());
}

/// Writes `text`, the product of a command, to the standard output.
///
/// # Errors
/// If the standard output is closed or full.
pub fn print_result(text: impl Display) -> Result<(), PrintError> {
    if LISTENER.with_borrow(Option::is_some) {
        return Ok(());
    }
    let text = text.to_string();
    let mut out = io::stdout().lock();
    out.write_all(printable(&text).as_bytes())?;
    Ok(out.flush()?)
}

/// Writes a formatted line to the standard error stream, as `eprintln!` does, but never panics.
#[macro_export]
macro_rules! note {
    ($($format:tt)*) => { $crate::print_note(::std::format_args!($($format)*)) };
}

/// As [`note!`], for what is no warning: silent after [`set_quiet`].
#[macro_export]
macro_rules! inform {
    ($($format:tt)*) => {
        if !$crate::is_quiet() {
            $crate::print_note(::std::format_args!($($format)*));
        }
    };
}

/// Writes a formatted line to the standard output, as `println!` does, for a command whose product is text.
/// Gives a [`PrintError`] if it is closed or full.
#[macro_export]
macro_rules! out {
    ($($format:tt)*) => {
        $crate::print_result(::std::format_args!("{}\n", ::std::format_args!($($format)*)))
    };
}

/// As [`out!`], for a command whose product is a file: where nobody reads the line, it is lost. Silent after
/// [`set_quiet`] and [`set_json`].
#[macro_export]
macro_rules! announce {
    ($($format:tt)*) => {
        if $crate::announces() {
            ::std::mem::drop($crate::out!($($format)*))
        }
    };
}

/// `text` without characters that control a terminal. Titles and names may come from anybody's files.
///
/// Line feeds, tabs and the colours of messages (`ESC [ ... m`) stay.
pub fn printable(text: &str) -> Cow<'_, str> {
    let is_plain = |c: char| !c.is_control() || c == '\n' || c == '\t';
    if text.chars().all(is_plain) {
        return Cow::Borrowed(text);
    }
    let mut kept = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(c) = rest.chars().next() {
        let length = colour(rest).unwrap_or(c.len_utf8());
        if is_plain(c) || length > c.len_utf8() {
            kept.push_str(&rest[..length]);
        } else {
            kept.push(char::REPLACEMENT_CHARACTER);
        }
        rest = &rest[length..];
    }
    Cow::Owned(kept)
}

/// The length of the colour sequence that `text` begins with.
fn colour(text: &str) -> Option<usize> {
    let numbers = text.strip_prefix("\x1b[")?;
    let end = numbers.find(|c: char| !(c.is_ascii_digit() || c == ';'))?;
    numbers[end..].starts_with('m').then_some(2 + end + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_colours_reach_the_terminal() {
        assert!(matches!(printable("a\tplain\nµ line"), Cow::Borrowed(_)));
        assert_eq!(printable("\x1b[1;31mred\x1b[0m"), "\x1b[1;31mred\x1b[0m");
        // A new window title, a cleared screen, a bell, a carriage return, an 8-bit control.
        assert_eq!(printable("\x1b]0;owned\x07"), "\u{fffd}]0;owned\u{fffd}");
        assert_eq!(printable("\x1b[2J"), "\u{fffd}[2J");
        assert_eq!(printable("a\rb\u{9b}c\x1b["), "a\u{fffd}b\u{fffd}c\u{fffd}[");
    }

    #[test]
    fn notes_of_a_thread_can_be_diverted() {
        use std::cell::RefCell;
        use std::rc::Rc;
        // A thread of its own, as others print their notes.
        let heard = std::thread::spawn(|| {
            let heard = Rc::new(RefCell::new(String::new()));
            let listener = Rc::clone(&heard);
            divert_notes(move |text| *listener.borrow_mut() += text);
            crate::note!("one {}", 1);
            print_result("a result that is lost").unwrap();
            crate::note!("two\x07");
            heard.take()
        });
        assert_eq!(heard.join().unwrap(), "one 1\ntwo\u{fffd}\n");
    }
}
