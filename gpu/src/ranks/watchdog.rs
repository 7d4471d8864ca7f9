//! Ends a rank when another one has ended, for which an operation of NCCL would wait for ever.

use files::note;
use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, sleep};
use std::time::Duration;

/// Time for a rank that fails too to report its own error first.
const GRACE: Duration = Duration::from_secs(5);

/// A thread for each connection: from rank 0 to ranks 1, 2, ..., from the others to rank 0.
#[derive(Debug)]
pub struct Watchdog {
    peers: Vec<TcpStream>,
    /// Lost connections no longer matter.
    over: Arc<AtomicBool>,
}

impl Watchdog {
    /// From now on, ends this process five seconds after a peer has ended without a
    /// [`goodbye`](Self::goodbye).
    ///
    /// # Errors
    /// A connection cannot be read from.
    pub fn start(rank: usize, peers: Vec<TcpStream>) -> io::Result<Self> {
        Self::start_with(rank, peers, GRACE, move |other| {
            note!("Error: rank {rank} stops because rank {other} has ended");
            // Not `exit`, in which CUDA would wait for work that never ends.
            // SAFETY: has no preconditions.
            unsafe { libc::_exit(1) }
        })
    }

    fn start_with(
        rank: usize,
        peers: Vec<TcpStream>,
        grace: Duration,
        lost: impl Fn(usize) + Clone + Send + 'static,
    ) -> io::Result<Self> {
        let over = Arc::new(AtomicBool::new(false));
        for (place, peer) in peers.iter().enumerate() {
            let (mut peer, over, lost) = (peer.try_clone()?, over.clone(), lost.clone());
            let other = if rank == 0 { place + 1 } else { 0 };
            thread::spawn(move || {
                if peer.read_exact(&mut [0]).is_ok() {
                    return;
                }
                sleep(grace);
                if !over.load(Ordering::Relaxed) {
                    lost(other);
                }
            });
        }
        Ok(Self { peers, over })
    }

    /// Tells the peers that this rank is done and may end.
    pub fn goodbye(&mut self) {
        for peer in &mut self.peers {
            // It may have ended already.
            let _ = peer.write_all(&[1]);
        }
    }
}

impl Drop for Watchdog {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        for peer in &self.peers {
            let _ = peer.shutdown(Shutdown::Both);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::net::TcpListener;
    use std::sync::mpsc::{RecvTimeoutError, channel};

    use super::*;

    #[test]
    fn a_peer_that_ends_without_goodbye_is_reported() {
        let pair = || {
            let listener = TcpListener::bind("127.0.0.1:0").unwrap();
            let peer = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
            (listener.accept().unwrap().0, peer)
        };
        let (to_first, first) = pair();
        let (to_second, second) = pair();
        let (send, missed) = channel();
        let lost = move |rank| send.send(rank).unwrap();
        let grace = Duration::from_millis(1);
        let watchdog = Watchdog::start_with(0, vec![to_first, to_second], grace, lost).unwrap();
        let quiet = |peer| Watchdog::start_with(1, vec![peer], grace, |_| ()).unwrap();
        let mut first = quiet(first);
        first.goodbye();
        drop(first);
        assert_eq!(missed.recv_timeout(Duration::from_millis(50)), Err(RecvTimeoutError::Timeout));
        drop(quiet(second));
        assert_eq!(missed.recv_timeout(Duration::from_secs(10)), Ok(2));
        drop(watchdog);
    }
}
