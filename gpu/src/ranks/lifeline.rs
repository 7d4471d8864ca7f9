//! Ranks notice when another one ends. A collective operation of NCCL would wait for it for ever.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, sleep};
use std::time::Duration;

/// What a rank has for saying itself why it ends, if it does so too.
const GRACE: Duration = Duration::from_secs(5);

/// Open connections, of rank 0 to ranks 1, 2, ..., of the others to rank 0.
#[derive(Debug)]
pub struct Lifeline {
    peers: Vec<TcpStream>,
    /// Nobody is to be missed any more.
    over: Arc<AtomicBool>,
}

impl Lifeline {
    /// Ends this process some seconds after a peer has ended without saying
    /// [`goodbye`](Self::goodbye).
    ///
    /// # Errors
    /// If a connection cannot be listened to.
    pub fn watch(rank: usize, peers: Vec<TcpStream>) -> io::Result<Self> {
        Self::watch_with(rank, peers, GRACE, move |other| {
            eprintln!("Error: rank {rank}: rank {other} has ended, so this one cannot go on");
            // At once: to exit in order, CUDA would wait for work that never ends.
            // SAFETY: has no preconditions.
            unsafe { libc::_exit(1) }
        })
    }

    fn watch_with(
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

    /// Tells the others that this rank is done and may end.
    pub fn goodbye(&mut self) {
        for peer in &mut self.peers {
            // One that has ended in the meantime does not want to know.
            let _ = peer.write_all(&[1]);
        }
    }
}

impl Drop for Lifeline {
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
    fn who_ends_without_goodbye_is_missed() {
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
        let lifeline = Lifeline::watch_with(0, vec![to_first, to_second], grace, lost).unwrap();
        let quiet = |peer| Lifeline::watch_with(1, vec![peer], grace, |_| ()).unwrap();
        let mut first = quiet(first);
        first.goodbye();
        drop(first);
        assert_eq!(missed.recv_timeout(Duration::from_millis(50)), Err(RecvTimeoutError::Timeout));
        drop(quiet(second));
        assert_eq!(missed.recv_timeout(Duration::from_secs(10)), Ok(2));
        drop(lifeline);
    }
}
