//! Numbers, durations and titles as text.

pub use plot::number;

/// A fraction as a percentage.
pub fn percent(fraction: f64) -> String {
    format!("{} %", number(100.0 * fraction))
}

/// A duration (s) in seconds, minutes or hours. Empty if it is not finite.
pub fn seconds(value: f64) -> String {
    match value {
        _ if !value.is_finite() => String::new(),
        v if v < 1.0 => format!("{v:.2} s"),
        v if v < 10.0 => format!("{v:.1} s"),
        v if v < 600.0 => format!("{v:.0} s"),
        v if v < 36_000.0 => format!("{:.0} min", v / 60.0),
        v => format!("{:.1} h", v / 3600.0),
    }
}

/// A length (m) in metres, centimetres or millimetres. Empty if it is not finite.
pub fn length(value: f64) -> String {
    match value.abs() {
        size if !size.is_finite() => String::new(),
        size if size < 0.01 => format!("{} mm", rounded(1e3 * value)),
        size if size < 1.0 => format!("{} cm", rounded(1e2 * value)),
        _ => format!("{} m", rounded(value)),
    }
}

/// Two significant digits.
fn rounded(value: f64) -> String {
    let digits = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    let decimals = (1 - digits).max(0) as usize;
    format!("{value:.decimals$}")
}

/// The letters and digits of a title in lower case, with hyphens between words: for addresses and
/// file names.
pub fn slug(title: &str) -> String {
    let plain = title.to_lowercase().replace(|c: char| !c.is_ascii_alphanumeric(), "-");
    let words: Vec<&str> = plain.split('-').filter(|word| !word.is_empty()).collect();
    words.join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantities_are_short() {
        assert_eq!([0.25, 42.0, 3000.0].map(seconds), ["0.25 s", "42 s", "50 min"]);
        assert_eq!(
            [0.0, 0.00442, 0.0234, 1.38].map(length),
            ["0.0 mm", "4.4 mm", "2.3 cm", "1.4 m"]
        );
        assert_eq!(percent(0.05), "5 %");
    }

    #[test]
    fn titles_become_names_of_files() {
        assert_eq!(slug("Speed against accuracy: mu(I), 1 m"), "speed-against-accuracy-mu-i-1-m");
    }
}
