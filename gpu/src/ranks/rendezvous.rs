//! How ranks find each other: rank 0 listens, and all others connect to it.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream, ToSocketAddrs};
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
/// How long an attempt to connect may take, and how long rank 0 waits for the first bytes of a connection.
const HELLO_TIMEOUT: Duration = Duration::from_secs(5);
/// Longer waits are reported.
const PATIENCE: Duration = Duration::from_secs(2);

/// Why rank 0 refuses a rank. It answers 0 or an index in this list plus one.
const REASONS: [&str; 3] = [
    "its number of ranks differs",
    "another rank has the same number",
    "it was started with other arguments, files or devices",
];

/// Waits until all ranks are there, with the same fingerprint. Returns the connections: on rank 0
/// to ranks 1, 2, ..., on the others to rank 0. After two seconds, `waiting` is called once with the
/// ranks that are missing, in words.
///
/// # Errors
/// A rank is missing after two minutes, or does not belong to the others.
pub fn rendezvous(
    environment: &Environment,
    fingerprint: &Fingerprint,
    waiting: impl FnOnce(&str),
) -> Result<Vec<TcpStream>, RanksError> {
    rendezvous_with(environment, fingerprint, Wait::new(PATIENCE, TIMEOUT, waiting))
}

/// A wait for other ranks, which is reported once if it is long.
struct Wait<F> {
    report_at: Instant,
    deadline: Instant,
    report: Option<F>,
}

impl<F: FnOnce(&str)> Wait<F> {
    fn new(patience: Duration, timeout: Duration, report: F) -> Self {
        let now = Instant::now();
        Self { report_at: now + patience, deadline: now + timeout, report: Some(report) }
    }

    /// Pauses, and reports for whom if it is time to; false after the deadline.
    fn pause(&mut self, whom: impl FnOnce() -> String) -> bool {
        let now = Instant::now();
        if now >= self.deadline {
            return false;
        }
        if now >= self.report_at {
            self.report(whom);
        }
        sleep(PAUSE);
        true
    }

    fn report(&mut self, whom: impl FnOnce() -> String) {
        if let Some(report) = self.report.take() {
            report(&whom());
        }
    }
}

fn rendezvous_with(
    environment: &Environment,
    fingerprint: &Fingerprint,
    mut wait: Wait<impl FnOnce(&str)>,
) -> Result<Vec<TcpStream>, RanksError> {
    if environment.size == 1 {
        return Ok(Vec::new());
    }
    if environment.rank == 0 {
        return receive(environment, fingerprint, wait);
    }
    let (mut stream, answer) = connect(environment, fingerprint, &mut wait)
        .map_err(failed(environment, "cannot reach rank 0 at"))?;
    if answer > 0 {
        let why = REASONS.get(usize::from(answer) - 1).unwrap_or(&"rank 0 refused it");
        return Err(RanksError::Refused { rank: environment.rank, why });
    }
    until_complete(&mut stream, wait)
        .map_err(failed(environment, "lost the connection to rank 0 at"))?;
    Ok(vec![stream])
}

/// Waits for the byte that rank 0 writes once all have connected.
fn until_complete(stream: &mut TcpStream, mut wait: Wait<impl FnOnce(&str)>) -> io::Result<()> {
    let patience = wait.report_at.saturating_duration_since(Instant::now());
    // A timeout of zero is none.
    stream.set_read_timeout(Some(patience.max(PAUSE)))?;
    let mut complete = [0];
    let in_time = stream.read_exact(&mut complete);
    stream.set_read_timeout(None)?;
    match in_time {
        Err(error)
            if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) =>
        {
            wait.report(|| "other ranks to connect to rank 0".to_owned());
            stream.read_exact(&mut complete)
        }
        in_time => in_time,
    }
}

fn failed(environment: &Environment, action: &'static str) -> impl FnOnce(io::Error) -> RanksError {
    let (host, port) = &environment.address;
    let (rank, address) = (environment.rank, format!("{host}:{port}"));
    move |source| RanksError::Rendezvous { rank, action, address, source }
}

/// "2 of 4 ranks" and "ranks 1, 3" for connections to ranks 1, 2, ..., of which two are missing.
fn missing(peers: &[Option<TcpStream>]) -> [String; 2] {
    let absent = |(peer, stream): (usize, &Option<TcpStream>)| stream.is_none().then_some(peer + 1);
    let ranks: Vec<String> =
        peers.iter().enumerate().filter_map(absent).map(|rank| rank.to_string()).collect();
    let noun = if ranks.len() == 1 { "rank" } else { "ranks" };
    let size = peers.len() + 1;
    [format!("{} of {size} ranks", ranks.len()), format!("{noun} {}", ranks.join(", "))]
}

/// Rank 0 waits for the others.
fn receive(
    environment: &Environment,
    fingerprint: &Fingerprint,
    mut wait: Wait<impl FnOnce(&str)>,
) -> Result<Vec<TcpStream>, RanksError> {
    let listener = TcpListener::bind(("0.0.0.0", environment.address.1))
        .and_then(|listener| listener.set_nonblocking(true).map(|()| listener))
        .map_err(failed(environment, "cannot listen at"))?;
    let mut peers: Vec<Option<TcpStream>> = (1..environment.size).map(|_| None).collect();
    while peers.iter().any(Option::is_none) {
        let mut stream = match listener.accept() {
            Ok((stream, _)) => stream,
            Err(error) if error.kind() != io::ErrorKind::WouldBlock => {
                return Err(failed(environment, "cannot listen at")(error));
            }
            Err(_) => {
                let to_connect = || {
                    let [count, ranks] = missing(&peers);
                    format!("{count} to connect ({ranks})")
                };
                if wait.pause(to_connect) {
                    continue;
                }
                let [count, ranks] = missing(&peers);
                let text = format!("{count} did not connect ({ranks})");
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

/// Connects to rank 0, with retries until the deadline, and returns the connection and its answer.
fn connect(
    environment: &Environment,
    fingerprint: &Fingerprint,
    wait: &mut Wait<impl FnOnce(&str)>,
) -> io::Result<(TcpStream, u8)> {
    let (host, port) = &environment.address;
    loop {
        let answer = dial(host, *port).and_then(|mut stream| {
            stream.set_nodelay(true)?;
            stream.write_all(HELLO)?;
            stream.write_all(&(environment.rank as u64).to_le_bytes())?;
            stream.write_all(&(environment.size as u64).to_le_bytes())?;
            stream.write_all(fingerprint)?;
            let mut answer = [0];
            stream.read_exact(&mut answer)?;
            Ok((stream, answer[0]))
        });
        if answer.is_ok() || !wait.pause(|| format!("rank 0 at {host}:{port}")) {
            return answer;
        }
    }
}

/// As [`TcpStream::connect`], but an attempt ends after [`HELLO_TIMEOUT`].
fn dial(host: &str, port: u16) -> io::Result<TcpStream> {
    let mut failure = io::Error::new(io::ErrorKind::NotFound, "the host has no address");
    for address in (host, port).to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, HELLO_TIMEOUT) {
            Ok(stream) => return Ok(stream),
            Err(error) => failure = error,
        }
    }
    Err(failure)
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    fn quiet(_: &str) {}

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
                    let mut peers = rendezvous(environment, &[7; 32], quiet).unwrap();
                    assert_eq!(peers.len(), 1);
                    peers[0].write_all(&[environment.rank as u8]).unwrap();
                });
            }
            // After the others, and with another program among them.
            sleep(Duration::from_millis(100));
            let first = scope.spawn(|| rendezvous(&all[0], &[7; 32], quiet).unwrap());
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
            let other =
                thread::spawn(move || rendezvous(&second, &fingerprint, quiet).unwrap_err());
            let errors = [rendezvous(&first, &[1; 32], quiet).unwrap_err(), other.join().unwrap()];
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
    fn a_wait_names_the_missing_ranks_and_ends() {
        let all = environments(4);
        let milliseconds = Duration::from_millis;
        // What a rank reports while it waits, and the error in the end.
        let wait = |environment: &Environment, patience, timeout| {
            let mut reports = Vec::new();
            let wait = Wait::new(patience, timeout, |whom: &str| reports.push(whom.to_owned()));
            let error = rendezvous_with(environment, &[0; 32], wait).unwrap_err();
            let RanksError::Rendezvous { source, .. } = error else { panic!("{error}") };
            (reports, source.to_string())
        };
        let port = all[0].address.1;
        let (reports, _) = wait(&all[1], milliseconds(0), milliseconds(100));
        assert_eq!(reports, [format!("rank 0 at 127.0.0.1:{port}")]);
        thread::scope(|scope| {
            let second = scope.spawn(|| wait(&all[2], milliseconds(100), milliseconds(5000)));
            let (reports, error) = wait(&all[0], milliseconds(500), milliseconds(1000));
            assert_eq!(reports, ["2 of 4 ranks to connect (ranks 1, 3)"]);
            assert_eq!(error, "2 of 4 ranks did not connect (ranks 1, 3)");
            assert_eq!(second.join().unwrap().0, ["other ranks to connect to rank 0"]);
        });
    }
}
