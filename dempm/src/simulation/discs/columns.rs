//! The grains of a scene at time zero: every column filled, and put in place.

use std::collections::HashMap;
use std::sync::Arc;

use dem::assembly::{Boundary, ColumnBox, Grain, Packed};
use dem::cuda::CudaReal;
use gpu::Device;
use gpu::ranks::Ranks;

use crate::packings;
use crate::scene::{Discs, InitialStress, Scene};
use crate::simulation::error::SimulationError;

/// Overlap with boxes and other columns (radii) that grains may start with.
const TOUCH: f64 = 0.05;

/// The grains of all columns with their contacts, and those of each column. Several ranks begin with different
/// columns and find the others in the cache.
pub(super) fn filled<R: CudaReal>(
    scene: &Scene,
    discs: &Discs,
    boundary: &Boundary,
    device: Option<&Arc<Device>>,
    ranks: Option<&Ranks>,
) -> Result<(Packed, Vec<Vec<Grain>>), SimulationError> {
    let resting = scene.resting_columns();
    let prepare = |k: usize| {
        let place = ColumnBox {
            corner: scene.columns[k].place.corner,
            size: scene.columns[k].place.size,
            loaded: resting[k] && scene.initial_stress == InitialStress::Ladder,
        };
        let seed = (scene.seed << 16) + k as u64;
        packings::column::<R>(&discs.grains, boundary, scene.gravity, &place, seed, device)
    };
    let count = scene.columns.len();
    let first = ranks.map_or(0, |ranks| ranks.rank() * count / ranks.size());
    let in_turn = (first..count).chain(0..first).map(prepare);
    let mut prepared = in_turn.collect::<Result<Vec<Packed>, _>>()?;
    prepared.rotate_right(first);

    let mut all = Packed::default();
    let mut columns = Vec::new();
    let mut taken = Taken::new(2.0 * discs.grains.radius_max);
    for (column, mut packed) in scene.columns.iter().zip(prepared) {
        // The top layer may reach into what lies on it.
        packed.retain(|grain| {
            let free = |branch: [f64; 2]| branch[0].hypot(branch[1]) > (1.0 - TOUCH) * grain.r;
            boundary.boxes.iter().all(|b| free(b.branch(grain.x, 0.0))) && taken.is_free(grain)
        });
        for grain in &mut packed.grains {
            grain.v = column.velocity;
        }
        taken.add(&packed.grains);
        all.append(&packed);
        columns.push(packed.grains);
    }
    Ok((all, columns))
}

/// Places that grains of earlier columns have taken, in square bins.
struct Taken {
    /// Side of a bin (m), a largest diameter.
    side: f64,
    bins: HashMap<[i64; 2], Vec<Grain>>,
}

impl Taken {
    fn new(side: f64) -> Self {
        Self { side, bins: HashMap::new() }
    }

    fn bin(&self, x: [f64; 2]) -> [i64; 2] {
        x.map(|x| (x / self.side).floor() as i64)
    }

    fn add(&mut self, grains: &[Grain]) {
        for grain in grains {
            self.bins.entry(self.bin(grain.x)).or_default().push(*grain);
        }
    }

    fn is_free(&self, grain: &Grain) -> bool {
        let [i, j] = self.bin(grain.x);
        let around = (-1..=1).flat_map(|dj| (-1..=1).map(move |di| [i + di, j + dj]));
        around.filter_map(|bin| self.bins.get(&bin)).flatten().all(|other| {
            let distance = (grain.x[0] - other.x[0]).hypot(grain.x[1] - other.x[1]);
            distance > grain.r + other.r - TOUCH * grain.r.min(other.r)
        })
    }
}
