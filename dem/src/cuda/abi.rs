//! Structs that Rust and the kernel share.

use gpu::{ConstPointer, Pointer, cuda_enum, cuda_struct};
use nalgebra::Matrix2;

use super::real::CudaReal;
use crate::parameters::RveParameters;
use crate::rve::{LEAST_SOLID_FRACTION, Substepping};
use crate::state::RveState;

/// Narrowest Verlet skin, that of an RVE nearly at rest, as a fraction of the widest.
const LEAST_SKIN: f64 = 0.1;

cuda_struct! {
    /// A tensor in the plane, row by row; `Matrix` in the kernel.
    #[derive(Default)]
    pub struct Tensor {
        /// First row.
        pub xx: f64,
        /// First row.
        pub xy: f64,
        /// Second row.
        pub yx: f64,
        /// Second row.
        pub yy: f64,
    }

    /// A vector in the plane; `Vec` in the kernel.
    #[derive(Default)]
    #[align(2 * size_of::<R>())]
    pub(super) struct Vector<R: CudaReal> {
        pub x: R,
        pub y: R,
    }

    /// Velocities of a disc.
    #[derive(Default)]
    #[align(16)]
    pub(super) struct Motion<R: CudaReal> {
        /// Peculiar velocity (m/s).
        pub x: R,
        /// Peculiar velocity (m/s).
        pub y: R,
        /// Half the angular velocity (1/s).
        pub half_w: R,
        pub unused: R,
    }

    /// Position as fractions of the two cell vectors of a packing, or of the region of a whole scene.
    #[derive(Default)]
    #[align(2 * size_of::<R>())]
    pub(super) struct Position<R: CudaReal> {
        pub x: R::Fraction,
        pub y: R::Fraction,
    }

    /// Constants of a disc.
    #[align(4 * size_of::<R>())]
    pub(super) struct Disc<R: CudaReal> {
        /// Radius (m).
        pub r: R,
        /// Inverse mass (1/kg).
        pub inv_mass: R,
        /// Inverse moment of inertia (1/(kg m²)).
        pub inv_inertia: R,
        /// Mass (kg).
        pub mass: R,
    }
}

cuda_enum! {
    /// First failure of an RVE, which then stands still.
    pub(super) enum Status: u32 {
        OK = 0,
        NOT_FINITE = 1,
        OVERLAP = 2,
        LIST_FULL = 3,
        SLOTS_FULL = 4,
    }
}

cuda_struct! {
    /// State of an RVE between macro steps, besides its discs and their list.
    #[derive(Default)]
    pub(super) struct Header {
        /// Cell vectors (m).
        pub cell: Tensor,
        /// Cell vectors at the last search (m).
        pub reference_cell: Tensor,
        /// How far the list reaches beyond touch (m); 0: there is no list.
        pub skin: f64,
        /// Largest distance at which two discs touch (m).
        pub reach: f64,
        /// Area of all discs (m²).
        pub solid: f64,
        /// Mass of all discs (kg).
        pub mass: f64,
        /// Spin of the cell that angular velocities contain (1/s).
        pub spin: f64,
        /// Mean velocity (m/s) that the next macro step removes; NaN: not known.
        pub drift_x: f64,
        /// As `drift_x`.
        pub drift_y: f64,
        /// Cell area (m²) while stress-free, negative while loaded.
        pub free_area: f64,
        /// Row of the table of discs.
        pub grading: u32,
        /// As of [`Rve`](crate::Rve).
        pub kind: u32,
        /// Whether the list holds images other than the nearest.
        pub imaged: u32,
        /// [`Status`].
        pub status: u32,
        /// Macro steps since the upload.
        pub steps: u32,
        /// Slots in use of pairs at their owners.
        pub owned: u32,
        /// Slots in use of the same pairs at the other discs.
        pub incoming: u32,
    }

    /// Slots of one disc: of the pairs that it owns, one in each row of slots, and of the others.
    #[derive(Default)]
    #[align(8)]
    pub(super) struct Rows {
        pub owned: u16,
        pub owned_end: u16,
        pub incoming: u16,
        pub incoming_end: u16,
    }

    /// [`RveState`] in device memory.
    #[derive(Default)]
    pub struct State {
        pub(super) stress: Tensor,
        pub(super) area: f64,
        pub(super) solid_fraction: f64,
        pub(super) coordination: f64,
        pub(super) relative_overlap: f64,
        pub(super) min_width: f64,
        pub(super) searches: u32,
        pub(super) free: u32,
        pub(super) thin: u32,
        pub(super) dense: u32,
        /// Mean resultant force on a disc over the mean normal force, in batches of unequal parameters.
        pub(super) unbalanced: f64,
    }

    /// The RVE of one block.
    #[align(8)]
    pub(super) struct Turn {
        /// In launches of even number.
        pub even: u32,
        /// In launches of odd number.
        pub odd: u32,
    }

    /// RVEs queued for the next launch.
    #[derive(Default)]
    pub(super) struct Queue {
        /// From the front (upper half) and from the back.
        pub queued: u64,
        /// Number of this launch.
        pub launch: u32,
    }

    /// Parameters of a macro step.
    pub(super) struct Parameters<R: CudaReal> {
        /// Substep (s).
        pub dt: f64,
        /// One over thickness (m) and number of stress samples.
        pub stress_weight: f64,
        /// Narrowest Verlet skin (m).
        pub least_skin: f64,
        /// Widest Verlet skin (m).
        pub skin: f64,
        /// As of [`RveParameters`].
        pub free_solid_fraction: f64,
        /// Solid fraction below which a stress-free RVE does not expand any more.
        pub least_solid_fraction: f64,
        /// Width (m) below which a cell is not thinned further.
        pub thin_width: f64,
        /// As of [`RveParameters`].
        pub max_solid_fraction: f64,
        /// As of [`RveParameters`].
        pub overlap_limit: f64,
        /// Substep (s).
        pub step: R,
        /// kn (N/m).
        pub normal_stiffness: R,
        /// kt dt (N s/m).
        pub spring: R,
        /// 2 zeta.
        pub dashpot: R,
        /// Coefficient of friction.
        pub friction: R,
        /// Cundall's alpha.
        pub local_damping: R,
        /// Number of RVEs.
        pub rves: u32,
        /// Substeps in the macro step. In batches of unequal parameters, 0: the RVE stands still.
        pub substeps: u32,
        /// Substeps at its end over which stress is averaged.
        pub samples: u32,
        /// Whether the kinetic part is added to the stress.
        pub kinetic: u32,
        /// Coefficient of rolling friction.
        pub rolling_friction: R,
        /// kr dt (N s/m).
        pub rolling_spring: R,
        /// The rolling dashpot over the normal one.
        pub rolling_dashpot: R,
    }

    /// Arrays over RVEs; the fresh packings follow, one for each kind.
    pub(super) struct Batch<R: CudaReal> {
        pub header: Pointer<Header>,
        pub state: Pointer<State>,
        /// By seat, as `motion`, `reference` and `seated`.
        pub position: Pointer<Position<R>>,
        pub motion: Pointer<Motion<R>>,
        /// Position at the last search.
        pub reference: Pointer<Position<R>>,
        /// Disc of the seat.
        pub seated: Pointer<u16>,
        pub rows: Pointer<Rows>,
        /// By slot, as `pair`, `tangential` and `incoming`: seat and image, see `Slots` in
        /// `shared.cuh`.
        pub neighbour: Pointer<u32>,
        /// Distance at touch (m) and dashpot (kg/s).
        pub pair: Pointer<Vector<R>>,
        /// Tangential spring force (N) and, where contacts resist it, the rolling spring force in as many slots.
        pub spring: Pointer<R>,
        /// Slot of a pair at its owner.
        pub incoming: Pointer<u16>,
        /// Once for all RVEs that have the same discs.
        pub disc: ConstPointer<Disc<R>>,
        /// Lowest index of an RVE that failed.
        pub failed: Pointer<i32>,
        /// By block.
        pub turn: Pointer<Turn>,
        pub queue: Pointer<Queue>,
        /// Parameters of each RVE, in batches of unequal parameters.
        pub each: ConstPointer<Parameters<R>>,
    }
}

impl<R: CudaReal> Parameters<R> {
    pub fn new(p: &RveParameters, dt: f64, rves: usize) -> Self {
        let sub = Substepping::<R>::new(p, dt);
        let skin = p.grains.skin * p.grains.radius_max;
        Self {
            dt: sub.dt,
            stress_weight: 1.0 / (p.grains.thickness * sub.samples as f64),
            least_skin: LEAST_SKIN * skin,
            skin,
            free_solid_fraction: p.free_solid_fraction,
            least_solid_fraction: LEAST_SOLID_FRACTION,
            thin_width: p.thin_width * p.grains.mean_diameter(),
            max_solid_fraction: p.max_solid_fraction,
            overlap_limit: p.grains.overlap_limit,
            step: sub.law.dt,
            normal_stiffness: sub.law.normal_stiffness,
            spring: sub.law.tangential_stiffness * sub.law.dt,
            dashpot: R::from_f64(2.0) * sub.law.damping_ratio,
            friction: sub.law.friction,
            local_damping: sub.law.local_damping,
            rolling_friction: sub.law.rolling_friction,
            rolling_spring: sub.law.rolling_stiffness * sub.law.dt,
            rolling_dashpot: sub.law.rolling_dashpot(),
            rves: rves as u32,
            substeps: sub.substeps as u32,
            samples: sub.samples as u32,
            kinetic: u32::from(p.kinetic_stress),
        }
    }
}

impl From<&Matrix2<f64>> for Tensor {
    fn from(m: &Matrix2<f64>) -> Self {
        Self { xx: m.m11, xy: m.m12, yx: m.m21, yy: m.m22 }
    }
}

impl From<Tensor> for Matrix2<f64> {
    fn from(t: Tensor) -> Self {
        Self::new(t.xx, t.xy, t.yx, t.yy)
    }
}

impl From<State> for RveState {
    fn from(s: State) -> Self {
        Self {
            stress: s.stress.into(),
            area: s.area,
            solid_fraction: s.solid_fraction,
            coordination: s.coordination,
            relative_overlap: s.relative_overlap,
            min_width: s.min_width,
            searches: s.searches,
            free: s.free != 0,
            thin: s.thin != 0,
            dense: s.dense != 0,
        }
    }
}
