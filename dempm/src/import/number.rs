//! Numbers of numpy arrays.

/// A type of numbers with their order of bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Number {
    kind: Kind,
    /// Bytes of a number; 0 for an object.
    size: usize,
    /// Whether the most significant byte comes first.
    big_endian: bool,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Float,
    Signed,
    /// Also truth values.
    Unsigned,
    Object,
}

impl Number {
    /// The type that numpy calls `f4`, `i8` and so on; `None` for texts, structures and others.
    pub fn from_name(name: &str) -> Option<Self> {
        let (kind, size) = match name {
            "f4" => (Kind::Float, 4),
            "f8" => (Kind::Float, 8),
            "i1" | "i2" | "i4" | "i8" => (Kind::Signed, name[1..].parse().ok()?),
            "b1" | "u1" | "u2" | "u4" | "u8" => (Kind::Unsigned, name[1..].parse().ok()?),
            "O4" | "O8" => (Kind::Object, 0),
            _ => return None,
        };
        Some(Self { kind, size, big_endian: false })
    }

    /// The same type with another order of bytes.
    pub fn with_order(self, big_endian: bool) -> Self {
        Self { big_endian, ..self }
    }

    /// The numbers in `bytes`; none for objects.
    pub fn values(self, bytes: &[u8]) -> Vec<f64> {
        if self.size == 0 {
            return Vec::new();
        }
        bytes.chunks_exact(self.size).map(|bytes| self.value(bytes)).collect()
    }

    fn value(self, bytes: &[u8]) -> f64 {
        let negative = match (bytes.first(), bytes.last()) {
            (Some(&first), Some(&last)) => (if self.big_endian { first } else { last }) & 0x80 != 0,
            _ => false,
        };
        let fill = if matches!(self.kind, Kind::Signed) && negative { 0xff } else { 0 };
        let mut all = [fill; 8];
        for (place, byte) in bytes.iter().enumerate() {
            all[if self.big_endian { bytes.len() - 1 - place } else { place }] = *byte;
        }
        let bits = u64::from_le_bytes(all);
        match self.kind {
            Kind::Float if self.size == 4 => f32::from_bits(bits as u32).into(),
            Kind::Float => f64::from_bits(bits),
            Kind::Signed => bits as i64 as f64,
            Kind::Unsigned | Kind::Object => bits as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_become_numbers() {
        let read = |name: &str, big_endian: bool, bytes: &[u8]| {
            Number::from_name(name).unwrap().with_order(big_endian).values(bytes)
        };
        assert_eq!(read("f4", false, &1.5_f32.to_le_bytes()), [1.5]);
        assert_eq!(read("f8", true, &(-0.1_f64).to_be_bytes()), [-0.1]);
        assert_eq!(read("i2", true, &[0xff, 0xfe, 0x01, 0x00]), [-2.0, 256.0]);
        assert_eq!(read("i1", false, &[0xff, 0x7f]), [-1.0, 127.0]);
        assert_eq!(read("u1", false, &[0xff]), [255.0]);
        assert_eq!(read("i8", false, &(-3_i64).to_le_bytes()), [-3.0]);
        assert!(Number::from_name("U5").is_none() && Number::from_name("c16").is_none());
    }
}
