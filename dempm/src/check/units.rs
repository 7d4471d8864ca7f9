//! Quantities as people write them.

/// A quantity with three or four digits and an SI prefix, such as `62.5 mm`.
pub fn quantity(value: f64, unit: &str) -> String {
    const PREFIXES: [(f64, &str); 6] =
        [(1.0e9, "G"), (1.0e6, "M"), (1.0e3, "k"), (1.0, ""), (1.0e-3, "m"), (1.0e-6, "µ")];
    // Large prefixes are used for pressures only, not for lengths and times.
    let usable = |scale: f64| unit == "Pa" || scale <= 1.0;
    let fits = PREFIXES.iter().find(|(scale, _)| usable(*scale) && value >= 0.9995 * scale);
    let (scale, prefix) = match fits {
        Some(&fits) => fits,
        None if value == 0.0 => (1.0, ""),
        None => return format!("{value:.2e} {unit}"),
    };
    let digits = match value / scale {
        x if x < 10.0 => 2,
        x if x < 100.0 => 1,
        _ => 0,
    };
    let number = format!("{:.digits$}", value / scale);
    let number = if number.contains('.') {
        number.trim_end_matches('0').trim_end_matches('.')
    } else {
        &number
    };
    format!("{number} {prefix}{unit}")
}

/// A whole number with separated thousands, such as `921 600`.
pub(super) fn grouped(number: f64) -> String {
    let digits = format!("{number:.0}");
    let mut text = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}

/// A size of memory or files.
pub fn bytes(number: f64) -> String {
    match number {
        n if n < 1.0e6 => format!("{:.0} kB", n / 1.0e3),
        n if n < 1.0e9 => format!("{:.0} MB", n / 1.0e6),
        n => format!("{:.1} GB", n / 1.0e9),
    }
}

/// A duration from seconds to days.
pub fn duration(seconds: f64) -> String {
    match seconds {
        s if s < 1.0 => "under a second".into(),
        s if s < 100.0 => format!("{s:.0} s"),
        s if s < 6000.0 => format!("{:.0} min", s / 60.0),
        s if s < 100.0 * 3600.0 => format!("{:.1} h", s / 3600.0),
        s => format!("{:.0} days", s / 86400.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_written_for_people() {
        assert_eq!(quantity(0.0625, "m"), "62.5 mm");
        assert_eq!(quantity(1.0e-4, "s"), "100 µs");
        assert_eq!(quantity(65_512.0, "Pa"), "65.5 kPa");
        assert_eq!(quantity(3.0, "m"), "3 m");
        assert_eq!(quantity(120.0, "s"), "120 s");
        assert_eq!(quantity(0.0, "Pa"), "0 Pa");
        assert_eq!(grouped(921_600.0), "921 600");
        assert_eq!((bytes(9.3e7), duration(2488.0)), ("93 MB".into(), "41 min".into()));
    }
}
