//! Times in the headers of files.

use jiff::Timestamp;

/// The present time in UTC to the second, as ISO 8601: `2026-11-21T02:20:54Z`.
pub fn utc_now() -> String {
    iso_8601(Timestamp::now())
}

fn iso_8601(time: Timestamp) -> String {
    time.strftime("%Y-%m-%dT%H:%M:%SZ").to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_dates() {
        let text = |seconds| iso_8601(Timestamp::from_second(seconds).unwrap());
        assert_eq!(text(0), "1970-01-01T00:00:00Z");
        assert_eq!(text(951_782_400), "2000-02-29T00:00:00Z");
        assert_eq!(text(1_795_227_654), "2026-11-21T02:20:54Z");
        assert_eq!(text(4_107_542_399), "2100-02-28T23:59:59Z");
    }
}
