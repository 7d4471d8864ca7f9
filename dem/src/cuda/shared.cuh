// What the threads of a block share.

// What every disc needs to know of the cell in one substep.
struct alignas(16) Substep {
    // Cell vectors (m) at its start.
    Matrix exact;
    // The same per unit of `Fraction`, row-major.
    Real cell[4];
    // From a velocity (m/s) to the units moved in the cell at its end, row-major.
    Real to_units[4];
    // Square of the displacement (m²) since the search up to which the list is complete at its
    // start; negative: search.
    Real allowed2;
    // Whether its stress counts, and whether no later one is planned.
    bool sampled, last;
};

// What one row of a warp reads of a neighbour in one access.
struct alignas(16) Body {
    Position s;
    // Peculiar velocity (m/s).
    Vec u;
};
// A neighbour is twice the offset of its seat in `half_w`; in `body` it is twice that again.
static_assert(sizeof(Position) == 2 * sizeof(Real) && sizeof(Body) == 4 * sizeof(Real));

// Slots of one disc, `LANES` apart.
struct Range {
    unsigned short first, end;
};

enum Action : unsigned { DONE, RESTART, ADVANCE };

struct alignas(16) Control {
    // Velocity gradient that acts on the cell, row-major (1/s), and half its spin.
    Real drive[4];
    // Cell vectors per unit of `Fraction` at the last search.
    Real reference_cell[4];
    Real half_spin;
    Real spin_change;
    // Mean velocity (m/s) at the start.
    Vec drift;
    // Area after a substep over the area before.
    Real growth;
    // The same velocity gradient.
    Matrix gradient;
    Header header;
    // The last lattice reduction, s' = transform s, and the cell before and after it.
    Fraction transform[4];
    Real old_cell[4];
    Real cell[4];
    int bins[2];
    // One over the widths of the cell (1/m).
    double per_width[2];
    unsigned old_imaged;
    unsigned searches;
    unsigned thin;
    unsigned dense;
    Action action;
    Status status;
    unsigned rve;
};

// Listed pairs at their owners' seats: for each warp, rows of one slot per lane.
struct Slots {
    // Distance at touch r_i + r_j (m), and dashpot (kg/s).
    Vec pair[SLOTS];
    // Tangential spring force (N): the history of the contact.
    Real tangential[SLOTS];
#if ROLLING
    // Rolling spring force (N), seen from the owner.
    Real rolling[SLOTS];
#endif
    // Seat of the neighbour times the size of a `Position`, and its image in the upper half.
    unsigned neighbour[SLOTS];
    // Slots of the pairs that a disc does not own, in rows of their own.
    unsigned short incoming[INCOMING_SLOTS];
};

// sum f (x) l + sum m u (x) u (N m) over the stress samples: xx, yy, and xy + yx. They refer to the
// area of the last one: `growth` carries them to the next.
struct Virial {
    Real xx, yy, shear;
};

// What is added up over the seats at the end; of overlaps, the largest.
enum Sum {
    VIRIAL_XX, VIRIAL_YY, VIRIAL_SHEAR, CONTACTS, MOMENTUM_X, MOMENTUM_Y, OVERLAPS,
#if UNEQUAL
    RESULTANTS, TOTAL_OVERLAP,
#endif
    SUMS
};

struct alignas(16) Binned {
    Position s;
    Real r;
    unsigned disc;
};

// Search bins along each cell vector, at most.
constexpr int BINS = 32;

struct Shared {
    // By seat, and by disc during a search.
    Body body[THREADS];
    // Half the angular velocity (1/s).
    Real half_w[THREADS];
    Slots slot;
    union {
        // What the owner of a pair leaves to the other disc: force (N) and torque (N m).
        struct {
            Vec force[SLOTS];
            Real torque[SLOTS];
        } reaction;
        struct {
            union {
                // By bins.
                Binned binned[THREADS];
                // Then who is near each disc, row by row.
                unsigned short near[ROWS][THREADS];
            };
            // By warp.
            Real fastest2[WARPS];
            union {
                unsigned bin_end[BINS * BINS];
                // Then radius and inverse mass of each disc.
                Vec constants[THREADS];
            };
            // Threads of each class in each warp.
            unsigned short census[WARPS][LANES];
            // By warp: rows of owned and of incoming slots, and the first slot of each.
            unsigned rows[2][LANES];
            unsigned first[2][LANES];
        } search;
        // Before the first and after the last substep, by seat.
        Real summand[SUMS][THREADS];
    };
    Real sum[SUMS];
    Substep substep[LANES];
    Control control;
    // By seat: slots of the pairs that the disc owns, and of the others.
    Range owned[THREADS];
    Range incoming[THREADS];
    // Disc of each seat, and during a search the seat of each disc.
    alignas(16) unsigned short disc[THREADS];
    unsigned short seat[THREADS];
    Copies copies;
};
static_assert(sizeof(Shared) <= SHARED_BYTES);

extern __shared__ __align__(16) unsigned char shared_memory[];
__device__ inline Shared& shared() { return *reinterpret_cast<Shared*>(shared_memory); }

__device__ inline Real warp_sum(Real x) {
    for (int d = LANES / 2; d > 0; d /= 2) x += __shfl_xor_sync(ALL, x, d);
    return x;
}

__device__ inline Real warp_max(Real x) {
    for (int d = LANES / 2; d > 0; d /= 2) x = max(x, __shfl_xor_sync(ALL, x, d));
    return x;
}
