//! How ranks find each other: rank 0 listens at the address of the launch, and all others connect
//! to it and say who they are.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::{Launch, RanksError};

/// A hash of what ranks are about to do together.
pub type Fingerprint = [u8; 32];

/// First bytes of a connection, so that a stranger at the port is not taken for a rank.
const HELLO: &[u8; 8] = b"DEMPM 02";
/// How long ranks wait for each other: launchers may start them one after the other.
const PATIENCE: Duration = Duration::from_secs(120);
const PAUSE: Duration = Duration::from_millis(50);
/// How long rank 0 listens to who has connected.
const HEARING: Duration = Duration::from_secs(5);

/// What rank 0 answers: 0, or one more than the number of the reason in this list.
const REASONS: [&str; 3] = [
    "it counts another number of ranks",
    "a rank of this number is there already",
    "it was started with other arguments, files or devices",
];

/// Waits until all ranks are there, with the same fingerprint. Gives rank 0 its connections to
/// ranks 1, 2, ..., and each of the others the one to rank 0.
///
/// # Errors
/// If they do not meet within two minutes, or one does not belong to the others.
pub fn meet(launch: &Launch, fingerprint: &Fingerprint) -> Result<Vec<TcpStream>, RanksError> {
    meet_until(launch, fingerprint, Instant::now() + PATIENCE)
}

fn meet_until(
    launch: &Launch,
    fingerprint: &Fingerprint,
    deadline: Instant,
) -> Result<Vec<TcpStream>, RanksError> {
    if launch.size == 1 {
        return Ok(Vec::new());
    }
    if launch.rank == 0 {
        return receive(launch, fingerprint, deadline);
    }
    let (mut stream, answer) = introduce(launch, fingerprint, deadline)
        .map_err(failed(launch, "did not find rank 0 at"))?;
    if answer > 0 {
        let why = REASONS.get(usize::from(answer) - 1).unwrap_or(&"rank 0 refuses it");
        return Err(RanksError::Stranger { rank: launch.rank, why });
    }
    // Rank 0 says so once all have come.
    let mut complete = [0];
    stream.read_exact(&mut complete).map_err(failed(launch, "lost rank 0 at"))?;
    Ok(vec![stream])
}

fn failed(launch: &Launch, action: &'static str) -> impl FnOnce(io::Error) -> RanksError {
    let (host, port) = &launch.address;
    let (rank, address) = (launch.rank, format!("{host}:{port}"));
    move |source| RanksError::Meeting { rank, action, address, source }
}

/// Rank 0 waits for the others.
fn receive(
    launch: &Launch,
    fingerprint: &Fingerprint,
    deadline: Instant,
) -> Result<Vec<TcpStream>, RanksError> {
    let listener = TcpListener::bind(("0.0.0.0", launch.address.1))
        .and_then(|listener| listener.set_nonblocking(true).map(|()| listener))
        .map_err(failed(launch, "cannot listen at"))?;
    let mut peers: Vec<Option<TcpStream>> = (1..launch.size).map(|_| None).collect();
    while let Some(missing) = peers.iter().position(Option::is_none) {
        let mut stream = match listener.accept() {
            Ok((stream, _)) => stream,
            Err(error) if error.kind() != io::ErrorKind::WouldBlock => {
                return Err(failed(launch, "cannot listen at")(error));
            }
            Err(_) if Instant::now() < deadline => {
                sleep(PAUSE);
                continue;
            }
            Err(_) => {
                let text = format!("rank {} did not come", missing + 1);
                let late = io::Error::new(io::ErrorKind::TimedOut, text);
                return Err(failed(launch, "waited in vain at")(late));
            }
        };
        // Whoever does not speak as a rank does is no rank.
        let Ok((rank, size, theirs)) = hear(&mut stream) else { continue };
        let seat = rank.checked_sub(1).and_then(|seat| peers.get_mut(seat));
        let refusal = match &seat {
            _ if size != launch.size => Some(0),
            Some(None) if theirs != *fingerprint => Some(2),
            Some(None) => None,
            _ => Some(1),
        };
        let answer = refusal.map_or(0, |reason: u8| reason + 1);
        // One that is gone again is missed when it is needed.
        let _ = stream.write_all(&[answer]);
        match (seat, refusal) {
            (Some(seat), None) => *seat = Some(stream),
            (_, reason) => {
                let why = REASONS[usize::from(reason.unwrap_or(1))];
                return Err(RanksError::Stranger { rank, why });
            }
        }
    }
    let mut peers: Vec<TcpStream> = peers.into_iter().flatten().collect();
    for peer in &mut peers {
        peer.write_all(&[1]).map_err(failed(launch, "lost a rank at"))?;
    }
    Ok(peers)
}

/// Rank, number of ranks and fingerprint of who has connected.
fn hear(stream: &mut TcpStream) -> io::Result<(usize, usize, Fingerprint)> {
    stream.set_nonblocking(false)?;
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(HEARING))?;
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

/// Says who this rank is, again and again until rank 0 is there, and gives its answer.
fn introduce(
    launch: &Launch,
    fingerprint: &Fingerprint,
    deadline: Instant,
) -> io::Result<(TcpStream, u8)> {
    let (host, port) = &launch.address;
    loop {
        let answer = TcpStream::connect((host.as_str(), *port)).and_then(|mut stream| {
            stream.set_nodelay(true)?;
            stream.write_all(HELLO)?;
            stream.write_all(&(launch.rank as u64).to_le_bytes())?;
            stream.write_all(&(launch.size as u64).to_le_bytes())?;
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

    /// Ranks that meet at a port that was free a moment ago.
    fn launches(size: usize) -> Vec<Launch> {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let address = ("127.0.0.1".to_owned(), port);
        (0..size)
            .map(|rank| Launch { rank, size, local_rank: rank, address: address.clone() })
            .collect()
    }

    #[test]
    fn connections_are_in_the_order_of_ranks() {
        let all = launches(4);
        let port = all[0].address.1;
        thread::scope(|scope| {
            for launch in &all[1..] {
                scope.spawn(|| {
                    let mut peers = meet(launch, &[7; 32]).unwrap();
                    assert_eq!(peers.len(), 1);
                    peers[0].write_all(&[launch.rank as u8]).unwrap();
                });
            }
            // After the others have knocked, and with a stranger among them.
            sleep(Duration::from_millis(100));
            let first = scope.spawn(|| meet(&all[0], &[7; 32]).unwrap());
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
    fn who_does_not_belong_is_told_why() {
        let refused = |change: fn(&mut Launch), fingerprint: Fingerprint| {
            let [first, mut second] = launches(2).try_into().unwrap();
            change(&mut second);
            let other = thread::spawn(move || meet(&second, &fingerprint).unwrap_err());
            let errors = [meet(&first, &[1; 32]).unwrap_err(), other.join().unwrap()];
            errors.map(|error| error.to_string())
        };
        for error in refused(|_| {}, [2; 32]) {
            assert!(error.contains("rank 1") && error.contains("other arguments"), "{error}");
        }
        for error in refused(|launch| launch.size = 3, [1; 32]) {
            assert!(error.contains("rank 1") && error.contains("number of ranks"), "{error}");
        }
    }

    #[test]
    fn a_missing_rank_is_an_error_and_not_a_wait_for_ever() {
        for launch in launches(2) {
            let error = meet_until(&launch, &[0; 32], Instant::now()).unwrap_err();
            assert!(matches!(error, RanksError::Meeting { .. }), "{error}");
        }
    }
}
