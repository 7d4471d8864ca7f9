//! The line of least squares.

/// Sums over points (x, y).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Line {
    n: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
}

impl FromIterator<[f64; 2]> for Line {
    fn from_iter<T: IntoIterator<Item = [f64; 2]>>(points: T) -> Self {
        points.into_iter().fold(Self::default(), |s, [x, y]| Self {
            n: s.n + 1.0,
            x: s.x + x,
            y: s.y + y,
            xx: s.xx + x * x,
            xy: s.xy + x * y,
        })
    }
}

impl Line {
    /// Its slope; not finite for points of one x.
    pub fn slope(&self) -> f64 {
        (self.n * self.xy - self.x * self.y) / (self.n * self.xx - self.x * self.x)
    }

    /// Where a line of the given slope through the centre of the points is at x = 0.
    pub fn intercept(&self, slope: f64) -> f64 {
        (self.y - slope * self.x) / self.n
    }
}
