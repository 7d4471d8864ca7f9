//! Basis functions of the background grid, along one axis.

use serde::{Deserialize, Serialize};

/// Most nodes a point can see along one axis.
pub const SUPPORT: usize = 4;

/// Basis functions, as products of one-dimensional ones.
///
/// On a regular grid with ghost layers outside of the walls; splines are not modified at walls.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Basis {
    /// Hat functions: discontinuous gradients, so a point that crosses a cell face kicks the grid.
    /// For comparison only.
    Linear,
    /// uGIMP: hats averaged over a point domain of constant half-size `cell / 4`.
    /// Bardenhagen & Kober (2004), CMES 5, 477.
    Gimp,
    /// Quadratic B-splines (C1). Steffen, Kirby & Berzins (2008), IJNME 76, 922.
    #[default]
    Quadratic,
    /// Cubic B-splines (C2).
    Cubic,
}

/// Half-size of a uGIMP point domain, in cells: 2 x 2 points a cell.
pub(crate) const GIMP_HALF_SIZE: f64 = 0.25;

/// One-dimensional basis functions of the nodes `first .. first + width` at a place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShapeFunctions {
    /// Lowest node.
    pub first: i64,
    /// `S_i(x)`.
    pub value: [f64; SUPPORT],
    /// `dS_i/dx` (1/cell).
    pub gradient: [f64; SUPPORT],
    /// `S_i(x) (i - x) / D` (1/cell), with `D = sum S_i (i - x)²`: weights of the affine velocity
    /// matrix of APIC.
    pub affine: [f64; SUPPORT],
}

impl Basis {
    /// Nodes a point sees along one axis.
    pub fn width(self) -> usize {
        match self {
            Self::Linear => 2,
            Self::Gimp | Self::Quadratic => 3,
            Self::Cubic => 4,
        }
    }

    /// Evaluates the basis at `x`, in cells (nodes at the integers).
    pub fn evaluate(self, x: f64) -> ShapeFunctions {
        let first = match self {
            Self::Linear => x.floor(),
            Self::Gimp => (x - GIMP_HALF_SIZE).floor(),
            Self::Quadratic => (x - 0.5).floor(),
            Self::Cubic => x.floor() - 1.0,
        };
        let mut shape = ShapeFunctions { first: first as i64, ..Default::default() };
        let u = x - first;
        match self {
            Self::Linear => {
                shape.value[..2].copy_from_slice(&[1.0 - u, u]);
                shape.gradient[..2].copy_from_slice(&[-1.0, 1.0]);
                // S (i - x) / D is the gradient for hats, and D = 0 on a node.
                shape.affine = shape.gradient;
                return shape;
            }
            Self::Gimp => {
                for k in 0..3 {
                    (shape.value[k], shape.gradient[k]) = gimp(u - k as f64);
                }
            }
            Self::Quadratic => {
                let (a, b, c) = (1.5 - u, u - 1.0, u - 0.5);
                shape.value[..3].copy_from_slice(&[0.5 * a * a, 0.75 - b * b, 0.5 * c * c]);
                shape.gradient[..3].copy_from_slice(&[-a, -2.0 * b, c]);
            }
            Self::Cubic => {
                // u in [1, 2): distance to the four nodes is u, u - 1, 2 - u, 3 - u.
                let (a, b, c, d) = (2.0 - u, u - 1.0, 2.0 - u, u - 1.0);
                shape.value = [
                    a * a * a / 6.0,
                    2.0 / 3.0 - b * b + 0.5 * b * b * b,
                    2.0 / 3.0 - c * c + 0.5 * c * c * c,
                    d * d * d / 6.0,
                ];
                shape.gradient =
                    [-0.5 * a * a, -2.0 * b + 1.5 * b * b, 2.0 * c - 1.5 * c * c, 0.5 * d * d];
            }
        }
        let moment = |k: usize| shape.value[k] * (k as f64 - u);
        let second = (0..SUPPORT).map(|k| moment(k) * (k as f64 - u)).sum::<f64>();
        shape.affine = std::array::from_fn(|k| moment(k) / second);
        shape
    }
}

/// uGIMP function and derivative at distance `d` (cells) from the node.
fn gimp(d: f64) -> (f64, f64) {
    const L: f64 = GIMP_HALF_SIZE;
    let (a, sign) = (d.abs(), d.signum());
    if a < L {
        (1.0 - (d * d + L * L) / (2.0 * L), -d / L)
    } else if a < 1.0 - L {
        (1.0 - a, -sign)
    } else if a < 1.0 + L {
        let r = 1.0 + L - a;
        (r * r / (4.0 * L), -sign * r / (2.0 * L))
    } else {
        (0.0, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Constants and linear fields are exact.
    #[test]
    fn values_gradients_and_affine_weights_are_consistent() {
        for basis in [Basis::Gimp, Basis::Quadratic, Basis::Cubic] {
            for k in 0..=1000 {
                let x = 5.0 * f64::from(k) / 1000.0;
                let shape = basis.evaluate(x);
                let sum = |weight: &[f64; SUPPORT], power: i32| {
                    let node = |k: usize| (shape.first + k as i64) as f64;
                    (0..SUPPORT).map(|k| weight[k] * node(k).powi(power)).sum::<f64>()
                };
                let weights = [&shape.value, &shape.gradient, &shape.affine];
                for (weight, expected) in weights.iter().zip([[1.0, x], [0.0, 1.0], [0.0, 1.0]]) {
                    assert!((sum(weight, 0) - expected[0]).abs() < 1e-13, "{basis:?} at {x}");
                    assert!((sum(weight, 1) - expected[1]).abs() < 1e-13, "{basis:?} at {x}");
                }
            }
        }
    }
}
