//! Kills without warning, by the clock and at every system call that writes.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::sync::OnceLock;
use std::thread::sleep;
use std::time::Duration;

use rand::RngExt;

use crate::campaign::{Attack, campaign, empty, workplace};
use crate::jobs::Job;
use crate::program::signal;

#[test]
fn kills() {
    campaign("kills", |attack| {
        let job = Job::ALL[attack.rng.random_range(0..3)];
        job.undisturbed();
        job.prepare(&attack.folder);
        let kills = attack.rng.random_range(1..=3);
        let mut how = Vec::new();
        for k in 0..kills {
            let by_clock = !has_strace() || attack.rng.random_ratio(1, 4);
            how.push(if by_clock {
                at_a_moment(job, k, attack)
            } else {
                at_a_call(job, k, attack)
            });
        }
        job.finish(&attack.folder, &format!("{job:?} killed {}", how.join(", ")))
    });
}

fn command(job: Job, kill: usize, folder: &Path) -> crate::program::Program {
    if kill == 0 { job.begin(folder) } else { job.resume(folder) }
}

fn at_a_moment(job: Job, kill: usize, attack: &mut Attack) -> String {
    let time = Duration::from_micros(attack.rng.random_range(0..300_000));
    let mut child = command(job, kill, &attack.folder).command().spawn().unwrap();
    sleep(time);
    signal(&child, libc::SIGKILL);
    child.wait().unwrap();
    format!("after {} ms", time.as_millis())
}

fn at_a_call(job: Job, kill: usize, attack: &mut Attack) -> String {
    let calls = writing_calls(job);
    let (call, count) = &calls[attack.rng.random_range(0..calls.len())];
    let when = attack.rng.random_range(1..=*count);
    let inject = format!("inject={call}:signal=KILL:when={when}");
    let killed = command(job, kill, &attack.folder).launched_by(strace(call, &inject)).run();
    // A resumed job may end before that call.
    drop(killed);
    format!("at {call} number {when}")
}

/// Whether `strace` is there and may trace.
pub fn has_strace() -> bool {
    static ANSWER: OnceLock<bool> = OnceLock::new();
    *ANSWER.get_or_init(|| {
        let works = Command::new("strace")
            .args(["-f", "-qq", "-o", "/dev/null", "-e", "inject=fsync:error=EIO", "true"])
            .status()
            .is_ok_and(|status| status.success());
        if !works {
            println!("skipped: system calls are not attacked, strace is missing or may not trace");
        }
        works
    })
}

/// `strace` on these system calls, with another option.
pub fn strace(calls: &str, option: &str) -> Vec<String> {
    let trace = format!("trace={calls}");
    let words =
        ["strace", "-f", "-qq", "--seccomp-bpf", "-o", "calls.txt", "-e", &trace, "-e", option];
    words.map(str::to_owned).to_vec()
}

/// System calls that change files.
const WRITING: &str = "write,pwrite64,writev,pwritev,copy_file_range,sendfile,ftruncate,fallocate,fsync,\
                       fdatasync,rename,renameat,renameat2,link,linkat,unlink,unlinkat,mkdir,mkdirat,flock";

/// The writing calls of an undisturbed job, and how often the busiest thread makes each.
pub fn writing_calls(job: Job) -> &'static [(String, u32)] {
    static KNOWN: [OnceLock<Vec<(String, u32)>>; 3] = [const { OnceLock::new() }; 3];
    KNOWN[job as usize].get_or_init(|| {
        let folder = workplace().join(format!("calls-{job:?}"));
        empty(&folder);
        job.prepare(&folder);
        let launcher = strace(WRITING, "signal=none");
        let ended = job.begin(&folder).launched_by(launcher).run();
        assert!(ended.succeeded(), "{}", ended.report("a traced job"));
        count(&fs::read_to_string(folder.join("calls.txt")).unwrap())
    })
}

/// Counts lines such as `4711 write(3, ...`.
fn count(log: &str) -> Vec<(String, u32)> {
    let mut threads = std::collections::BTreeMap::<(&str, &str), u32>::new();
    for line in log.lines() {
        let Some((thread, rest)) = line.split_once(' ') else { continue };
        let Some((call, _)) = rest.trim_start().split_once('(') else { continue };
        if call.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            *threads.entry((thread, call)).or_default() += 1;
        }
    }
    let mut most = std::collections::BTreeMap::<&str, u32>::new();
    for ((_, call), count) in threads {
        let most = most.entry(call).or_default();
        *most = count.max(*most);
    }
    most.into_iter().map(|(call, count)| (call.to_owned(), count)).collect()
}
