//! Numbers for people.

/// Three significant digits; exponents below 0.001 and from 100 000 on. Empty if not finite.
pub fn number(value: f64) -> String {
    let size = value.abs();
    match size {
        _ if !value.is_finite() => String::new(),
        0.0 => "0".to_owned(),
        _ if !(1e-3..1e5).contains(&size) => format!("{value:.1e}"),
        _ => {
            let decimals = (2 - size.log10().floor() as i32).max(0) as usize;
            trimmed(format!("{value:.decimals$}"))
        }
    }
}

/// Without zeros at the end of the decimals.
fn trimmed(number: String) -> String {
    if number.contains('.') {
        number.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        number
    }
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, 3.0, 0.0625, 2.345, 123.4, 1.23e-6, 921_600.0, f64::NAN].map(number);
        assert_eq!(texts, ["0", "3", "0.0625", "2.35", "123", "1.2e-6", "9.2e5", ""]);
    }
}
