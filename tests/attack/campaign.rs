//! A budget of attacks: random numbers that can be drawn again, and a record of what was found.

use std::env;
use std::fmt::Display;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::{Duration, Instant};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Tests of programs, and those of readers together: shares of the budget, two at a time where there are
/// two cores.
const CAMPAIGNS: f64 = 7.0;
/// Tests of readers.
const READERS: f64 = 8.0;

/// A campaign with more findings than this ends early.
const MOST_FINDINGS: usize = 20;

/// What the programs promise whatever happens to them. A finding breaks one of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Promise {
    /// Every end is an ordinary one: no panic, no signal, a documented exit code.
    NoPanic,
    /// It takes no more memory than there is.
    Memory,
    /// It ends in time.
    NoHang,
    /// Ctrl-C ends it.
    Interruptible,
    /// Texts from files reach the terminal without control characters, but for colours.
    CleanText,
    /// An error says what it is about.
    NamedError,
    /// A damaged trajectory is refused by name, or read as the undamaged one.
    WholeTrajectory,
    /// A damaged checkpoint is refused by name, or continues as the undamaged one.
    WholeCheckpoint,
    /// A damaged cache entry changes no result.
    WholeCache,
    /// Killed at any moment, a job continues to the same result.
    Resumable,
    /// What finishes after an interruption leaves no files of it.
    Tidy,
    /// A failed write loses nothing that was there before.
    NothingLost,
    /// Work goes on without anybody to print to.
    PrintingIsNoWork,
}

/// Promises that are broken today: their findings are printed, and fail nothing.
const PENDING: &[Promise] = &[];

/// A broken promise, and how it was broken.
#[derive(Debug)]
pub struct Finding {
    pub promise: Promise,
    pub what: String,
}

impl Promise {
    /// What breaks this promise.
    pub fn broken<T>(self, what: impl Into<String>) -> Result<T, Finding> {
        Err(Finding { promise: self, what: what.into() })
    }
}

/// One attack: its random numbers, and an empty folder.
pub struct Attack {
    pub rng: ChaCha8Rng,
    pub folder: PathBuf,
}

/// The value of an environment variable.
///
/// # Panics
/// If it has none that can be read.
fn setting<T: FromStr>(name: &str) -> Option<T> {
    let text = env::var(name).ok()?;
    Some(text.parse().unwrap_or_else(|_| panic!("{name}={text}: not a number")))
}

/// Where attacks happen, and where those that found something stay: in memory if possible, since
/// programs that write checkpoints all the time would else wait for the disk.
pub fn workplace() -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let mut hasher = DefaultHasher::new();
    target.hash(&mut hasher);
    let memory = Path::new("/dev/shm").join(format!("dempm-attack-{:x}", hasher.finish()));
    if fs::create_dir_all(&memory).is_ok() { memory } else { target.join("attack") }
}

/// Attacks programs until the test's share of the time is over.
///
/// # Panics
/// If a promise was broken that is kept today.
pub fn campaign(name: &str, attack: impl Fn(&mut Attack) -> Result<(), Finding>) {
    attack_for(1.0 / CAMPAIGNS, name, attack);
}

/// Attacks readers within this process until the test's share of the time is over.
///
/// # Panics
/// As [`campaign`].
pub fn fuzz(name: &str, attack: impl Fn(&mut Attack) -> Result<(), Finding>) {
    attack_for(1.0 / (CAMPAIGNS * READERS), name, attack);
}

fn attack_for(share: f64, name: &str, attack: impl Fn(&mut Attack) -> Result<(), Finding>) {
    let seed: u64 = setting("DEMPM_ATTACK_SEED").unwrap_or(1);
    let seconds: f64 = setting("DEMPM_ATTACK_SECONDS").unwrap_or(60.0);
    let only: Option<u64> = setting("DEMPM_ATTACK_ONLY");
    let cores = std::thread::available_parallelism().map_or(1.0, |cores| cores.get() as f64);
    let share = Duration::from_secs_f64(seconds * cores.min(2.0) * share);

    let start = Instant::now();
    let mut attacks = 0;
    let mut known = 0;
    let mut news = Vec::new();
    for number in only.map_or(0..u64::MAX, |number| number..number + 1) {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(number);
        let folder = workplace().join(format!("{name}-{seed}-{number}"));
        empty(&folder);
        let result = attack(&mut Attack { rng, folder: folder.clone() });
        attacks += 1;
        let is_known = matches!(&result, Err(finding) if PENDING.contains(&finding.promise));
        if let Err(Finding { promise, what }) = &result {
            let pending = if is_known { " (known)" } else { "" };
            println!(
                "{name} {number}: {promise:?}{pending}: {what}\n  \
                 again: DEMPM_ATTACK_SEED={seed} DEMPM_ATTACK_ONLY={number} \
                 cargo test --release --test attack {name}"
            );
        }
        if result.is_err() && !is_known {
            println!("  left in {}", folder.display());
            news.push(number);
        } else {
            known += u32::from(is_known);
            fs::remove_dir_all(&folder).expect("the folder of an attack can be removed");
        }
        if start.elapsed() > share || news.len() >= MOST_FINDINGS {
            break;
        }
    }
    println!(
        "{name}: {attacks} attacks with seed {seed} in {:.0} s, {} new findings, {known} known",
        start.elapsed().as_secs_f64(),
        news.len()
    );
    assert!(news.is_empty(), "{name}: promises broken by the attacks {news:?}, see above");
}

/// Makes a folder with nothing in it.
pub fn empty(folder: &Path) {
    let failed = |error: &dyn Display| panic!("{}: {error}", folder.display());
    if folder.exists() {
        fs::remove_dir_all(folder).unwrap_or_else(|error| failed(&error));
    }
    fs::create_dir_all(folder).unwrap_or_else(|error| failed(&error));
}
