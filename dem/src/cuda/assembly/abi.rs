//! Structs that Rust and the kernels of assemblies share.

use gpu::{ConstPointer, Pointer, cuda_enum, cuda_struct};

pub(super) use crate::cuda::abi::Position;
use crate::cuda::real::CudaReal;

/// Most neighbours of a disc: their contacts are marked in a word.
pub(super) const MOST_ROWS: usize = 24;
/// Most bodies near a disc.
pub(super) const NEAR_BODIES: usize = 4;
/// Steps between two decisions on whether to search.
pub(super) const STEPS: usize = 16;

cuda_struct! {
    /// Where a disc is, and what it is: all that finding contacts needs.
    #[derive(Default)]
    #[align(4 * size_of::<R>())]
    pub(super) struct Place<R: CudaReal> {
        /// Fractions of the region.
        pub x: R::Fraction,
        pub y: R::Fraction,
        /// Radius (m).
        pub r: R,
        /// Inverse mass (1/kg); zero for fixed discs.
        pub inv_mass: R,
    }

    /// How a disc moves, and what it touches.
    #[derive(Default)]
    #[align(4 * size_of::<R>())]
    pub(super) struct Motion<R: CudaReal> {
        /// Velocity (m/s).
        pub x: R,
        pub y: R,
        /// Angular velocity (1/s).
        pub w: R,
        /// Number of rows, whether bodies are near, whether it is held, and which rows touch; see `assembly.cuh`.
        pub info: R::Fraction,
    }

    /// One disc: a sector of the cache.
    #[derive(Default)]
    pub(super) struct Disc<R: CudaReal> {
        pub place: Place<R>,
        pub motion: Motion<R>,
    }

    /// What a contact remembers of the last step, of sliding or of rolling.
    #[derive(Default)]
    #[align(2 * size_of::<R>())]
    pub(super) struct History<R: CudaReal> {
        /// Tangential spring force, or that of the rolling spring seen from the disc whose row it is (N).
        pub spring: R,
        /// Normal force less that of the spring, or the same of the rolling force (N).
        pub viscous: R,
    }

    /// What discs lose, in whole numbers of a unit of energy: sums have the same bits in any order. Negative numbers
    /// are those of two's complement.
    #[derive(Default)]
    pub(super) struct Loss {
        pub dashpots: u64,
        pub friction: u64,
        pub damping: u64,
        /// Supplied by boxes.
        pub boxes: u64,
    }

    /// What is known of the rest of a disc.
    #[derive(Default)]
    #[align(if size_of::<R>() == 4 { 16 } else { 8 })]
    pub(super) struct Rest<R: CudaReal> {
        /// The place that it stays near (fractions of the region).
        pub x: R::Fraction,
        pub y: R::Fraction,
        /// Force (N) and torque over radius (N) on it, as it was held first.
        pub force: [R; 3],
        /// Change of them (N) that wakes it; negative before they are known.
        pub allowed: R,
        /// Looks since it is near.
        pub looks: u32,
        /// Whether it is to wake, or what is around it moves.
        pub disturbed: u32,
    }

    /// A disc in its bin.
    #[derive(Default)]
    #[align(16)]
    pub(super) struct Binned<R: CudaReal> {
        /// Fractions of the region.
        pub x: R::Fraction,
        pub y: R::Fraction,
        /// Radius (m).
        pub r: R,
        /// Place in memory.
        pub disc: R::Fraction,
    }

    /// A rigid box or half plane.
    pub(super) struct Body {
        /// Corners until `start` (m).
        pub min: [f64; 2],
        pub max: [f64; 2],
        /// Velocity (m/s) from `start` (s) on.
        pub velocity: [f64; 2],
        pub start: f64,
        /// Friction of the left, right, bottom and top side.
        pub friction: [f64; 4],
    }

    /// The same at one time.
    #[derive(Default)]
    pub(super) struct PlacedBody<R: CudaReal> {
        /// Corners as fractions of the region.
        pub min: [R::Fraction; 2],
        pub max: [R::Fraction; 2],
        /// Velocity (m/s).
        pub velocity: [R; 2],
        pub friction: [R; 4],
    }

    /// State of a grain for output.
    #[derive(Default)]
    #[align(if size_of::<R>() == 4 { 16 } else { 8 })]
    pub(super) struct Output<R: CudaReal> {
        /// Fractions of the region.
        pub x: R::Fraction,
        pub y: R::Fraction,
        /// Velocity (m/s).
        pub vx: R,
        pub vy: R,
        /// Angular velocity (1/s).
        pub w: R,
        /// Radius (m).
        pub r: R,
        /// Inverse mass (1/kg).
        pub inv_mass: R,
        /// Force times arm, summed over contacts (N m), row by row.
        pub virial: [R; 4],
        /// Half the elastic energy of its contacts with discs, and that with bodies (J).
        pub elastic: R,
        pub contacts: u32,
        pub unused: [u32; 3],
    }

    /// How far a grain extends sideways.
    #[derive(Default)]
    #[align(2 * size_of::<R>())]
    pub(super) struct Extent<R: CudaReal> {
        /// Horizontal position (fraction of the region).
        pub x: R::Fraction,
        /// Radius (m).
        pub r: R,
    }

    /// A box in the domain (m).
    pub(super) struct Box {
        pub min: [f64; 2],
        pub max: [f64; 2],
    }

    /// What means over grains and their energy depend on.
    pub(super) struct Surroundings {
        /// Width and height of the domain (m).
        pub size: [f64; 2],
        /// Gravity (m/s²).
        pub gravity: [f64; 2],
        /// Out-of-plane thickness (m).
        pub thickness: f64,
        /// Width of the coarse graining (m).
        pub width: f64,
        /// Inertial over true mass.
        pub mass_scale: f64,
        /// Number of boxes.
        pub boxes: u32,
        pub unused: u32,
    }

    /// The mean over the grains of one point.
    pub(super) struct PointMean {
        /// m, m/s.
        pub position: [f64; 2],
        pub velocity: [f64; 2],
        /// 1/s and Pa, row by row.
        pub velocity_gradient: [f64; 4],
        pub stress: [f64; 4],
        /// kg/m.
        pub mass: f64,
        /// m².
        pub volume: f64,
        pub solid_fraction: f64,
        pub coordination: f64,
    }

    /// What steers a sequence of steps.
    pub(super) struct Control<R: CudaReal> {
        /// Time at the start of the sequence (s).
        pub time: f64,
        /// First failure: step, kind and disc in one number; all bits set: none.
        pub failed: u64,
        /// Steps of single discs in this sequence that were left out.
        pub skipped: u64,
        /// Steps done in this sequence, before the present round.
        pub steps: u32,
        /// Steps of the sequence.
        pub target: u32,
        /// Steps done in the present round.
        pub done: u32,
        /// Searches so far.
        pub searches: u32,
        /// Step of the last search.
        pub searched: u32,
        /// Number of the first step: 0 or 1, so that even steps always read the same buffer.
        pub first: u32,
        /// Rounds of this sequence in which steps were made.
        pub rounds: u32,
        pub unused: u32,
        /// Largest overlap over the smaller radius, as bits.
        pub overlap: R::Fraction,
        /// Of one of several ranks: largest horizontal displacement (units) since the sort, at a search.
        pub drift: R::Fraction,
        /// Square of the largest displacement (m²) of a disc that was computed though it would be held, as bits.
        pub audit: R::Fraction,
        /// Square of the largest displacement (m²) since the last search, as bits: before each step of the
        /// round, and after the last.
        pub moved: [R::Fraction; STEPS + 1],
    }

    /// Arrays over discs in the order of memory. Rows follow each other at a distance of `discs`.
    pub(super) struct Arrays<R: CudaReal> {
        pub control: Pointer<Control<R>>,
        /// Two buffers: steps of even number read the first, of one of several ranks the even steps of each
        /// round.
        pub disc: Pointer<Disc<R>>,
        /// Identity of each disc.
        pub id: Pointer<u32>,
        /// Position at the last search.
        pub reference: Pointer<Position<R>>,
        /// Neighbours, row by row.
        pub list: Pointer<u32>,
        /// Of sliding and, where contacts resist it, as many rows of rolling.
        pub history: Pointer<History<R>>,
        /// Up to four bodies near the disc, a byte each; 255: none.
        pub near_bodies: Pointer<u32>,
        /// Of sliding, and maybe of rolling.
        pub body_history: Pointer<History<R>>,
        /// Where discs sleep.
        pub rest: Pointer<Rest<R>>,
        /// Of each warp, the discs that steps leave out; where discs sleep.
        pub quiet: Pointer<u32>,
        pub body: ConstPointer<Body>,
        /// Two sets, as of discs.
        pub placed: Pointer<PlacedBody<R>>,
        /// Of each warp of discs, since the totals were taken.
        pub loss: Pointer<Loss>,
        /// Two sets of counts of the discs in each bin.
        pub bin_count: Pointer<u32>,
        /// Discs in each bin.
        pub binned: Pointer<Binned<R>>,
        /// Horizontal position at the sort; of one of several ranks.
        pub sorted: Pointer<R::Fraction>,
    }

    /// Constants of an assembly.
    pub(super) struct Parameters<R: CudaReal> {
        /// DEM step (s).
        pub dt: f64,
        /// Lower left corner of the region (m).
        pub origin: [f64; 2],
        /// Side of the region (m).
        pub side: f64,
        /// The same step.
        pub step: R,
        /// kn (N/m).
        pub normal_stiffness: R,
        /// kt dt (N s/m).
        pub spring: R,
        /// 1 / (2 kt dt) (m/(N s)).
        pub compliance: R,
        /// 2 zeta sqrt(kn).
        pub dashpot: R,
        /// Friction between discs.
        pub friction: R,
        /// Cundall's alpha.
        pub local_damping: R,
        /// Decay of velocities (1/s).
        pub drag: R,
        /// Gravity (m/s²).
        pub gravity: [R; 2],
        /// Length of a unit of `Fraction` (m).
        pub unit: R,
        /// Units moved at 1 m/s in a step.
        pub per_unit: R,
        /// Lists reach this far beyond touch (m).
        pub skin: R,
        /// Largest displacement since a search (m).
        pub allowed: R,
        /// That up to which a disc counts as not moved since its reference was taken (m).
        pub stayed: R,
        pub overlap_limit: R,
        /// Units of energy in a joule.
        pub per_joule: R,
        /// Largest horizontal displacement (units) since the sort up to which the window holds all that may
        /// come near the own discs; 0: the window is the whole domain.
        pub margin: R::Fraction,
        /// Discs, fixed ones included.
        pub discs: u32,
        /// Length of a row of lists and histories.
        pub row: u32,
        /// How many discs ahead a warp asks for what others will need; 0: not at all.
        pub ahead: u32,
        /// Whether this is one of several ranks.
        pub ranked: u32,
        /// Places in memory of the discs that this rank advances, from the first to before the second.
        pub own: [u32; 2],
        /// Of those and of the discs around them, which other ranks send.
        pub window: [u32; 2],
        pub bodies: u32,
        /// Bins along a side of the region.
        pub bins: u32,
        /// Tiles of 8 x 8 bins in a row of the domain, and rows of them.
        pub tiles: [u32; 2],
        /// Most discs in a bin.
        pub capacity: u32,
        /// Whether any of them moves.
        pub bodies_move: u32,
        /// Coefficient of rolling friction.
        pub rolling_friction: R,
        /// kr dt (N s/m).
        pub rolling_spring: R,
        /// 1 / (2 kr dt) (m/(N s)).
        pub rolling_compliance: R,
        /// The rolling dashpot over the normal one.
        pub rolling_dashpot: R,
        /// Distance (m) and speed (m/s) of a disc that rests, and part of the forces whose change wakes it.
        pub sleep_distance: R,
        pub sleep_speed: R,
        pub sleep_force: R,
        /// Weight of a unit of mass (m/s²).
        pub weight: R,
        /// Looks after which it is held.
        pub sleep_looks: u32,
        /// Patches of the audit along a side of the region, hashes below which are chosen, and their seed.
        pub patches: u32,
        pub audited: u32,
        pub seed: u32,
    }
}

cuda_enum! {
    /// Kinds of failures, in the order in which they are reported.
    pub(super) enum Failure: u64 {
        NOT_FINITE = 0,
        LEAK = 1,
        OVERLAP = 2,
        LIST_FULL = 3,
        BODIES_FULL = 4,
        BIN_FULL = 5,
    }
}
