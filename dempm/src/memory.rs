//! Memory of this machine.

/// Memory that new programs can have (bytes), where the system tells.
pub fn available() -> Option<f64> {
    bytes("/proc/meminfo", "MemAvailable:")
}

/// The most memory that this program has had so far (bytes), where the system tells.
pub fn peak() -> Option<f64> {
    bytes("/proc/self/status", "VmHWM:")
}

/// A line of the file, which is in kB.
fn bytes(file: &str, name: &str) -> Option<f64> {
    let text = std::fs::read_to_string(file).ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    let kilobytes: f64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(1024.0 * kilobytes)
}
