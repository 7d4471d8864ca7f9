//! Disks that fail or are full: an ordinary error, and nothing lost.

use rand::RngExt;

use crate::campaign::{Attack, Finding, Promise, campaign};
use crate::jobs::Job;
use crate::kills::{has_strace, strace, writing_calls};
use crate::program::Program;

#[test]
fn failing_disks() {
    campaign("failing_disks", |attack| {
        let job = Job::ALL[attack.rng.random_range(0..3)];
        job.undisturbed();
        job.prepare(&attack.folder);
        if !has_strace() || attack.rng.random_ratio(1, 5) {
            let bytes = attack.rng.random_range(0..100_000);
            let limited = job.begin(&attack.folder).with_files_up_to(bytes);
            return continues(job, attack, &limited, &format!("files of at most {bytes} bytes"));
        }
        let calls = writing_calls(job);
        let (call, count) = &calls[attack.rng.random_range(0..calls.len())];
        let when = attack.rng.random_range(1..=*count);
        let error = ["ENOSPC", "EIO", "EDQUOT"][attack.rng.random_range(0..3)];
        // Once, or from then on.
        let on = ["", "+"][attack.rng.random_range(0..2)];
        let inject = format!("inject={call}:error={error}:when={when}{on}");
        let launcher = strace(call, &inject);
        let how = format!("{error} from {call} number {when}{on}");
        continues(job, attack, &job.begin(&attack.folder).launched_by(launcher), &how)
    });
}

/// Ends a job in trouble well, and then without trouble.
fn continues(job: Job, attack: &Attack, troubled: &Program, how: &str) -> Result<(), Finding> {
    let ended = troubled.run();
    ended
        .is_sound()
        .map_err(|Finding { promise, what }| Finding { promise, what: format!("{how}: {what}") })?;
    if ended.succeeded() && job.results(&attack.folder)? != *job.undisturbed() {
        return Promise::NothingLost
            .broken(ended.report(&format!("{how}: another result, and no error")));
    }
    if ended.succeeded() { Ok(()) } else { job.finish(&attack.folder, how) }
}
