//! The processor, its load, and the time of processes, from the operating system.

use std::fs;

/// Name of the processor; `cpu` if unknown.
pub fn processor() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let name = line.and_then(|line| line.split_once(':')).map(|(_, name)| name.trim());
    name.unwrap_or("cpu").to_owned()
}

/// Processor time of a process so far, s; `None` where `/proc` is missing.
pub fn processor_time(process: u32) -> Option<f64> {
    /// Ticks per second; fixed in the interface of Linux.
    const TICKS: f64 = 100.0;
    let text = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name, in brackets, may contain spaces; user and system time are 12th and 13th after it.
    let fields: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |place: usize| fields.get(place)?.parse::<f64>().ok();
    Some((ticks(11)? + ticks(12)?) / TICKS)
}

/// Load average over a minute per core; `None` where `/proc` is missing.
pub fn load_per_core() -> Option<f64> {
    let text = fs::read_to_string("/proc/loadavg").ok()?;
    let load: f64 = text.split_whitespace().next()?.parse().ok()?;
    let cores = std::thread::available_parallelism().ok()?;
    Some(load / cores.get() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn this_process_has_used_the_processor() {
        let before = processor_time(std::process::id()).unwrap();
        let start = std::time::Instant::now();
        while start.elapsed().as_secs_f64() < 0.2 {}
        let spent = processor_time(std::process::id()).unwrap() - before;
        // Other tests run in this process too.
        assert!(spent > 0.01 && spent.is_finite(), "{spent}");
        assert!(load_per_core().unwrap() >= 0.0);
    }
}
