//! Working precision, and positions as fixed-point fractions of the periodic cell.
//!
//! A reduced coordinate is an unsigned integer, a fraction of one cell period. Wrap-around is then
//! integer overflow, the difference of two coordinates as a signed integer is the nearest image,
//! and a lattice reduction `s_x += k s_y` is exact. With 32 bits the resolution is
//! `0.144 m / 2^32 = 3e-11 m`, about 3e-6 of a typical overlap; plain f32 coordinates would lose
//! 0.1 % of it.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use serde::{Serialize, de::DeserializeOwned};

/// Floating-point type of the packing: `f32` (with 32-bit coordinates) or `f64` (64-bit).
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialEq
    + PartialOrd
    + Send
    + Sync
    + Serialize
    + DeserializeOwned
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + 'static
{
    /// Fixed-point fraction of a cell period.
    type Fraction: Copy + Debug + Default + PartialOrd + Send + Sync + Serialize + DeserializeOwned;

    /// Name as written in scene files and outputs.
    const NAME: &'static str;
    /// Length of one unit of [`Self::Fraction`], in cell periods.
    const UNIT: f64;

    /// `x` rounded to this type.
    fn from_f64(x: f64) -> Self;
    /// The same number as `f64`.
    fn to_f64(self) -> f64;
    /// Square root.
    fn sqrt(self) -> Self;
    /// The larger number; `self` if either is NaN.
    fn max(self, other: Self) -> Self;
    /// The smaller number; `self` if either is NaN.
    fn min(self, other: Self) -> Self;

    /// `s` in cell periods, wrapped into `[0, 1)`.
    fn fraction(s: f64) -> Self::Fraction;
    /// In cell periods, in `[0, 1)`.
    fn fraction_to_f64(s: Self::Fraction) -> f64;
    /// Nearest image of `b - a`, in units of [`Self::UNIT`].
    fn nearest(a: Self::Fraction, b: Self::Fraction) -> Self;
    /// One given image of `b - a`, in units of [`Self::UNIT`].
    fn image(a: Self::Fraction, b: Self::Fraction, image: Image) -> Self;
    /// `s` moved by `step` units of [`Self::UNIT`], rounded to nearest.
    fn advance(s: Self::Fraction, step: Self) -> Self::Fraction;
    /// `s + k t`, exact modulo one period.
    fn shear(s: Self::Fraction, k: i32, t: Self::Fraction) -> Self::Fraction;
    /// Index of `s` among `n` equal bins of the period.
    fn bin(s: Self::Fraction, n: usize) -> usize;
}

/// Which periodic image of a separation a pair refers to, along one cell vector.
///
/// The difference of two fractions is read as a number in `[-1/2, 1/2)`, or in `[0, 1)` when
/// `unsigned`, and `shift` whole periods are added. A pair near half a period uses the unsigned
/// reading, so that its image does not jump when it crosses one half.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, serde::Deserialize)]
pub struct Image {
    pub shift: i16,
    pub unsigned: bool,
}

impl Image {
    /// The image nearest to `periods`, where `nearest` is the same separation's nearest image.
    pub fn of(nearest: f64, periods: f64) -> Self {
        let unsigned = nearest.abs() > 0.25;
        let base = if unsigned && nearest < 0.0 { nearest + 1.0 } else { nearest };
        Self { shift: (periods - base).round() as i16, unsigned }
    }
}

macro_rules! impl_real {
    ($float:ty, $unsigned:ty, $signed:ty, $wide:ty, $bits:expr, $name:literal) => {
        impl Real for $float {
            type Fraction = $unsigned;
            const NAME: &'static str = $name;
            const UNIT: f64 = 1.0 / (1u128 << $bits) as f64;

            #[inline(always)]
            fn from_f64(x: f64) -> Self {
                x as $float
            }
            #[inline(always)]
            fn to_f64(self) -> f64 {
                self as f64
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                <$float>::sqrt(self)
            }
            #[inline(always)]
            fn max(self, other: Self) -> Self {
                if other > self { other } else { self }
            }
            #[inline(always)]
            fn min(self, other: Self) -> Self {
                if other < self { other } else { self }
            }
            #[inline]
            fn fraction(s: f64) -> $unsigned {
                // s - floor(s) can round up to 1, which is 0 again: the cast through the wide
                // integer keeps the low bits only.
                ((s - s.floor()) / Self::UNIT) as $wide as $unsigned
            }
            #[inline]
            fn fraction_to_f64(s: $unsigned) -> f64 {
                s as f64 * Self::UNIT
            }
            #[inline(always)]
            fn nearest(a: $unsigned, b: $unsigned) -> Self {
                b.wrapping_sub(a) as $signed as $float
            }
            #[inline]
            fn image(a: $unsigned, b: $unsigned, image: Image) -> Self {
                let d = b.wrapping_sub(a);
                let base = if image.unsigned { d as $wide } else { d as $signed as $wide };
                (base + ((image.shift as $wide) << $bits)) as $float
            }
            #[inline(always)]
            fn advance(s: $unsigned, step: Self) -> $unsigned {
                let half: $float = if step < 0.0 { -0.5 } else { 0.5 };
                // The cast `as` checks its range number by number; this way several advance at once.
                const LARGEST: $float = (<$signed>::MAX as $float).next_down();
                let rounded = (step + half).max(-LARGEST).min(LARGEST);
                // SAFETY: neither bound is beyond the integers, and `max` is not NaN.
                let units: $signed = unsafe { rounded.to_int_unchecked() };
                let units = if step.is_nan() { 0 } else { units };
                s.wrapping_add(units as $unsigned)
            }
            #[inline]
            fn shear(s: $unsigned, k: i32, t: $unsigned) -> $unsigned {
                s.wrapping_add((k as $unsigned).wrapping_mul(t))
            }
            #[inline]
            fn bin(s: $unsigned, n: usize) -> usize {
                ((s as u128 * n as u128) >> $bits) as usize
            }
        }
    };
}

impl_real!(f32, u32, i32, i64, 32, "f32");
impl_real!(f64, u64, i64, i128, 64, "f64");

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The nearest image of a difference is the difference modulo one period.
        #[test]
        fn nearest_image(a in 0.0..1.0f64, b in 0.0..1.0f64) {
            let d = f64::nearest(f64::fraction(a), f64::fraction(b)) * f64::UNIT;
            prop_assert!((-0.5..=0.5).contains(&d));
            let whole = (b - a) - d;
            prop_assert!((whole - whole.round()).abs() < 1e-15);
        }

        /// An image chosen at one moment stays the same image while the pair moves less than a
        /// quarter of a period, also across half a period.
        #[test]
        fn image_is_continuous(a in 0.0..1.0f64, d in -2.0..2.0f64, move_by in -0.2..0.2f64) {
            let fa = f32::fraction(a);
            let fb = f32::fraction(a + d);
            let image = Image::of(f32::nearest(fa, fb).to_f64() * f32::UNIT, d);
            let moved = f32::fraction(a + d + move_by);
            let seen = f32::image(fa, moved, image).to_f64() * f32::UNIT;
            prop_assert!((seen - (d + move_by)).abs() < 1e-6, "{seen} {}", d + move_by);
        }
    }

    #[test]
    fn moves_wrap_around() {
        let s = f32::advance(f32::fraction(0.75), (0.5 / f32::UNIT) as f32 * 0.999_999);
        assert!((f32::fraction_to_f64(s) - 0.25).abs() < 1e-6);
        assert_eq!(f32::advance(5, -0.6), 4);
        assert_eq!(f32::advance(0, -1.4), u32::MAX);
    }

    /// As the cast to an integer does it, but for the last bits of the largest moves.
    #[test]
    fn moves_beyond_all_measure_end_at_the_largest() {
        assert_eq!(f32::advance(7, f32::NAN), 7);
        assert_eq!(f32::advance(0, f32::INFINITY), (1 << 31) - 128);
        assert_eq!(f64::advance(0, f64::NEG_INFINITY), 0_u64.wrapping_sub((1 << 63) - 1024));
    }
}
