//! Contact of material with a rigid surface: unilateral, with Coulomb friction.

use serde::{Deserialize, Serialize};

use crate::{Error, Vec2};

/// Friction of a wall or face. None holds back material that moves away.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Friction {
    /// None: smooth.
    #[default]
    Slip,
    /// Coulomb friction of this coefficient: `|dv_t| <= mu |dv_n|`.
    Coulomb(f64),
    /// Material in contact does not slide at all.
    Stick,
}

impl Friction {
    pub(crate) fn check(self) -> Result<(), String> {
        match self {
            Self::Coulomb(mu) if !(mu.is_finite() && mu >= 0.0) => {
                Err(format!("friction coefficient {mu} is not a number >= 0"))
            }
            _ => Ok(()),
        }
    }
}

/// Friction of the four sides of a box.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Walls {
    /// Side of the smallest x.
    pub left: Friction,
    /// Side of the largest x.
    pub right: Friction,
    /// Side of the smallest y.
    pub bottom: Friction,
    /// Side of the largest y.
    pub top: Friction,
}

impl Walls {
    /// The same friction on all sides.
    pub fn all(friction: Friction) -> Self {
        Self { left: friction, right: friction, bottom: friction, top: friction }
    }

    pub(crate) fn sides(&self) -> [Friction; 4] {
        [self.left, self.right, self.bottom, self.top]
    }

    pub(crate) fn check_domain(&self) -> Result<(), Error> {
        self.sides()
            .iter()
            .try_for_each(|f| f.check())
            .map_err(|e| Error::Domain(format!("walls: {e}")))
    }
}

/// Velocity (m/s) after contact with a surface of outward `normal` that moves at `surface` (m/s).
///
/// Unilateral: the approaching normal part is removed, and the tangential part loses at most
/// `mu` times as much.
pub(crate) fn contact(velocity: Vec2, normal: Vec2, surface: Vec2, friction: Friction) -> Vec2 {
    let relative = velocity - surface;
    let approach = -relative.dot(&normal);
    if approach < 0.0 {
        return velocity;
    }
    let tangential = relative + normal * approach;
    surface
        + match friction {
            Friction::Slip => tangential,
            Friction::Stick => Vec2::zeros(),
            Friction::Coulomb(mu) => {
                let (speed, loss) = (tangential.norm(), mu * approach);
                if speed <= loss { Vec2::zeros() } else { tangential * (1.0 - loss / speed) }
            }
        }
}
