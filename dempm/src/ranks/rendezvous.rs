//! Rank 0 gives the id of the NCCL communicator to the others over TCP.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::{Launch, RanksError};

/// Bytes of an `ncclUniqueId`.
pub const ID_BYTES: usize = 128;
/// First bytes of a connection, so that a stranger at the port is not taken for a rank.
const HELLO: &[u8; 8] = b"DEMPM id";
/// How long ranks wait for each other: launchers may start them one after the other.
const PATIENCE: Duration = Duration::from_secs(120);
const PAUSE: Duration = Duration::from_millis(50);

/// The id that rank 0 gives; `id` of the others is not looked at.
pub fn share(launch: &Launch, id: [u8; ID_BYTES]) -> Result<[u8; ID_BYTES], RanksError> {
    let (host, port) = &launch.address;
    let failed = |action| {
        let (rank, address) = (launch.rank, format!("{host}:{port}"));
        move |source| RanksError::Rendezvous { rank, action, address, source }
    };
    let deadline = Instant::now() + PATIENCE;
    if launch.size == 1 {
        return Ok(id);
    }
    if launch.rank == 0 {
        give(*port, launch.size - 1, &id, deadline).map_err(failed("not all ranks came to"))?;
        return Ok(id);
    }
    take(host, *port, deadline).map_err(failed("did not find rank 0 at"))
}

/// Hands the id to `peers` connections.
fn give(port: u16, peers: usize, id: &[u8; ID_BYTES], deadline: Instant) -> io::Result<()> {
    let listener = TcpListener::bind(("0.0.0.0", port))?;
    listener.set_nonblocking(true)?;
    let mut served = 0;
    while served < peers {
        match listener.accept() {
            Ok((peer, _)) => served += usize::from(serve(peer, id).is_ok()),
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                if Instant::now() > deadline {
                    let reason = format!("{served} of {peers} came");
                    return Err(io::Error::new(io::ErrorKind::TimedOut, reason));
                }
                sleep(PAUSE);
            }
            Err(error) => return Err(error),
        }
    }
    Ok(())
}

fn serve(mut peer: TcpStream, id: &[u8; ID_BYTES]) -> io::Result<()> {
    peer.set_nonblocking(false)?;
    peer.set_read_timeout(Some(Duration::from_secs(5)))?;
    let mut hello = [0; HELLO.len()];
    peer.read_exact(&mut hello)?;
    if hello != *HELLO {
        return Err(io::ErrorKind::InvalidData.into());
    }
    peer.write_all(id)
}

/// Asks rank 0 until it is there.
fn take(host: &str, port: u16, deadline: Instant) -> io::Result<[u8; ID_BYTES]> {
    loop {
        let answer = TcpStream::connect((host, port)).and_then(|mut first| {
            first.write_all(HELLO)?;
            let mut id = [0; ID_BYTES];
            first.read_exact(&mut id)?;
            Ok(id)
        });
        match answer {
            Err(_) if Instant::now() < deadline => sleep(PAUSE),
            answer => return answer,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_ranks_get_the_id_of_the_first() {
        // A port that was free a moment ago.
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let launch = |rank| Launch {
            rank,
            size: 4,
            local_rank: rank,
            address: ("127.0.0.1".to_owned(), port),
        };
        let id: [u8; ID_BYTES] = std::array::from_fn(|k| k as u8);
        std::thread::scope(|scope| {
            let others: Vec<_> = (1..4)
                .map(|rank| scope.spawn(move || share(&launch(rank), [0; ID_BYTES]).unwrap()))
                .collect();
            // Before rank 0 is there, and with a stranger among them.
            sleep(Duration::from_millis(100));
            let first = scope.spawn(move || share(&launch(0), id).unwrap());
            let _ = TcpStream::connect(("127.0.0.1", port))
                .and_then(|mut stranger| stranger.write_all(b"GET / HTTP/1.1\r\n"));
            assert_eq!(first.join().unwrap(), id);
            for other in others {
                assert_eq!(other.join().unwrap(), id);
            }
        });
    }

    #[test]
    fn a_missing_rank_is_an_error_and_not_a_wait_for_ever() {
        let past = Instant::now();
        assert_eq!(give(0, 1, &[0; ID_BYTES], past).unwrap_err().kind(), io::ErrorKind::TimedOut);
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        assert!(take("127.0.0.1", port, past).is_err());
    }
}
