//! Lines of progress where no terminal shows a bar, as in the log of a batch system.

use std::io::{IsTerminal, stderr};
use std::time::{Duration, Instant};

use crate::terminal::is_quiet;

/// Time between lines unless [`VARIABLE`] says otherwise.
const INTERVAL: Duration = Duration::from_secs(30);
/// Seconds between lines, for logs that want more or fewer.
const VARIABLE: &str = "DEMPM_PROGRESS_SECONDS";

/// When a long computation writes a line of progress to the standard error stream: every 30 s, or
/// `DEMPM_PROGRESS_SECONDS`, and never on a terminal, which has a bar, or after `--quiet`.
#[derive(Clone, Debug)]
pub struct Heartbeat {
    /// `None`: no lines.
    interval: Option<Duration>,
    /// What is counted, such as "step".
    unit: &'static str,
    began: Instant,
    /// What was done then.
    first: u64,
    /// When the last line was written.
    told: Instant,
}

impl Heartbeat {
    /// Begins to count, `done` of which were done before.
    pub fn new(unit: &'static str, done: u64) -> Self {
        let is_silent = stderr().is_terminal() || is_quiet();
        let seconds = std::env::var(VARIABLE).ok().and_then(|text| text.parse().ok());
        let interval =
            seconds.and_then(|s| Duration::try_from_secs_f64(s).ok()).unwrap_or(INTERVAL);
        Self::at(Instant::now(), (!is_silent).then_some(interval), unit, done)
    }

    fn at(now: Instant, interval: Option<Duration>, unit: &'static str, done: u64) -> Self {
        Self { interval, unit, began: now, first: done, told: now }
    }

    /// The time between two lines; `None` if there are none.
    pub fn interval(&self) -> Option<Duration> {
        self.interval
    }

    /// `done` more were done before, by an earlier computation.
    pub fn skip(&mut self, done: u64) {
        self.first += done;
    }

    /// A line about `done` of `total` if one is due, with rate and time left.
    pub fn line(&mut self, done: u64, total: u64) -> Option<String> {
        let unit = self.unit;
        let Pace { percent, rate, left } = self.pace(done, total)?;
        let rate = short(rate);
        Some(format!("{unit} {done} of {total} ({percent:.0} %), {rate} {unit}s/s, {left}"))
    }

    /// How `done` of `total` goes on, if a line is due.
    pub fn pace(&mut self, done: u64, total: u64) -> Option<Pace> {
        self.pace_at(Instant::now(), done, total)
    }

    fn pace_at(&mut self, now: Instant, done: u64, total: u64) -> Option<Pace> {
        let interval = self.interval?;
        if now.duration_since(self.told) < interval {
            return None;
        }
        self.told = now;
        let elapsed = now.duration_since(self.began).as_secs_f64();
        let rate = done.saturating_sub(self.first) as f64 / elapsed;
        let left = match rate > 0.0 {
            true => format!("{} left", duration(total.saturating_sub(done) as f64 / rate)),
            false => "time left unknown".to_owned(),
        };
        Some(Pace { percent: 100.0 * done as f64 / total.max(1) as f64, rate, left })
    }
}

/// How a computation goes on.
#[derive(Clone, Debug, PartialEq)]
pub struct Pace {
    /// Share of what is done, %.
    pub percent: f64,
    /// What was done in a second since the beginning.
    pub rate: f64,
    /// The time left at this rate, in words.
    pub left: String,
}

/// A rate with two digits or more.
fn short(rate: f64) -> String {
    match rate {
        r if r >= 10.0 => format!("{r:.0}"),
        r if r >= 1.0 => format!("{r:.1}"),
        r => format!("{r:.2}"),
    }
}

/// A time (s) in seconds, minutes or hours.
pub fn duration(seconds: f64) -> String {
    let minutes = (seconds / 60.0).round() as u64;
    match seconds {
        s if s < 99.5 => format!("{s:.0} s"),
        _ if minutes < 60 => format!("{minutes} min"),
        _ => format!("{} h {:02} min", minutes / 60, minutes % 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run resumed at step 1000 that makes 100 steps a second: the rate counts from there.
    #[test]
    fn a_line_comes_every_interval_with_rate_and_time_left() {
        let start = Instant::now();
        let after = |seconds| start + Duration::from_secs(seconds);
        let mut beat = Heartbeat::at(start, Some(INTERVAL), "step", 1000);
        assert_eq!(beat.pace_at(after(29), 3900, 10_000), None);
        let pace = beat.pace_at(after(30), 4000, 10_000).unwrap();
        assert_eq!((pace.percent, pace.rate, &*pace.left), (40.0, 100.0, "60 s left"));
        assert_eq!(beat.pace_at(after(59), 6900, 10_000), None);
        assert_eq!(beat.pace_at(after(60), 7000, 10_000).unwrap().left, "30 s left");
        let stuck = beat.pace_at(after(90), 1000, 10_000).unwrap();
        assert_eq!((stuck.rate, &*stuck.left), (0.0, "time left unknown"));
        let mut none = Heartbeat::at(start, None, "step", 0);
        assert_eq!(none.pace_at(after(100), 1, 2), None);
    }

    #[test]
    fn a_line_names_what_is_counted() {
        let past = Instant::now() - Duration::from_secs(40);
        let mut beat = Heartbeat::at(past, Some(INTERVAL), "frame", 0);
        let line = beat.line(20, 40).unwrap();
        assert_eq!(line, "frame 20 of 40 (50 %), 0.50 frames/s, 40 s left");
    }

    #[test]
    fn durations_have_two_units_at_most() {
        let texts = [0.4, 99.0, 100.0, 3599.0, 7500.0].map(duration);
        assert_eq!(texts, ["0 s", "99 s", "2 min", "1 h 00 min", "2 h 05 min"]);
    }
}
