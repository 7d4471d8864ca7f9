//! How ranks find each other: rank 0 listens, and all others connect to it.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::environment::Environment;
use super::error::RanksError;

/// A hash of the work that ranks are about to do together.
pub type Fingerprint = [u8; 32];

/// First bytes from a rank, which tell it from other programs that connect to the port.
const HELLO: &[u8; 8] = b"DEMPM 02";
/// How long ranks wait for each other: some launchers start them one by one.
const TIMEOUT: Duration = Duration::from_secs(120);
/// Between attempts to connect.
const PAUSE: Duration = Duration::from_millis(50);
/// How long rank 0 waits for the first bytes of a connection.
const HELLO_TIMEOUT: Duration = Duration::from_secs(5);

/// Why rank 0 refuses a rank. It answers 0 or an index in this list plus one.
const REASONS: [&str; 3] = [
    "its number of ranks differs",
    "another rank has the same number",
    "it was started with other arguments, files or devices",
];

/// Waits until all ranks are there, with the same fingerprint. Returns the connections: on rank 0
/// to ranks 1, 2, ..., on the others to rank 0.
///
/// # Errors
/// A rank is missing after two minutes, or does not belong to the others.
pub fn rendezvous(
    environment: &Environment,
    fingerprint: &Fingerprint,
) -> Result<Vec<TcpStream>, RanksError> {
    rendezvous_until(environment, fingerprint, Instant::now() + TIMEOUT)
}

fn rendezvous_until(
    environment: &Environment,
    fingerprint: &Fingerprint,
    deadline: Instant,
) -> Result<Vec<TcpStream>, RanksError> {
    if environment.size == 1 {
        return Ok(Vec::new());
    }
    if environment.rank == 0 {
        return receive(environment, fingerprint, deadline);
    }
    let (mut stream, answer) = connect(environment, fingerprint, deadline)
        .map_err(failed(environment, "cannot reach rank 0 at"))?;
    if answer > 0 {
        let why = REASONS.get(usize::from(answer) - 1).unwrap_or(&"rank 0 refused it");
        return Err(RanksError::Refused { rank: environment.rank, why });
    }
    // Rank 0 writes this byte once all have connected.
    let mut complete = [0];
    stream
        .read_exact(&mut complete)
        .map_err(failed(environment, "lost the connection to rank 0 at"))?;
    Ok(vec![stream])
}

fn failed(environment: &Environment, action: &'static str) -> impl FnOnce(io::Error) -> RanksError {
    let (host, port) = &environment.address;
    let (rank, address) = (environment.rank, format!("{host}:{port}"));
    move |source| RanksError::Rendezvous { rank, action, address, source }
}

/// Rank 0 waits for the others.
fn receive(
    environment: &Environment,
    fingerprint: &Fingerprint,
    deadline: Instant,
) -> Result<Vec<TcpStream>, RanksError> {
    let listener = TcpListener::bind(("0.0.0.0", environment.address.1))
        .and_then(|listener| listener.set_nonblocking(true).map(|()| listener))
        .map_err(failed(environment, "cannot listen at"))?;
    let mut peers: Vec<Option<TcpStream>> = (1..environment.size).map(|_| None).collect();
    while let Some(missing) = peers.iter().position(Option::is_none) {
        let mut stream = match listener.accept() {
            Ok((stream, _)) => stream,
            Err(error) if error.kind() != io::ErrorKind::WouldBlock => {
                return Err(failed(environment, "cannot listen at")(error));
            }
            Err(_) if Instant::now() < deadline => {
                sleep(PAUSE);
                continue;
            }
            Err(_) => {
                let text = format!("rank {} did not connect", missing + 1);
                let late = io::Error::new(io::ErrorKind::TimedOut, text);
                return Err(failed(environment, "gave up waiting at")(late));
            }
        };
        // Another program.
        let Ok((rank, size, theirs)) = read_hello(&mut stream) else { continue };
        let seat = rank.checked_sub(1).and_then(|seat| peers.get_mut(seat));
        let refusal = match &seat {
            _ if size != environment.size => Some(0),
            Some(None) if theirs != *fingerprint => Some(2),
            Some(None) => None,
            _ => Some(1),
        };
        let answer = refusal.map_or(0, |reason: u8| reason + 1);
        // A rank that is gone again is noticed later.
        let _ = stream.write_all(&[answer]);
        match (seat, refusal) {
            (Some(seat), None) => *seat = Some(stream),
            (_, reason) => {
                let why = REASONS[usize::from(reason.unwrap_or(1))];
                return Err(RanksError::Refused { rank, why });
            }
        }
    }
    let mut peers: Vec<TcpStream> = peers.into_iter().flatten().collect();
    for peer in &mut peers {
        peer.write_all(&[1]).map_err(failed(environment, "lost the connection to a rank at"))?;
    }
    Ok(peers)
}

/// Rank, number of ranks and fingerprint of a rank that has connected.
fn read_hello(stream: &mut TcpStream) -> io::Result<(usize, usize, Fingerprint)> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(HELLO_TIMEOUT))?;
    let (mut hello, mut fingerprint) = ([0; HELLO.len()], Fingerprint::default());
    let mut numbers = [[0; 8]; 2];
    stream.read_exact(&mut hello)?;
    if hello != *HELLO {
        return Err(io::ErrorKind::InvalidData.into());
    }
    stream.read_exact(numbers.as_flattened_mut())?;
    stream.read_exact(&mut fingerprint)?;
    stream.set_read_timeout(None)?;
    let [rank, size] = numbers.map(|bytes| u64::from_le_bytes(bytes) as usize);
    Ok((rank, size, fingerprint))
}

/// Connects to rank 0, with retries until `deadline`, and returns the connection and its answer.
fn connect(
    environment: &Environment,
    fingerprint: &Fingerprint,
    deadline: Instant,
) -> io::Result<(TcpStream, u8)> {
    let (host, port) = &environment.address;
    loop {
        let answer = TcpStream::connect((host.as_str(), *port)).and_then(|mut stream| {
            stream.set_nodelay(true)?;
            stream.write_all(HELLO)?;
            stream.write_all(&(environment.rank as u64).to_le_bytes())?;
            stream.write_all(&(environment.size as u64).to_le_bytes())?;
            stream.write_all(fingerprint)?;
            let mut answer = [0];
            stream.read_exact(&mut answer)?;
            Ok((stream, answer[0]))
        });
        match answer {
            Err(_) if Instant::now() < deadline => sleep(PAUSE),
            answer => return answer,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    /// Ranks at a port that was free a moment ago.
    fn environments(size: usize) -> Vec<Environment> {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let address = ("127.0.0.1".to_owned(), port);
        (0..size)
            .map(|rank| Environment { rank, size, local_rank: rank, address: address.clone() })
            .collect()
    }

    #[test]
    fn connections_are_in_the_order_of_ranks() {
        let all = environments(4);
        let port = all[0].address.1;
        thread::scope(|scope| {
            for environment in &all[1..] {
                scope.spawn(|| {
                    let mut peers = rendezvous(environment, &[7; 32]).unwrap();
                    assert_eq!(peers.len(), 1);
                    peers[0].write_all(&[environment.rank as u8]).unwrap();
                });
            }
            // After the others, and with another program among them.
            sleep(Duration::from_millis(100));
            let first = scope.spawn(|| rendezvous(&all[0], &[7; 32]).unwrap());
            let _ = TcpStream::connect(("127.0.0.1", port))
                .and_then(|mut stranger| stranger.write_all(b"GET / HTTP/1.1\r\n"));
            for (peer, stream) in first.join().unwrap().iter_mut().enumerate() {
                let mut rank = [0];
                stream.read_exact(&mut rank).unwrap();
                assert_eq!(usize::from(rank[0]), peer + 1);
            }
        });
    }

    #[test]
    fn a_refused_rank_is_told_why() {
        let refused = |change: fn(&mut Environment), fingerprint: Fingerprint| {
            let [first, mut second] = environments(2).try_into().unwrap();
            change(&mut second);
            let other = thread::spawn(move || rendezvous(&second, &fingerprint).unwrap_err());
            let errors = [rendezvous(&first, &[1; 32]).unwrap_err(), other.join().unwrap()];
            errors.map(|error| error.to_string())
        };
        for error in refused(|_| {}, [2; 32]) {
            assert!(error.contains("rank 1") && error.contains("other arguments"), "{error}");
        }
        for error in refused(|environment| environment.size = 3, [1; 32]) {
            assert!(error.contains("rank 1") && error.contains("number of ranks"), "{error}");
        }
    }

    #[test]
    fn waiting_for_a_missing_rank_ends() {
        for environment in environments(2) {
            let error = rendezvous_until(&environment, &[0; 32], Instant::now()).unwrap_err();
            assert!(matches!(error, RanksError::Rendezvous { .. }), "{error}");
        }
    }
}
