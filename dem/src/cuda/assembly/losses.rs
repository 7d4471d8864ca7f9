//! Arguments of `losses.cu`: sums of what was lost.

use gpu::{Pointer, kernel};

use super::abi::{Arrays, Loss, Parameters};
use crate::assembly::Losses;
use crate::cuda::real::CudaReal;
use crate::grains::Grains;

kernel! {
    /// Adds the losses of all warps to the totals.
    pub(super) struct SumLosses<R: CudaReal>: assembly_losses {
        /// The discs.
        pub a: Arrays<R>,
        /// Constants.
        pub p: Parameters<R>,
        /// One entry.
        pub total: Pointer<Loss>,
    }
}

/// Units of energy in a joule. A contact that is compressed by its disc's radius stores 2^49 of them: of a step's loss
/// they resolve a millionth where a scene hardly flows, and 52 bits hold all that overlaps below the limit may lose.
pub(super) fn units_per_joule(grains: &Grains) -> f64 {
    2.0_f64.powi(50) / (grains.normal_stiffness * grains.radius_max.powi(2))
}

impl Loss {
    /// The same in joules.
    pub fn in_joules(&self, units_per_joule: f64) -> Losses {
        let joules = |units: u64| units as i64 as f64 / units_per_joule;
        Losses {
            dashpots: joules(self.dashpots),
            friction: joules(self.friction),
            damping: joules(self.damping),
            boxes: joules(self.boxes),
        }
    }
}
