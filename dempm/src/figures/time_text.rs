//! Times in pictures.

use plot::minus;

/// A time (s) in hundredths of a second, or finer if needed.
pub(super) fn time_text(time: f64) -> String {
    let is_whole = |n: &i32| {
        let scaled = time * 10_f64.powi(*n);
        (scaled - scaled.round()).abs() < 1e-3
    };
    let decimals = (2..5).find(is_whole).unwrap_or(5) as usize;
    minus(&format!("{time:.decimals$}"))
}

#[cfg(test)]
mod tests {
    use super::time_text;

    #[test]
    fn times_show_what_tells_them_apart() {
        let texts = [0.0, 0.5, 0.01, 0.005, 1.0 / 3.0, -1.0].map(time_text);
        assert_eq!(texts, ["0.00", "0.50", "0.01", "0.005", "0.33333", "−1.00"]);
    }
}
