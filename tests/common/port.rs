//! Ports for tests that start several processes.

use std::net::TcpListener;
use std::sync::atomic::{AtomicU32, Ordering};

/// A port that was free a moment ago, and that no other test is given: none of those that the system hands out
/// (32 768 to 60 999 on Linux), of which tests beside this one may get the same before it is used.
pub fn port() -> u16 {
    static TAKEN: AtomicU32 = AtomicU32::new(0);
    let candidates = std::iter::repeat_with(|| {
        let taken = TAKEN.fetch_add(1, Ordering::Relaxed);
        (20_000 + (std::process::id().wrapping_mul(64) + 2 * taken) % 12_000) as u16
    });
    let is_free = |port: &u16| TcpListener::bind(("127.0.0.1", *port)).is_ok();
    candidates.take(1000).find(is_free).expect("a free port")
}
