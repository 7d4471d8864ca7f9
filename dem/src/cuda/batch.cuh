// Data shared with the host: rve.rs, state.rs and list.rs.
//
// Compile-time constants, defined by shape.rs:
//   REAL_BITS     32 or 64
//   DISCS         discs in an RVE
//   THREADS       DISCS rounded up to whole warps
//   ROWS          most neighbours a disc may have
//   SLOTS         room for the listed pairs at their owners; twice that at the other discs, whose
//                 numbers of pairs are more unequal
//   BLOCKS        thread blocks that one multiprocessor should hold
//   SHARED_BYTES  what shape.rs reserves for `Shared`

#if REAL_BITS == 32
using Real = float;
using Fraction = unsigned;
using Signed = int;
constexpr double PERIOD = 4294967296.0;
#else
using Real = double;
using Fraction = unsigned long long;
using Signed = long long;
constexpr double PERIOD = 18446744073709551616.0;
#endif

constexpr int LANES = 32;
constexpr int WARPS = THREADS / LANES;
constexpr unsigned ALL = 0xffffffffu;
constexpr int INCOMING_SLOTS = 2 * SLOTS;

static_assert(THREADS % LANES == 0 && DISCS <= THREADS && THREADS <= 1024);
// Rows are marked in 32-bit masks.
static_assert(ROWS <= 31 && SLOTS % LANES == 0 && INCOMING_SLOTS < 65536);

struct Matrix {
    double xx, xy, yx, yy;
};

struct alignas(2 * sizeof(Real)) Vec {
    Real x, y;
};

struct alignas(16) Motion {
    // Peculiar velocity (m/s), and half the angular velocity (1/s).
    Real x, y, half_w, unused;
};

// Reduced position: fractions of the two cell vectors.
struct alignas(2 * sizeof(Real)) Position {
    Fraction x, y;
};

struct alignas(4 * sizeof(Real)) Disc {
    Real r, inv_mass, inv_inertia, mass;
};

enum Status : unsigned { OK, NOT_FINITE, OVERLAP, LIST_FULL, SLOTS_FULL };

// What an RVE keeps between macro steps, besides its discs and their list.
struct Header {
    Matrix cell;
    // Cell vectors at the last search, and how far its list reaches beyond touch (m); 0: no list.
    Matrix reference_cell;
    double skin;
    // Largest distance at which two discs touch (m).
    double reach;
    // Area of all discs (m²) and their mass (kg).
    double solid;
    double mass;
    double spin;
    // Mean velocity (m/s) that the next macro step removes; NaN: not known.
    double drift_x, drift_y;
    // Cell area (m²) while stress-free, negative while loaded.
    double free_area;
    // Row of the table of discs.
    unsigned grading;
    // Whether the list holds images other than the nearest.
    unsigned imaged;
    // First failure; the RVE then stands still.
    unsigned status;
    // Macro steps since the upload.
    unsigned steps;
    // Slots in use, of pairs at their owners and of the same at the other discs.
    unsigned owned, incoming;
};

// Slots of one disc: of the pairs that it owns, one per row of slots, and of the others.
struct alignas(8) Rows {
    unsigned short owned, owned_end, incoming, incoming_end;
};

// RveState of the CPU.
struct State {
    Matrix stress;
    double area, solid_fraction, coordination, relative_overlap, min_width;
    unsigned searches, free, thin, unused;
};

// RVEs queued for the next launch, from the front (upper half) and from the back, and the number of
// this launch.
struct Queue {
    unsigned long long queued;
    unsigned launch;
};

// Arrays over RVEs; index `rves` holds the fresh packing.
struct Batch {
    Header* header;
    State* state;
    // By seat; `reference` is the position at the last search, `seated` the disc.
    Position* position;
    Motion* motion;
    Position* reference;
    unsigned short* seated;
    Rows* rows;
    // By slot: neighbour (see `Slots`), distance at touch (m) and dashpot (kg/s), tangential spring
    // force (N), and the slot of a pair at its owner.
    unsigned* neighbour;
    Vec* pair;
    Real* tangential;
    unsigned short* incoming;
    const Disc* disc;
    // Lowest index of an RVE that failed.
    int* failed;
    // RVE of each block, in launches of even and of odd number.
    uint2* turn;
    Queue* queue;
};

struct Parameters {
    double dt;
    // One over thickness (m) and number of stress samples.
    double stress_weight;
    // Bounds of the Verlet skin (m).
    double least_skin;
    double skin;
    double free_solid_fraction;
    // Width (m) below which a cell is not thinned further.
    double thin_width;
    double overlap_limit;
    Real step;
    Real normal_stiffness;
    // kt dt, and 2 zeta.
    Real spring;
    Real dashpot;
    Real friction;
    Real local_damping;
    unsigned rves;
    unsigned substeps;
    unsigned samples;
    unsigned kinetic;
};
