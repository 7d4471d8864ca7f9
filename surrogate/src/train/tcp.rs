//! Sums over processes through TCP: rank 0 adds what the others send in the order of their ranks,
//! and sends the sums back, so that all have the same bits.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::ranks::{AllReduce, Place, RankError};

/// How long processes wait for one another at the start.
const PATIENCE: Duration = Duration::from_secs(120);
const PAUSE: Duration = Duration::from_millis(50);

/// Bytes of a hash of what is trained.
pub type Fingerprint = [u8; 32];

/// Connections of one process.
pub struct Tcp {
    place: Place,
    /// On rank 0 those to ranks 1, 2, ...; elsewhere the one to rank 0.
    peers: Vec<TcpStream>,
    buffer: Vec<u8>,
}

impl Tcp {
    /// Waits until all processes have met. `fingerprint` is that of what they are about to train.
    ///
    /// # Errors
    /// If they do not meet within two minutes or train different things.
    pub fn join(place: Place, fingerprint: &Fingerprint) -> Result<Self, RankError> {
        let peers = if place.rank == 0 {
            accept(&place, fingerprint)?
        } else {
            vec![connect(&place, fingerprint)?]
        };
        Ok(Self { place, peers, buffer: Vec::new() })
    }
}

impl AllReduce for Tcp {
    fn rank(&self) -> usize {
        self.place.rank
    }

    fn ranks(&self) -> usize {
        self.place.ranks
    }

    fn sum(&mut self, values: &mut [f32]) -> Result<(), RankError> {
        let rank = self.place.rank;
        let other = |peer: usize| if rank == 0 { peer + 1 } else { 0 };
        let lost = |peer, source| RankError::Lost { rank, other: other(peer), source };
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

/// Rank 0 waits for the others, who say their rank and fingerprint, and tells them whether it
/// agrees.
fn accept(place: &Place, fingerprint: &Fingerprint) -> Result<Vec<TcpStream>, RankError> {
    let failed = |source| RankError::Connect {
        rank: 0,
        action: "meet the others at",
        address: place.address.clone(),
        source,
    };
    let listener = TcpListener::bind(&place.address).map_err(failed)?;
    listener.set_nonblocking(true).map_err(failed)?;
    let mut peers: Vec<Option<TcpStream>> = (1..place.ranks).map(|_| None).collect();
    let began = Instant::now();
    while peers.iter().any(Option::is_none) {
        let mut stream = match listener.accept() {
            Ok((stream, _)) => stream,
            Err(error) if error.kind() != io::ErrorKind::WouldBlock => return Err(failed(error)),
            Err(_) if began.elapsed() < PATIENCE => {
                sleep(PAUSE);
                continue;
            }
            Err(_) => {
                let missing = peers.iter().position(Option::is_none).map_or(0, |peer| peer + 1);
                let text = format!("rank {missing} did not come within {PATIENCE:?}");
                return Err(failed(io::Error::new(io::ErrorKind::TimedOut, text)));
            }
        };
        stream.set_nonblocking(false).map_err(failed)?;
        stream.set_nodelay(true).map_err(failed)?;
        let (mut rank, mut theirs) = ([0; 8], Fingerprint::default());
        stream.read_exact(&mut rank).map_err(failed)?;
        stream.read_exact(&mut theirs).map_err(failed)?;
        let other = u64::from_le_bytes(rank) as usize;
        let seat = other.checked_sub(1).and_then(|peer| peers.get_mut(peer));
        let agreed = theirs == *fingerprint && seat.as_ref().is_some_and(|seat| seat.is_none());
        stream.write_all(&[u8::from(agreed)]).map_err(failed)?;
        match seat {
            Some(seat) if agreed => *seat = Some(stream),
            _ => return Err(RankError::Differs { other }),
        }
    }
    Ok(peers.into_iter().flatten().collect())
}

fn connect(place: &Place, fingerprint: &Fingerprint) -> Result<TcpStream, RankError> {
    let failed = |source| RankError::Connect {
        rank: place.rank,
        action: "reach rank 0 at",
        address: place.address.clone(),
        source,
    };
    let began = Instant::now();
    let mut stream = loop {
        match TcpStream::connect(&place.address) {
            Ok(stream) => break stream,
            Err(_) if began.elapsed() < PATIENCE => sleep(PAUSE),
            Err(error) => return Err(failed(error)),
        }
    };
    stream.set_nodelay(true).map_err(failed)?;
    stream.write_all(&(place.rank as u64).to_le_bytes()).map_err(failed)?;
    stream.write_all(fingerprint).map_err(failed)?;
    let mut agreed = [0];
    stream.read_exact(&mut agreed).map_err(failed)?;
    if agreed == [1] { Ok(stream) } else { Err(RankError::Differs { other: place.rank }) }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    /// A place at a port that was free a moment ago.
    fn places(ranks: usize) -> Vec<Place> {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        (0..ranks).map(|rank| Place { rank, ranks, address: address.clone() }).collect()
    }

    #[test]
    fn sums_have_the_same_bits_everywhere() {
        let threads: Vec<_> = places(3)
            .into_iter()
            .map(|place| {
                thread::spawn(move || {
                    let rank = place.rank as f32;
                    let mut ranks = Tcp::join(place, &[7; 32]).unwrap();
                    let mut values = vec![rank + 1.0, 0.1 * (rank + 1.0), -rank];
                    ranks.sum(&mut values).unwrap();
                    ranks.sum(&mut values[2..]).unwrap();
                    values
                })
            })
            .collect();
        let sums: Vec<_> = threads.into_iter().map(|thread| thread.join().unwrap()).collect();
        assert_eq!(sums[0], [6.0, 0.1 + 0.2 + 0.3, -9.0]);
        assert!(sums.iter().all(|sum| *sum == sums[0]));
    }

    #[test]
    fn processes_that_train_something_else_are_told() {
        let [first, second] = places(2).try_into().unwrap();
        let other = thread::spawn(move || Tcp::join(second, &[2; 32]).err());
        let errors = [Tcp::join(first, &[1; 32]).err(), other.join().unwrap()];
        for error in errors {
            assert!(matches!(error, Some(RankError::Differs { other: 1 })), "{error:?}");
        }
    }
}
