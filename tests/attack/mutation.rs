//! Random changes of bytes and of texts.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;

/// Numbers that programs forget: no numbers, far too large or small ones, edges of whole numbers.
const NUMBERS: [&str; 20] = [
    "nan",
    "inf",
    "-inf",
    "1e300",
    "-1e300",
    "1e-300",
    "0",
    "-0.0",
    "-1",
    "1",
    "2",
    "0.5",
    "1e6",
    "1e9",
    "4294967296",
    "9223372036854775807",
    "9223372036854775808",
    "18446744073709551616",
    "-9223372036854775808",
    "1000000000000000000000000000000",
];

/// Values of every type of TOML; the empty one stands for deep nesting.
const VALUES: [&str; 14] = [
    "true",
    "\"text\"",
    "\"\"",
    "[]",
    "[1.0]",
    "[0.25, 0.25]",
    "[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]",
    "[\"text\", 1.5]",
    "{}",
    "{ left = 0.3, right = \"stick\" }",
    "{ step = [0.0] }",
    "1979-05-27",
    "1979-05-27T07:32:00Z",
    "",
];

/// Characters that mean something to TOML, to CSV or to a terminal.
const CHARACTERS: [&str; 20] = [
    "[",
    "]",
    "{",
    "}",
    "\"",
    "'",
    "=",
    ",",
    ".",
    "#",
    "\n",
    "\r",
    "\0",
    "\u{1b}[2J",
    "\u{7f}",
    "\u{9b}31m",
    "\u{202e}",
    "\u{feff}",
    "ü",
    "\\",
];

/// A stretch of a file, short ones more often; empty only if the file is.
fn stretch(length: usize, rng: &mut ChaCha8Rng) -> std::ops::Range<usize> {
    if length == 0 {
        return 0..0;
    }
    let start = rng.random_range(0..length);
    let most = 1 << rng.random_range(0..12);
    start..(start + rng.random_range(1..=most)).min(length)
}

/// Damages a file, and says how.
pub fn damage(bytes: &mut Vec<u8>, rng: &mut ChaCha8Rng) -> String {
    let kind = rng.random_range(0..16);
    let place = stretch(bytes.len(), rng);
    let other = stretch(bytes.len(), rng);
    let Some(&first) = bytes.get(place.start) else { return "left empty".to_owned() };
    match kind {
        // What disks and memories do.
        0..6 => {
            let bit = rng.random_range(0..8);
            bytes[place.start] = first ^ (1 << bit);
            format!("flipped bit {bit} of byte {}", place.start)
        }
        6 | 7 => {
            bytes[place.clone()].fill(0);
            format!("zeroed bytes {place:?}")
        }
        8 => {
            bytes[place.clone()].fill(0xff);
            format!("filled bytes {place:?} with ones")
        }
        9 => {
            bytes.truncate(place.start);
            format!("cut at byte {}", place.start)
        }
        10 => {
            let copy = bytes[other.clone()].to_vec();
            bytes.splice(place.start..place.start, copy);
            format!("inserted bytes {other:?} at {}", place.start)
        }
        11 => {
            let copy = bytes[other.clone()].to_vec();
            let end = (place.start + copy.len()).min(bytes.len());
            bytes[place.start..end].copy_from_slice(&copy[..end - place.start]);
            format!("copied bytes {other:?} over those at {}", place.start)
        }
        12 => {
            let noise: Vec<u8> = place.clone().map(|_| rng.random()).collect();
            bytes.splice(place.start..place.start, noise);
            format!("inserted {} random bytes at {}", place.len(), place.start)
        }
        13 => {
            bytes.drain(place.clone());
            format!("removed bytes {place:?}")
        }
        // What a length or a number in the file may become.
        14 => {
            let value =
                [0, 1, u64::MAX, 1 << 31, 1 << 40, f64::NAN.to_bits()][rng.random_range(0..6)];
            let end = (place.start + 8).min(bytes.len());
            bytes[place.start..end].copy_from_slice(&value.to_le_bytes()[..end - place.start]);
            format!("wrote {value:#x} at byte {}", place.start)
        }
        _ => {
            bytes.extend(place.clone().map(|_| rng.random::<u8>()));
            format!("appended {} random bytes", place.len())
        }
    }
}

/// A text with one to three changes; sometimes no longer UTF-8.
pub fn mutate(text: &str, rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut text = text.to_owned();
    for _ in 0..rng.random_range(1..=3) {
        text = mutate_once(&text, rng);
    }
    let mut bytes = text.into_bytes();
    if rng.random_ratio(1, 20) {
        damage(&mut bytes, rng);
    }
    bytes
}

fn mutate_once(text: &str, rng: &mut ChaCha8Rng) -> String {
    let kind = rng.random_range(0..14);
    if kind < 6 {
        // A number in place of another.
        let numbers = numbers(text);
        if numbers.is_empty() {
            return text.to_owned();
        }
        let place = numbers[rng.random_range(0..numbers.len())].clone();
        let number = NUMBERS[rng.random_range(0..NUMBERS.len())];
        return format!("{}{number}{}", &text[..place.start], &text[place.end..]);
    }
    if kind < 9 {
        // A character more, or one less.
        let places: Vec<usize> = text.char_indices().map(|(place, _)| place).collect();
        if places.is_empty() {
            return text.to_owned();
        }
        let k = rng.random_range(0..places.len());
        let end =
            if kind == 8 { places.get(k + 1).copied().unwrap_or(text.len()) } else { places[k] };
        let more = if kind == 8 { "" } else { CHARACTERS[rng.random_range(0..CHARACTERS.len())] };
        return format!("{}{more}{}", &text[..places[k]], &text[end..]);
    }
    // Lines lost, doubled or in another order.
    let mut lines: Vec<&str> = text.lines().collect();
    if lines.is_empty() {
        return text.to_owned();
    }
    let [a, b] = [0; 2].map(|_| rng.random_range(0..lines.len()));
    if kind > 11 {
        return with_value(text, lines[a], rng);
    }
    match kind {
        9 => drop(lines.remove(a)),
        10 => lines.insert(b, lines[a]),
        _ => lines.swap(a, b),
    }
    lines.join("\n") + "\n"
}

/// The text with a value of another type, or a deeply nested one, in a line that has a value.
fn with_value(text: &str, line: &str, rng: &mut ChaCha8Rng) -> String {
    let Some((key, _)) = line.split_once('=') else { return text.to_owned() };
    let value = VALUES[rng.random_range(0..VALUES.len())];
    let deep = "[".repeat(1 << rng.random_range(0..16));
    let value = if value.is_empty() { &deep } else { value };
    text.replacen(line, &format!("{key}= {value}"), 1)
}

/// Where numbers are.
fn numbers(text: &str) -> Vec<std::ops::Range<usize>> {
    let bytes = text.as_bytes();
    let of_number = |byte: &u8| byte.is_ascii_digit() || b".+-eE".contains(byte);
    let mut found = Vec::new();
    let mut place = 0;
    while place < bytes.len() {
        let alone = place == 0 || !bytes[place - 1].is_ascii_alphanumeric();
        let length = bytes[place..].iter().take_while(|byte| of_number(byte)).count();
        if alone && bytes[place..place + length].iter().any(u8::is_ascii_digit) {
            found.push(place..place + length);
        }
        place += length.max(1);
    }
    found
}
