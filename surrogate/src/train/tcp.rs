//! Sums over processes through TCP: rank 0 adds the values of the others in the order of their
//! ranks and sends the sums back, so all have the same bits.

use std::io::{Read, Write};
use std::net::TcpStream;

use gpu::ranks::{Environment, Fingerprint, RanksError, rendezvous};

use super::all_reduce::AllReduce;

/// TCP connections of one process.
pub struct Tcp {
    environment: Environment,
    /// On rank 0 the connections to ranks 1, 2, ...; elsewhere the one to rank 0.
    peers: Vec<TcpStream>,
    buffer: Vec<u8>,
}

impl Tcp {
    /// Waits until all processes have met; all must have the same fingerprint. A long wait is reported
    /// to `waiting` as by [`rendezvous`].
    ///
    /// # Errors
    /// If they do not rendezvous, or are about to train different things.
    pub fn join(
        environment: Environment,
        fingerprint: &Fingerprint,
        waiting: impl FnOnce(&str),
    ) -> Result<Self, RanksError> {
        let peers = rendezvous(&environment, fingerprint, waiting)?;
        Ok(Self { environment, peers, buffer: Vec::new() })
    }
}

impl AllReduce for Tcp {
    fn rank(&self) -> usize {
        self.environment.rank
    }

    fn ranks(&self) -> usize {
        self.environment.size
    }

    fn sum(&mut self, values: &mut [f32]) -> Result<(), RanksError> {
        let rank = self.environment.rank;
        let other = |peer: usize| if rank == 0 { peer + 1 } else { 0 };
        let lost = |peer, source| RanksError::Lost { rank, other: other(peer), source };
        self.buffer.resize(4 * values.len(), 0);
        if rank == 0 {
            for (peer, stream) in self.peers.iter_mut().enumerate() {
                stream.read_exact(&mut self.buffer).map_err(|source| lost(peer, source))?;
                for (sum, bytes) in values.iter_mut().zip(self.buffer.as_chunks().0) {
                    *sum += f32::from_le_bytes(*bytes);
                }
            }
        }
        for (bytes, value) in self.buffer.as_chunks_mut().0.iter_mut().zip(values.iter()) {
            *bytes = value.to_le_bytes();
        }
        for (peer, stream) in self.peers.iter_mut().enumerate() {
            stream.write_all(&self.buffer).map_err(|source| lost(peer, source))?;
        }
        if rank > 0 {
            self.peers[0].read_exact(&mut self.buffer).map_err(|source| lost(0, source))?;
            for (value, bytes) in values.iter_mut().zip(self.buffer.as_chunks().0) {
                *value = f32::from_le_bytes(*bytes);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::super::rank_tests::free_port;
    use super::*;

    #[test]
    fn sums_have_the_same_bits_everywhere() {
        let port = free_port();
        let threads: Vec<_> = (0..3)
            .map(|rank| {
                let address = ("127.0.0.1".to_owned(), port);
                let environment = Environment { rank, size: 3, local_rank: rank, address };
                thread::spawn(move || {
                    let number = rank as f32;
                    let mut ranks = Tcp::join(environment, &[7; 32], |_| ()).unwrap();
                    let mut values = vec![number + 1.0, 0.1 * (number + 1.0), -number];
                    ranks.sum(&mut values).unwrap();
                    ranks.sum(&mut values[2..]).unwrap();
                    assert!(ranks.any(rank == 2).unwrap() && !ranks.any(false).unwrap());
                    assert!(ranks.all_equal(&[200; 32]).unwrap());
                    assert!(!ranks.all_equal(&[if rank == 1 { 0 } else { 7 }; 32]).unwrap());
                    values
                })
            })
            .collect();
        let sums: Vec<_> = threads.into_iter().map(|thread| thread.join().unwrap()).collect();
        assert_eq!(sums[0], [6.0, 0.1 + 0.2 + 0.3, -9.0]);
        assert!(sums.iter().all(|sum| *sum == sums[0]));
    }
}
