//! Limits of numbers.

/// Longest side of a domain, m.
pub(crate) const LENGTH: f64 = 1.0e5;
/// Most gravity along an axis, m/s².
pub(crate) const GRAVITY: f64 = 1.0e3;
/// Longest simulated time, s.
pub(crate) const TIME: f64 = 1.0e5;
/// Most cells of the background grid: a wrong cell size must not take all memory.
pub(crate) const MAX_CELLS: f64 = 1.0e8;
/// Most material points per cell along each direction.
pub(crate) const MAX_POINTS_PER_CELL: usize = 8;

/// The numbers that a key may have. Limits are wide: they exclude wrong units, typing errors and numbers
/// that would overflow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    low: f64,
    low_included: bool,
    high: f64,
    unit: &'static str,
    hint: &'static str,
    example: f64,
}

/// Above zero and at most `high`.
pub(crate) const fn positive(high: f64, unit: &'static str) -> Limits {
    Limits { low: 0.0, low_included: false, high, unit, hint: "", example: high }
}

/// From `low` to `high`, both included.
pub(crate) const fn between(low: f64, high: f64, unit: &'static str) -> Limits {
    Limits { low, low_included: true, high, unit, hint: "", example: high }
}

/// Zero or more, at most `high`.
pub(crate) const fn from_zero(high: f64, unit: &'static str) -> Limits {
    between(0.0, high, unit)
}

/// Of either sign, at most `high` in size.
pub(crate) const fn within(high: f64, unit: &'static str) -> Limits {
    between(-high, high, unit)
}

impl Limits {
    /// Adds a remedy for numbers outside.
    pub const fn with_hint(mut self, hint: &'static str) -> Self {
        self.hint = hint;
        self
    }

    /// Adds a sensible number, shown when one is missing.
    pub const fn with_example(mut self, example: f64) -> Self {
        self.example = example;
        self
    }

    pub fn hint(&self) -> &'static str {
        self.hint
    }

    pub fn example(&self) -> f64 {
        self.example
    }

    /// An error with the limits if `number` is outside them, as NaN always is.
    pub fn check(&self, number: f64) -> Result<(), String> {
        let above = if self.low_included { number >= self.low } else { number > self.low };
        if above && number <= self.high { Ok(()) } else { Err(self.to_string()) }
    }

    /// The type of a key.
    pub fn a_number(&self) -> String {
        if self.unit.is_empty() { "a number".into() } else { format!("a number ({})", self.unit) }
    }
}

impl std::fmt::Display for Limits {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { low, high, .. } = self;
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        if self.low_included {
            write!(f, "must be from {low} to {high}{unit}")
        } else {
            write!(f, "must be above {low} and at most {high}{unit}")
        }
    }
}
