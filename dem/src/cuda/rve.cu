// One macro step of a batch of RVEs: one thread block per RVE, one thread per disc.
//
// The CPU twin is `Rve::advance` in dem/src/rve.rs; formulas are explained there and in the files
// it calls. What differs is only how the work is laid out:
//
// * One disc of each pair, its owner, evaluates the contact, adds the force to its own sum and leaves
//   the reaction in shared memory; after a barrier the other disc adds it to its sum. There are no
//   atomics on forces, every sum has a fixed order, and the result does not depend on timing.
// * A macro step begins by picking the *active* neighbours out of the Verlet list: those closer
//   than `active_skin`. Substeps visit only these, from shared memory. They are picked anew when
//   discs moved so far that another pair could touch.
// * Threads take the discs in the order of falling numbers of owned, then of other active pairs
//   ("seats"), so that the lanes of a warp finish together. Sums do not depend on the seat:
//   pairs are visited in the order of the list, which ascends by neighbour and image.
//
// Compile-time constants, defined by rve.rs:
//   REAL_BITS     32 or 64
//   DISCS         discs in an RVE
//   THREADS       DISCS rounded up to whole warps
//   ROWS          most neighbours a disc may have in its list
//   SLOTS         room for the active pairs
//   BLOCKS        thread blocks that one multiprocessor should hold
//   SHARED_BYTES  what rve.rs reserves for `Shared`

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
// Search bins along each cell vector, at most.
constexpr int BINS = 32;

static_assert(THREADS % LANES == 0 && DISCS <= THREADS && THREADS <= 1024);
// Rows are marked in 32-bit masks, and an `entry` holds a row in five bits.
static_assert(ROWS <= 31 && SLOTS < 65536);

// ---------------------------------------------------------------------------------------------
// Data shared with the host (rve.rs, state.rs)

struct Matrix {
    double xx, xy, yx, yy;
};

struct alignas(2 * sizeof(Real)) Vec {
    Real x, y;
};

// Reduced position: fractions of the two cell vectors.
struct alignas(2 * sizeof(Real)) Position {
    Fraction x, y;
};

struct alignas(4 * sizeof(Real)) Disc {
    Real r, inv_mass, inv_inertia, unused;
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
    // Cell area (m²) while stress-free, negative while loaded.
    double free_area;
    // Area (m²) that area ratios refer to.
    double reference_area;
    // Row of the table of discs.
    unsigned grading;
    // Whether the list holds images other than the nearest.
    unsigned imaged;
    // First failure; the RVE then stands still.
    unsigned status;
    // Macro steps since the upload.
    unsigned steps;
};

// RveState of the CPU.
struct State {
    Matrix stress;
    double area, solid_fraction, coordination, relative_overlap, min_width;
    unsigned searches, free, thin, unused;
};

// Arrays over RVEs; index `rves` holds the fresh packing. Within an RVE by disc, or by row and disc.
struct Batch {
    Header* header;
    State* state;
    Position* position;
    Vec* velocity;
    Real* spin;
    Position* reference;
    unsigned char* listed;
    // Neighbour and, from bit 10, the row that has this pair in the neighbour's list.
    unsigned short* neighbour;
    unsigned short* image;
    // Tangential spring force (N), kept by the owner of the pair.
    Real* tangential;
    const Disc* disc;
    // Outputs for the material point method: Cauchy stress (Pa), and area over the reference area.
    Matrix* stress;
    double* area_ratio;
    // Lowest index of an RVE that failed.
    int* failed;
};

struct Parameters {
    double dt;
    double thickness;
    double skin;
    double active_skin;
    double free_solid_fraction;
    // Width (m) below which a cell is not thinned further.
    double thin_width;
    double overlap_limit;
    Real step;
    Real normal_stiffness;
    // kt dt, and 2 zeta sqrt(kn).
    Real spring;
    Real dashpot;
    Real friction;
    Real local_damping;
    unsigned rves;
    unsigned substeps;
    unsigned samples;
    unsigned kinetic;
};

// ---------------------------------------------------------------------------------------------
// Shared memory

// What every disc needs to know of the cell during one substep.
struct alignas(16) Substep {
    // Cell vectors per unit of `Fraction` at its start, row-major.
    Real cell[4];
    // From a velocity (m/s) to the units moved in the cell at its end, row-major.
    Real to_units[4];
    // Square of the displacement up to which no further pair can touch; negative: inspect the list.
    Real allowed2;
    // Cell vectors at its end (m).
    Matrix after;
};

// A contact as its owner leaves it to the other disc: the force on that one (N), the tangential
// spring force (N), which is also the contact's history, and the overlap (m).
struct alignas(16) Contact {
    Real x, y, tangential, overlap;
};

struct alignas(16) Motion {
    // Peculiar velocity (m/s), half the angular velocity (1/s), and r w (m/s).
    Real x, y, half_w, rim;
};
// A slot holds the offset of its neighbour in `position`; in `motion` it is twice that.
static_assert(sizeof(Motion) == 2 * sizeof(Position));

enum Action : unsigned { DONE, RESTART, ADVANCE };

struct alignas(16) Control {
    // Velocity gradient that acts on the cell, row-major (1/s), and half its spin.
    Real drive[4];
    Real half_spin;
    // What it does to the cell in one substep.
    Matrix increment;
    Header header;
    // Cell vectors per unit of `Fraction` now, and at the last search.
    Real cell[4];
    Real reference_cell[4];
    // Square of the displacement since the search up to which the list is complete.
    Real allowed2;
    Real spin_change;
    // Area after a substep over the area before.
    Real growth;
    // The last lattice reduction: s' = transform s, and the cell before it.
    Fraction transform[4];
    Real old_cell[4];
    int bins[2];
    unsigned old_imaged;
    unsigned searches;
    unsigned thin;
    Action action;
    Status status;
};

struct Shared {
    Position position[THREADS];
    Motion motion[THREADS];
    union {
        // Active pairs at their owners' seats: for each warp, rows of one slot per lane.
        struct {
            Contact contact[SLOTS];
            // Distance at touch r_i + r_j (m), and dashpot (kg/s).
            Vec pair[SLOTS];
            // Offset of the neighbour's seat in `position` (bytes), and its image in the upper half.
            unsigned neighbour[SLOTS];
            // Slots of the pairs that a disc does not own, in rows of their own.
            unsigned short incoming[SLOTS];
        } slot;
        struct {
            unsigned end[BINS * BINS];
            unsigned short disc[THREADS];
        } bin;
        // Threads of each class in each warp.
        unsigned short census[WARPS][LANES];
        Vec partial[WARPS];
    };
    Substep substep[LANES];
    Control control;
    // Mask over the list rows of disc i: which are active pairs that it owns.
    unsigned owned[THREADS];
    // Thread that handles disc i, disc that thread i handles, and how many pairs that disc owns and,
    // in the upper byte, does not own.
    unsigned short seat[THREADS];
    unsigned short disc[THREADS];
    unsigned short pairs[THREADS];
    // By warp: rows of slots and the first slot, for owned pairs and for the others.
    unsigned rows[2][LANES];
    unsigned short first[2][LANES];
};
static_assert(sizeof(Shared) <= SHARED_BYTES);

extern __shared__ __align__(16) unsigned char shared_memory[];
__device__ inline Shared& shared() { return *reinterpret_cast<Shared*>(shared_memory); }

// ---------------------------------------------------------------------------------------------
// Cell (cell.rs)

__device__ inline Matrix product(const Matrix& a, const Matrix& b) {
    return {a.xx * b.xx + a.xy * b.yx, a.xx * b.xy + a.xy * b.yy,
            a.yx * b.xx + a.yy * b.yx, a.yx * b.xy + a.yy * b.yy};
}

__device__ inline Matrix scaled(const Matrix& a, double k) {
    return {a.xx * k, a.xy * k, a.yx * k, a.yy * k};
}

__device__ inline double determinant(const Matrix& a) { return a.xx * a.yy - a.xy * a.yx; }

__device__ inline Matrix inverse(const Matrix& a) {
    const double det = determinant(a);
    return {a.yy / det, -a.xy / det, -a.yx / det, a.xx / det};
}

__device__ inline bool finite(const Matrix& a) {
    return isfinite(a.xx) && isfinite(a.xy) && isfinite(a.yx) && isfinite(a.yy);
}

// Perpendicular widths between the edges crossed by the first and by the second cell vector.
__device__ inline double2 widths(const Matrix& h) {
    const double area = fabs(determinant(h));
    return {area / sqrt(h.xy * h.xy + h.yy * h.yy), area / sqrt(h.xx * h.xx + h.yx * h.yx)};
}

__device__ inline double min_width(const Matrix& h) {
    const double2 w = widths(h);
    return fmin(w.x, w.y);
}

// Smallest singular value.
__device__ inline double min_stretch(const Matrix& f) {
    const double norm2 = f.xx * f.xx + f.xy * f.xy + f.yx * f.yx + f.yy * f.yy;
    const double det = determinant(f);
    const double root = sqrt(fmax(norm2 * norm2 - 4.0 * det * det, 0.0));
    return sqrt(fmax(0.5 * (norm2 - root), 0.0));
}

// exp(A) = e^(tr A / 2) (C I + S B), B traceless, C = cosh(sqrt d), S = sinh(sqrt d) / sqrt d with
// d = -det B of either sign: their power series in d, after halving A until |d| <= 1.
__device__ Matrix exponential(const Matrix& a) {
    const double half_trace = 0.5 * (a.xx + a.yy);
    const double bxx = 0.5 * (a.xx - a.yy);
    double d = bxx * bxx + a.xy * a.yx;
    int halvings = 0;
    while (fabs(d) > 1.0 && halvings < 64) {
        d *= 0.25;
        ++halvings;
    }
    double c = 1.0;
    double s = 1.0;
#pragma unroll
    for (int n = 9; n > 0; --n) {
        c = 1.0 + d * (1.0 / ((2 * n) * (2 * n - 1))) * c;
        s = 1.0 + d * (1.0 / ((2 * n + 1) * (2 * n))) * s;
    }
    // cosh 2q = 2 cosh² q - 1 and sinh 2q / 2q = (sinh q / q) cosh q.
    for (; halvings > 0; --halvings) {
        s *= c;
        c = 2.0 * c * c - 1.0;
    }
    const double e = exp(half_trace);
    return {e * (c + s * bxx), e * s * a.xy, e * s * a.yx, e * (c - s * bxx)};
}

// Whether a lattice reduction is due; if so, which vector loses how many times the other one.
__device__ inline bool oblique(const Matrix& h, int& target, double& k) {
    const double dot = h.xx * h.xy + h.yx * h.yy;
    const double aa = h.xx * h.xx + h.yx * h.yx;
    const double bb = h.xy * h.xy + h.yy * h.yy;
    target = aa <= bb ? 1 : 0;
    k = round(dot / fmin(aa, bb));
    return !(fabs(dot) <= 0.5 * fmin(aa, bb) * (1.0 + 1e-9));
}

__device__ inline void to_real(const Matrix& a, Real* out) {
    out[0] = Real(a.xx);
    out[1] = Real(a.xy);
    out[2] = Real(a.yx);
    out[3] = Real(a.yy);
}

// ---------------------------------------------------------------------------------------------
// Positions (real.rs)

__device__ inline Real length2(const Real* cell, Vec d) {
    const Real x = cell[0] * d.x + cell[1] * d.y;
    const Real y = cell[2] * d.x + cell[3] * d.y;
    return x * x + y * y;
}

// Nearest image of b - a, in units of `Fraction`.
__device__ inline Vec nearest(Position a, Position b) {
    return {Real(Signed(b.x - a.x)), Real(Signed(b.y - a.y))};
}

// An image along one cell vector: seven bits, shift + 32 and whether the reading is unsigned.
__device__ inline unsigned image_code(int shift, bool is_unsigned) {
    return unsigned(shift + 32) << 1 | unsigned(is_unsigned);
}

// The image of i seen from j, if `code` is that of j seen from i, along one cell vector.
__device__ inline unsigned reversed(unsigned code) {
    const bool is_unsigned = code & 1u;
    return image_code(32 - int(code >> 1) - int(is_unsigned), is_unsigned);
}

// Both cell vectors: seven bits each, that of the second one above.
constexpr unsigned ZERO_IMAGE = 64u << 7 | 64u;

// Which disc of a pair evaluates it. Of two images of a disc itself, the positive one.
__device__ inline bool owns(unsigned i, unsigned j, unsigned image) {
    return i == j ? image > ZERO_IMAGE : (i < j) == (((i ^ j) & 1u) == 0);
}

// d + k periods, where d is the signed difference; odd in (d, k).
__device__ inline Real image(Fraction difference, unsigned code) {
    const Signed d = Signed(difference);
    const bool carry = (code & 1u) != 0 && d < 0;
    const int k = int(code >> 1) - 32 + int(carry);
#if REAL_BITS == 32
    return Real((long long)d + (long long)k * 4294967296LL);
#else
    return Real(d) + k * PERIOD;
#endif
}

// Branch from a to its neighbour b in units of `Fraction`; the image is in the upper half of `word`.
template <bool IMAGED>
__device__ inline Vec separation(Position a, Position b, unsigned word) {
    if (IMAGED) {
        return {image(b.x - a.x, word >> 16 & 127u), image(b.y - a.y, word >> 23)};
    }
    return nearest(a, b);
}

__device__ inline Fraction moved(Fraction s, Real units) {
#if REAL_BITS == 32
    return s + Fraction(__float2int_rn(units));
#else
    return s + Fraction(__double2ll_rn(units));
#endif
}

__device__ inline int bin_of(Fraction s, int bins) {
#if REAL_BITS == 32
    return int(__umulhi(s, unsigned(bins)));
#else
    return int(__umul64hi(s, (unsigned long long)(bins)));
#endif
}

// ---------------------------------------------------------------------------------------------
// Device memory

// One RVE's part of the batch, for one disc.
struct Own {
    const Batch& batch;
    unsigned rve;
    unsigned i;

    __device__ Own(const Batch& batch, unsigned rve, unsigned i) : batch(batch), rve(rve), i(i) {}
    __device__ Position& position() const { return batch.position[rve * THREADS + i]; }
    __device__ Vec& velocity() const { return batch.velocity[rve * THREADS + i]; }
    __device__ Real& spin() const { return batch.spin[rve * THREADS + i]; }
    __device__ Position& reference() const { return batch.reference[rve * THREADS + i]; }
    __device__ unsigned char& listed() const { return batch.listed[rve * THREADS + i]; }
    // Of one row of its list.
    __device__ unsigned short& neighbour(int row) const { return batch.neighbour[entry(row)]; }
    __device__ unsigned neighbour_disc(int row) const { return neighbour(row) & 1023u; }
    __device__ unsigned short& image(int row) const { return batch.image[entry(row)]; }
    __device__ Real& tangential(int row) const { return batch.tangential[entry(row)]; }
    __device__ size_t entry(int row) const { return (size_t(rve) * ROWS + row) * THREADS + i; }
};

// The fresh packing, disc by disc.
__device__ void copy_packing(const Own& to, const Own& from) {
    to.position() = from.position();
    to.velocity() = from.velocity();
    to.spin() = from.spin();
    to.reference() = from.reference();
    to.listed() = from.listed();
    for (int row = 0; row < from.listed(); ++row) {
        to.neighbour(row) = from.neighbour(row);
        to.image(row) = from.image(row);
        to.tangential(row) = from.tangential(row);
    }
}

// ---------------------------------------------------------------------------------------------
// Decisions of one thread for the whole RVE

// How far discs may have moved since the search before the list must be renewed (neighbours.rs).
//
// A pair not listed was further apart than R + skin, R = r_i + r_j. Displacements D, measured in
// the cell of the search, and the affine motion of smallest stretch s <= 1 leave at least
// s (R + skin - 2 D). That must exceed R + active_skin for all R up to `reach`, so that a pair
// which is neither listed nor active has that gap.
__device__ void inspect(Control& c, const Parameters& p) {
    const Header& h = c.header;
    int target;
    double k;
    to_real(scaled(h.cell, 1.0 / PERIOD), c.cell);
    to_real(scaled(h.reference_cell, 1.0 / PERIOD), c.reference_cell);
    c.allowed2 = Real(-1);
    if (h.skin > 0.0 && !oblique(h.cell, target, k)) {
        const double s = fmin(1.0, min_stretch(product(h.cell, inverse(h.reference_cell))));
        const double allowed = 0.5 * (h.reach + h.skin - (h.reach + p.active_skin) / s);
        if (allowed > 0.0) c.allowed2 = Real(allowed * allowed);
    }
}

__device__ State free_state(double area, double solid_fraction) {
    State state = {};
    state.area = area;
    state.solid_fraction = solid_fraction;
    state.min_width = 1.0 / 0.0;
    state.free = 1;
    return state;
}

// What happens before discs move.
__device__ Action begin(Control& c, const Batch& b, const Parameters& p, int rve, const Matrix& l) {
    c.header = b.header[rve];
    c.searches = 0;
    c.thin = 0;
    c.status = OK;
    Header& h = c.header;
    if (h.status != OK) return DONE;
    h.steps += 1;
    const double dt = p.dt * p.substeps;
    if (!finite(l)) {
        c.status = NOT_FINITE;
        return DONE;
    }

    const double area = determinant(h.cell);
    if (h.free_area < 0.0 && h.solid / area < p.free_solid_fraction) h.free_area = area;
    if (h.free_area >= 0.0) {
        // A stress-free RVE only keeps its area; dense enough again, it restarts from the fresh
        // packing scaled to that area.
        h.free_area *= exp((l.xx + l.yy) * dt);
        const Header& fresh = b.header[p.rves];
        const double ratio = h.free_area / determinant(fresh.cell);
        const double solid_fraction = fresh.solid / h.free_area;
        b.state[rve] = free_state(h.free_area, solid_fraction);
        b.stress[rve] = Matrix{};
        b.area_ratio[rve] = h.free_area / h.reference_area;
        if (solid_fraction < p.free_solid_fraction) return DONE;
        const Header old = h;
        h = fresh;
        h.cell = scaled(fresh.cell, sqrt(ratio));
        h.free_area = -1.0;
        h.reference_area = old.reference_area;
        h.steps = old.steps;
        return RESTART;
    }

    Matrix drive = l;
    const double width = min_width(h.cell);
    if (width < p.thin_width &&
        !(min_width(product(exponential(scaled(l, dt)), h.cell)) >= width)) {
        const double spin = 0.5 * (l.yx - l.xy);
        const double volumetric = 0.5 * (l.xx + l.yy);
        drive = {volumetric, -spin, spin, volumetric};
        c.thin = 1;
    }
    to_real(drive, c.drive);
    c.increment = exponential(scaled(drive, p.dt));
    c.growth = Real(determinant(c.increment));
    const double spin = 0.5 * (drive.yx - drive.xy);
    c.half_spin = Real(0.5 * spin);
    c.spin_change = Real(spin - h.spin);
    h.spin = spin;
    inspect(c, p);
    return ADVANCE;
}

// Lattice reduction until the cell vectors are as short as can be, and what the search needs.
__device__ void reduce_lattice(Control& c, const Parameters& p) {
    Header& h = c.header;
    Fraction m[4] = {1, 0, 0, 1};
    int target;
    double k;
    for (int i = 0; i < 4; ++i) c.old_cell[i] = c.cell[i];
    // Terminates as every step shortens a vector; the bound is for cells that are not finite.
    for (int step = 0; step < 64 && oblique(h.cell, target, k); ++step) {
        const Fraction n = Fraction(Signed(k));
        if (target == 1) {
            h.cell.xy -= k * h.cell.xx;
            h.cell.yy -= k * h.cell.yx;
            m[0] += n * m[2];
            m[1] += n * m[3];
        } else {
            h.cell.xx -= k * h.cell.xy;
            h.cell.yx -= k * h.cell.yy;
            m[2] += n * m[0];
            m[3] += n * m[1];
        }
    }
    for (int i = 0; i < 4; ++i) c.transform[i] = m[i];

    h.reference_cell = h.cell;
    h.skin = p.skin;
    const double2 w = widths(h.cell);
    // With three bins each way no pair within reach has a second image within reach.
    const double x = floor(w.x / (h.reach + p.skin));
    const double y = floor(w.y / (h.reach + p.skin));
    c.old_imaged = h.imaged;
    h.imaged = !(x >= 3.0 && y >= 3.0);
    c.bins[0] = int(fmin(x, double(BINS)));
    c.bins[1] = int(fmin(y, double(BINS)));
    c.searches += 1;
    inspect(c, p);
}

// The cell in the next substeps: lane k tells substep `done + k`.
__device__ void plan_substeps(const Parameters& p, int done, int lane) {
    Shared& sh = shared();
    const Control& c = sh.control;
    if (done + lane >= int(p.substeps)) return;
    const Matrix start = c.header.cell;
    Matrix h = start;
    for (int k = 0; k < lane; ++k) h = product(c.increment, h);
    Substep& s = sh.substep[lane];
    to_real(scaled(h, 1.0 / PERIOD), s.cell);
    s.after = product(c.increment, h);
    const Matrix inv = inverse(s.after);
    if (!finite(inv)) sh.control.status = NOT_FINITE;
    to_real(scaled(inv, p.dt * PERIOD), s.to_units);

    // As in `inspect`, between the gap `active_skin` at the start and touch.
    int target;
    double k;
    const double stretch = fmin(1.0, min_stretch(product(s.after, inverse(start))));
    const double allowed =
        0.5 * (c.header.reach + p.active_skin - c.header.reach / stretch);
    s.allowed2 = allowed > 0.0 && !oblique(s.after, target, k) ? Real(allowed * allowed) : Real(-1);
}

// ---------------------------------------------------------------------------------------------
// Sums over the block, in a fixed order

__device__ inline Real warp_sum(Real x) {
    for (int d = LANES / 2; d > 0; d /= 2) x += __shfl_xor_sync(ALL, x, d);
    return x;
}

// Sum of two numbers over all threads, the same in every thread.
__device__ Vec block_sum(Real x, Real y, int t) {
    Shared& sh = shared();
    const Vec own = {warp_sum(x), warp_sum(y)};
    __syncthreads();
    if (t % LANES == 0) sh.partial[t / LANES] = own;
    __syncthreads();
    const int warp = t % LANES;
    const Vec other = warp < WARPS ? sh.partial[warp] : Vec{};
    return {warp_sum(other.x), warp_sum(other.y)};
}

// The largest of a number over all threads, the same in every thread.
__device__ Real block_max(Real x, int t) {
    Shared& sh = shared();
    for (int d = LANES / 2; d > 0; d /= 2) x = max(x, __shfl_xor_sync(ALL, x, d));
    __syncthreads();
    if (t % LANES == 0) sh.partial[t / LANES].x = x;
    __syncthreads();
    x = t % LANES < WARPS ? sh.partial[t % LANES].x : Real(0);
    for (int d = LANES / 2; d > 0; d /= 2) x = max(x, __shfl_xor_sync(ALL, x, d));
    return x;
}

// ---------------------------------------------------------------------------------------------
// Verlet list (neighbours.rs)

// Neighbours of one disc while they are searched, ascending by neighbour and image.
struct Found {
    unsigned word[ROWS];
    int count;
    bool full;

    // `word` orders by neighbour first: neighbour << 16 | image.
    __device__ void insert(unsigned entry) {
        if (count == ROWS) {
            full = true;
            return;
        }
        int k = count++;
        for (; k > 0 && word[k - 1] > entry; --k) word[k] = word[k - 1];
        word[k] = entry;
    }
};

// Counting sort of the discs into bins. Within a bin their order depends on timing, but `Found`
// sorts them.
__device__ void fill_bins(Position s, int t) {
    Shared& sh = shared();
    const int nx = sh.control.bins[0];
    const int ny = sh.control.bins[1];
    const int bin = bin_of(s.y, ny) * nx + bin_of(s.x, nx);
    for (int b = t; b < nx * ny; b += THREADS) sh.bin.end[b] = 0;
    __syncthreads();
    if (t < DISCS) atomicAdd(&sh.bin.end[bin], 1u);
    __syncthreads();
    if (t < LANES) {
        unsigned before = 0;
        for (int b = t; b - t < nx * ny; b += LANES) {
            const unsigned own = b < nx * ny ? sh.bin.end[b] : 0;
            unsigned sum = own;
            for (int d = 1; d < LANES; d *= 2) {
                const unsigned other = __shfl_up_sync(ALL, sum, d);
                if (t >= d) sum += other;
            }
            if (b < nx * ny) sh.bin.end[b] = before + sum - own;
            before += __shfl_sync(ALL, sum, LANES - 1);
        }
    }
    __syncthreads();
    // Each bin's start walks up to its end.
    if (t < DISCS) sh.bin.disc[atomicAdd(&sh.bin.end[bin], 1u)] = (unsigned short)t;
    __syncthreads();
}

// Nearest images in the 3 x 3 bins around disc i.
__device__ void find_binned(Found& found, Position s, Real r, Real skin, int i) {
    const Shared& sh = shared();
    const int nx = sh.control.bins[0];
    const int ny = sh.control.bins[1];
    const int bx = bin_of(s.x, nx);
    const int by = bin_of(s.y, ny);
    for (int dy = ny - 1; dy <= ny + 1; ++dy) {
        for (int dx = nx - 1; dx <= nx + 1; ++dx) {
            const int bin = (by + dy) % ny * nx + (bx + dx) % nx;
            const int end = int(sh.bin.end[bin]);
            for (int k = bin == 0 ? 0 : int(sh.bin.end[bin - 1]); k < end; ++k) {
                const unsigned j = sh.bin.disc[k];
                const Real range = r + sh.motion[j].x + skin;
                const Vec d = nearest(s, sh.position[j]);
                if (int(j) != i && length2(sh.control.cell, d) < range * range) {
                    found.insert(j << 16);
                }
            }
        }
    }
}

// All images of all discs around disc i, its own included: right for any cell.
__device__ void find_all_images(Found& found, Position s, Real r, double skin, int i) {
    const Shared& sh = shared();
    const Matrix h = sh.control.header.cell;
    const double2 w = widths(h);
    for (int j = 0; j < DISCS; ++j) {
        const double range = double(r) + double(sh.motion[j].x) + skin;
        const Vec d = nearest(s, sh.position[j]);
        const double x = double(d.x) / PERIOD;
        const double y = double(d.y) / PERIOD;
        // |s_x| > range / width_x puts the branch out of range whatever s_y is.
        const double most_x = range / w.x;
        const double most_y = range / w.y;
        const int last_x = int(floor(most_x - x));
        const int last_y = int(floor(most_y - y));
        for (int ky = int(ceil(-most_y - y)); ky <= last_y; ++ky) {
            for (int kx = int(ceil(-most_x - x)); kx <= last_x; ++kx) {
                if (i == j && kx == 0 && ky == 0) continue;
                const double sx = x + kx;
                const double sy = y + ky;
                const double lx = h.xx * sx + h.xy * sy;
                const double ly = h.yx * sx + h.yy * sy;
                if (!(sqrt(lx * lx + ly * ly) < range)) continue;
                // Near half a period the unsigned reading does not jump.
                const bool ux = fabs(x) > 0.25;
                const bool uy = fabs(y) > 0.25;
                const int shift_x = kx - int(ux && x < 0.0);
                const int shift_y = ky - int(uy && y < 0.0);
                if (min(shift_x, shift_y) < -32 || max(shift_x, shift_y) > 31) {
                    found.full = true;
                    continue;
                }
                found.insert(unsigned(j) << 16 | image_code(shift_y, uy) << 7 |
                             image_code(shift_x, ux));
            }
        }
    }
}

__device__ inline Vec branch(const Real* cell, Vec d) {
    return {cell[0] * d.x + cell[1] * d.y, cell[2] * d.x + cell[3] * d.y};
}

__device__ inline Vec any_separation(bool imaged, Position a, Position b, unsigned word) {
    return imaged ? separation<true>(a, b, word) : nearest(a, b);
}

// Position before the lattice reduction: its matrix has determinant 1.
__device__ inline Position before_reduction(const Fraction* m, Position s) {
    return {m[3] * s.x - m[1] * s.y, m[0] * s.y - m[2] * s.x};
}

// Tangential force that the owned pair with neighbour `word` had in the old list. Several images of
// one neighbour are told apart by their branch vectors, which a reduction does not change, except
// that of a disc's own two images the other one may be the owner now.
__device__ Real history(const Own& own, unsigned word, Position s) {
    const Shared& sh = shared();
    const Control& c = sh.control;
    const unsigned j = word >> 16;
    Real tangential = 0;
    for (int row = 0; row < own.listed(); ++row) {
        if (own.neighbour_disc(row) != j || own.tangential(row) == Real(0)) continue;
        bool same = true;
        if (c.header.imaged) {
            const unsigned old_word = unsigned(c.old_imaged ? own.image(row) : 0) << 16;
            const Position other = sh.position[j];
            const Vec now = branch(c.cell, separation<true>(s, other, word << 16));
            const Vec old = branch(c.old_cell,
                                   any_separation(c.old_imaged, before_reduction(c.transform, s),
                                                  before_reduction(c.transform, other), old_word));
            const Real sign = j == own.i && now.x * old.x + now.y * old.y < Real(0) ? -1 : 1;
            const Real dx = now.x - sign * old.x;
            const Real dy = now.y - sign * old.y;
            same = dx * dx + dy * dy < Real(0.01) * (now.x * now.x + now.y * now.y);
        }
        if (same) tangential = own.tangential(row);
    }
    return tangential;
}

// Row of the list of disc `other` that has the pair which disc i knows as `word`, or -1.
__device__ int partner_row(const Own& other, unsigned i, unsigned image, bool imaged) {
    const unsigned back = imaged ? reversed(image >> 7) << 7 | reversed(image & 127u) : 0u;
    for (int row = 0; row < other.listed(); ++row) {
        if (other.neighbour_disc(row) == i && other.image(row) == back) return row;
    }
    return -1;
}

// Renews the list of disc t, keeping the tangential forces. Discs are in their own order, with
// radii in `motion[].x`. Returns the position after lattice reduction.
__device__ __noinline__ Position search(const Batch& batch, const Parameters& p, Position s,
                                        Real r) {
    Shared& sh = shared();
    const int t = int(threadIdx.x);
    const Own own(batch, blockIdx.x, t);
    Control& c = sh.control;
    if (t == 0) reduce_lattice(c, p);
    __syncthreads();
    s = {c.transform[0] * s.x + c.transform[1] * s.y, c.transform[2] * s.x + c.transform[3] * s.y};
    sh.position[t] = s;
    __syncthreads();

    Found found;
    found.count = 0;
    found.full = false;
    if (c.header.imaged) {
        if (t < DISCS) find_all_images(found, s, r, p.skin, t);
    } else {
        fill_bins(s, t);
        if (t < DISCS) find_binned(found, s, r, Real(p.skin), t);
    }
    if (found.full) c.status = LIST_FULL;
    if (t < DISCS) {
        Real tangential[ROWS];
        for (int row = 0; row < found.count; ++row) {
            const unsigned word = found.word[row];
            const bool owner = owns(t, word >> 16, word & 0xffffu);
            tangential[row] = owner ? history(own, word, s) : Real(0);
        }
        for (int row = 0; row < found.count; ++row) {
            own.neighbour(row) = (unsigned short)(found.word[row] >> 16);
            own.image(row) = (unsigned short)(found.word[row] & 0xffffu);
            own.tangential(row) = tangential[row];
        }
        own.listed() = (unsigned char)found.count;
        own.reference() = s;
    }
    __syncthreads();
    for (int row = 0; t < DISCS && row < found.count; ++row) {
        const unsigned j = found.word[row] >> 16;
        const int partner = partner_row(Own(batch, blockIdx.x, j), t, found.word[row] & 0xffffu,
                                        c.header.imaged);
        // Only a full list misses it. Others may read the entry now, but not its upper bits.
        if (partner < 0) c.status = LIST_FULL;
        own.neighbour(row) = (unsigned short)(j | unsigned(max(partner, 0)) << 10);
    }
    __syncthreads();
    return s;
}

// ---------------------------------------------------------------------------------------------
// Active pairs

// Masks over the list rows of a disc: active pairs that it owns, and that it does not own.
struct Active {
    unsigned owned, incoming;
};

// The pairs whose gap is below `active_skin`.
template <bool IMAGED>
__device__ Active select_active(const Own& own, Position s, Real r, Real active_skin) {
    const Shared& sh = shared();
    Active active = {0, 0};
    const int listed = own.listed();
#pragma unroll 4
    for (int row = 0; row < listed; ++row) {
        const unsigned j = own.neighbour_disc(row);
        const unsigned image = IMAGED ? own.image(row) : 0u;
        const bool owner = owns(own.i, j, image);
        const Real range = r + sh.motion[j].x + active_skin;
        const Vec d = separation<IMAGED>(s, sh.position[j], image << 16);
        if (length2(sh.control.cell, d) < range * range) {
            (owner ? active.owned : active.incoming) |= 1u << row;
        } else if (owner && own.tangential(row) != Real(0)) {
            // It parted in the last move.
            own.tangential(row) = Real(0);
        }
    }
    return active;
}

// Seats a disc: a stable counting sort of the block's threads by falling class. Also tells the rows
// that each warp needs.
__device__ void take_seat(int owned, int incoming, bool has_disc, int t) {
    Shared& sh = shared();
    const int lane = t % LANES;
    const int warp = t / LANES;
    // More pairs than these are rare; their classes need not be exact.
    const int kind = has_disc ? 1 + 5 * min(owned, 5) + min(incoming, 4) : 0;

    const unsigned peers = __match_any_sync(ALL, kind);
    const unsigned before = peers & ((1u << lane) - 1u);
    sh.census[warp][lane] = 0;
    if (warp == 0) sh.rows[0][lane] = sh.rows[1][lane] = 0;
    __syncwarp();
    if (before == 0) sh.census[warp][kind] = (unsigned short)__popc(peers);
    __syncthreads();

    // Lane = class: threads of it in earlier warps, and in all; then all of higher classes.
    int earlier = 0;
    int total = 0;
    for (int w = 0; w < WARPS; ++w) {
        const int n = sh.census[w][lane];
        earlier += w < warp ? n : 0;
        total += n;
    }
    int higher = total;
    for (int d = 1; d < LANES; d *= 2) {
        const int other = __shfl_down_sync(ALL, higher, d);
        if (lane + d < LANES) higher += other;
    }
    const int seat = __shfl_sync(ALL, higher - total + earlier, kind) + __popc(before);
    sh.seat[t] = (unsigned short)seat;
    sh.disc[seat] = (unsigned short)t;
    sh.pairs[seat] = (unsigned short)(owned | incoming << 8);
    atomicMax(&sh.rows[0][seat / LANES], unsigned(owned));
    atomicMax(&sh.rows[1][seat / LANES], unsigned(incoming));
    __syncthreads();

    // First slots of the warps: warp 0 those of owned pairs and, if there is one, warp 1 the others.
    for (int k = warp; k < 2; k += WARPS) {
        const unsigned own = LANES * sh.rows[k][lane];
        unsigned sum = own;
        for (int d = 1; d < LANES; d *= 2) {
            const unsigned other = __shfl_up_sync(ALL, sum, d);
            if (lane >= d) sum += other;
        }
        if (sum > SLOTS && sh.control.status == OK) sh.control.status = SLOTS_FULL;
        sh.first[k][lane] = (unsigned short)(sum - own);
    }
    __syncthreads();
}

__device__ inline int first_slot(int kind, int seat) {
    return shared().first[kind][seat / LANES] + seat % LANES;
}

// Copies the pairs that a disc owns to the slots of its seat, and finds the slots of the others.
__device__ void fill_slots(const Own& own, const Parameters& p, Active active) {
    Shared& sh = shared();
    const int seat = sh.seat[own.i];
    const Motion self = sh.motion[own.i];
    const bool imaged = sh.control.header.imaged;
    int slot = first_slot(0, seat);
    for (; active.owned != 0; active.owned &= active.owned - 1, slot += LANES) {
        const int row = __ffs(int(active.owned)) - 1;
        const unsigned j = own.neighbour_disc(row);
        const Motion other = sh.motion[j];
        const Real inv_mass = self.y + other.y;
#if REAL_BITS == 32
        const Real dashpot = p.dashpot * rsqrtf(inv_mass);
#else
        const Real dashpot = p.dashpot / sqrt(inv_mass);
#endif
        sh.slot.pair[slot] = {self.x + other.x, dashpot};
        sh.slot.contact[slot] = {Real(0), Real(0), own.tangential(row), Real(0)};
        sh.slot.neighbour[slot] =
            sh.seat[j] * sizeof(Position) | unsigned(imaged ? own.image(row) : 0) << 16;
    }
    slot = first_slot(1, seat);
    for (; active.incoming != 0; active.incoming &= active.incoming - 1, slot += LANES) {
        const unsigned entry = own.neighbour(__ffs(int(active.incoming)) - 1);
        const unsigned j = entry & 1023u;
        const unsigned earlier = sh.owned[j] & ((1u << (entry >> 10)) - 1u);
        sh.slot.incoming[slot] =
            (unsigned short)(first_slot(0, sh.seat[j]) + LANES * __popc(earlier));
    }
}

// ---------------------------------------------------------------------------------------------
// Substeps (contact.rs, integrate.rs)

// What a thread adds up for the whole RVE over the substeps.
struct Totals {
    // sum f (x) l + sum m u (x) u (N m) over the stress samples: xx, yy, and xy + yx. They refer to
    // the area of the last one: `growth` carries them to the next.
    Real xx, yy, shear;
    // Largest overlap of the disc now in this seat (m), and of all that were, over their radius.
    // Over both discs of a pair that is the overlap over the smaller radius.
    Real overlap, relative_overlap;
};

// Minus the force (N) and minus the torque (N m) on a disc.
struct Resistance {
    Real x, y, torque;
};

template <class T>
__device__ inline const T& at(const T* array, unsigned offset) {
    return *reinterpret_cast<const T*>(reinterpret_cast<const unsigned char*>(array) + offset);
}

template <bool IMAGED, bool SAMPLED>
__device__ inline Resistance contact_forces(const Parameters& p, const Real* cell,
                                            const Real* drive, Position s, const Motion& m, Real r,
                                            int slot, int end, Totals& total) {
    Shared& sh = shared();
    Resistance sum = {};
    const Real h0 = cell[0], h1 = cell[1], h2 = cell[2], h3 = cell[3];
#pragma unroll 1
    for (; slot < end; slot += LANES) {
        const unsigned word = sh.slot.neighbour[slot];
        const Vec pair = sh.slot.pair[slot];
        const unsigned offset = IMAGED ? word & 0xffffu : word;
        const Vec d = separation<IMAGED>(s, at(sh.position, offset), word);
        const Real lx = h0 * d.x + h1 * d.y;
        const Real ly = h2 * d.x + h3 * d.y;
        const Real distance2 = lx * lx + ly * ly;
        const Real touch = pair.x;
        Contact contact = {};
        if (distance2 < touch * touch) {
#if REAL_BITS == 32
            // One Newton step takes the length to within half a unit in the last place or so.
            const Real inverse_length = rsqrtf(distance2);
            const Real guess = distance2 * inverse_length;
            const Real length =
                fmaf(fmaf(-guess, guess, distance2), Real(0.5) * inverse_length, guess);
#else
            const Real length = sqrt(distance2);
            const Real inverse_length = Real(1) / length;
#endif
            const Real nx = lx * inverse_length;
            const Real ny = ly * inverse_length;
            const Real overlap = touch - length;
            const Motion other = at(sh.motion, 2 * offset);

            // v = u_j - u_i + L l, normal and along tau = (-n_y, n_x); rolling is
            // (r_i - overlap / 2) w_i + (r_j - overlap / 2) w_j.
            const Real vx = other.x - m.x + drive[0] * lx + drive[1] * ly;
            const Real vy = other.y - m.y + drive[2] * lx + drive[3] * ly;
            const Real rolling = (m.rim + other.rim) - overlap * (m.half_w + other.half_w);
            const Real vn = vx * nx + vy * ny;
            const Real vt = (vy * nx - vx * ny) - rolling;

            // The dashpot must not pull: f_n >= 0.
            const Real normal = max(p.normal_stiffness * overlap - pair.y * vn, Real(0));
            const Real limit = p.friction * normal;
            const Real trial = sh.slot.contact[slot].tangential - p.spring * vt;
            const Real tangential = min(max(trial, -limit), limit);

            const Real fx = normal * nx - tangential * ny;
            const Real fy = normal * ny + tangential * nx;
            sum.x += fx;
            sum.y += fy;
            sum.torque += tangential * (r - Real(0.5) * overlap);
            contact = {fx, fy, tangential, overlap};
            total.overlap = max(total.overlap, overlap);
            if (SAMPLED) {
                total.xx += fx * lx;
                total.yy += fy * ly;
                total.shear += fx * ly;
                total.shear += fy * lx;
            }
        }
        sh.slot.contact[slot] = contact;
    }
    return sum;
}

// Adds the reactions of the pairs that the disc does not own.
__device__ inline void add_reactions(Resistance& sum, Real r, int slot, int end, Real& overlap) {
    const Shared& sh = shared();
#pragma unroll 1
    for (; slot < end; slot += LANES) {
        const Contact c = sh.slot.contact[sh.slot.incoming[slot]];
        sum.x -= c.x;
        sum.y -= c.y;
        sum.torque += c.tangential * (r - Real(0.5) * c.overlap);
        overlap = max(overlap, c.overlap);
    }
}

// Cundall local damping: `resisting` is minus the force.
__device__ inline Real damped(Real resisting, Real velocity, Real alpha) {
    const Real power = resisting * velocity;
    return resisting - (power < Real(0) ? alpha : power > Real(0) ? -alpha : Real(0)) * resisting;
}

// Substeps from `done` on, until all are done or the active neighbours must be picked anew;
// returns how many are done then. Discs are in the order of seats.
template <bool IMAGED>
__device__ int advance_substeps(const Parameters& p, const Disc& disc, Totals& total, int done,
                                int t) {
    Shared& sh = shared();
    const Control& c = sh.control;
    const Real drive[4] = {c.drive[0], c.drive[1], c.drive[2], c.drive[3]};
    const int slot = first_slot(0, t);
    const int end = slot + (sh.pairs[t] & 255) * LANES;
    const int incoming = first_slot(1, t);
    const int incoming_end = incoming + (sh.pairs[t] >> 8) * LANES;
    const int steps = min(int(p.substeps) - done, LANES);
    const int first_sample = int(p.substeps - p.samples) - done;
    const Position start = sh.position[t];
    Position s = start;
    Motion m = sh.motion[t];
    const Real kick = p.step * disc.inv_mass;
    const Real half_twist = Real(0.5) * p.step * disc.inv_inertia;
    total.overlap = 0;

    int k = 0;
    bool again;
    do {
        const Substep& now = sh.substep[k];
        const bool sampled = k >= first_sample;
        Resistance f;
        if (sampled) {
            total.xx *= c.growth;
            total.yy *= c.growth;
            total.shear *= c.growth;
            f = contact_forces<IMAGED, true>(p, now.cell, drive, s, m, disc.r, slot, end, total);
        } else {
            f = contact_forces<IMAGED, false>(p, now.cell, drive, s, m, disc.r, slot, end, total);
        }
        // The barrier publishes the reactions, and every thread has read its neighbours.
        __syncthreads();
        add_reactions(f, disc.r, incoming, incoming_end, total.overlap);
        if (p.local_damping != Real(0)) {
            f.x = damped(f.x, m.x, p.local_damping);
            f.y = damped(f.y, m.y, p.local_damping);
            f.torque = damped(f.torque, m.half_w - c.half_spin, p.local_damping);
        }
        const Real vx = m.x - f.x * kick - p.step * (drive[0] * m.x + drive[1] * m.y);
        const Real vy = m.y - f.y * kick - p.step * (drive[2] * m.x + drive[3] * m.y);
        m.x = vx;
        m.y = vy;
        m.half_w -= f.torque * half_twist;
        m.rim = Real(2) * disc.r * m.half_w;
        s.x = moved(s.x, now.to_units[0] * vx + now.to_units[1] * vy);
        s.y = moved(s.y, now.to_units[2] * vx + now.to_units[3] * vy);
        if (sampled && p.kinetic) {
            // m u (x) u with the velocities after the move; m = dt / kick.
            const Real mass = p.step / kick;
            total.xx += mass * vx * vx;
            total.yy += mass * vy * vy;
            total.shear += Real(2) * mass * vx * vy;
        }
        sh.position[t] = s;
        sh.motion[t] = m;
        const bool far = !(length2(sh.substep[0].cell, nearest(start, s)) <= now.allowed2);
        // The barrier also publishes the new positions.
        again = __syncthreads_or(far);
        ++k;
    } while (!again && k < steps);
    if (t == 0) sh.control.header.cell = sh.substep[k - 1].after;
    total.relative_overlap = max(total.relative_overlap, total.overlap / disc.r);
    return done + k;
}

// ---------------------------------------------------------------------------------------------

extern "C" __global__ void __launch_bounds__(THREADS, BLOCKS)
rve_advance(const __grid_constant__ Batch batch, const __grid_constant__ Parameters p,
            const Matrix* __restrict__ velocity_gradient) {
    Shared& sh = shared();
    Control& c = sh.control;
    const int rve = int(blockIdx.x);
    const int t = int(threadIdx.x);
    const Own own(batch, rve, t);

    if (t == 0) {
        c.action = begin(c, batch, p, rve, velocity_gradient[rve]);
        if (c.action != ADVANCE) {
            if (c.status != OK) {
                c.header.status = c.status;
                atomicMin(batch.failed, rve);
            }
            batch.header[rve] = c.header;
        }
    }
    __syncthreads();
    if (c.action == RESTART) copy_packing(own, Own(batch, p.rves, t));
    if (c.action != ADVANCE) return;

    // Discs in their own order. Threads without a disc hold one at rest that nobody sees.
    const bool has_disc = t < DISCS;
    const Disc* const discs = batch.disc + size_t(c.header.grading) * THREADS;
    Position s = own.position();
    Motion m = {own.velocity().x, own.velocity().y, Real(0), Real(0)};
    Real w = own.spin();
    const Real mass = Real(1) / discs[t].inv_mass;
    const Vec momentum = block_sum(mass * m.x, mass * m.y, t);
    if (has_disc) {
        // Without their mean momentum, which rattlers would carry away.
        m.x -= momentum.x / Real(c.header.mass);
        m.y -= momentum.y / Real(c.header.mass);
        w += c.spin_change;
    }

    Totals total = {};
    int contacts = 0;
    int done = 0;
    while (true) {
        const Real r = discs[t].r;
        sh.position[t] = s;
        sh.motion[t] = {r, discs[t].inv_mass, Real(0), Real(0)};
        const Vec since_search = nearest(own.reference(), s);
        const bool stale = !(length2(c.reference_cell, since_search) <= c.allowed2);
        if (__syncthreads_or(stale)) s = search(batch, p, s, r);

        if (t / LANES == WARPS - 1) plan_substeps(p, done, t % LANES);
        Active active = {0, 0};
        if (has_disc) {
            const Real skin = Real(p.active_skin);
            active = c.header.imaged ? select_active<true>(own, s, r, skin)
                                     : select_active<false>(own, s, r, skin);
        }
        sh.owned[t] = active.owned;
        take_seat(__popc(active.owned), __popc(active.incoming), has_disc, t);
        if (c.status != OK) break;
        fill_slots(own, p, active);
        __syncthreads();

        // Into the order of seats, and back.
        const int seat = sh.seat[t];
        sh.position[seat] = s;
        sh.motion[seat] = {m.x, m.y, Real(0.5) * w, r * w};
        __syncthreads();
        const Disc disc = discs[sh.disc[t]];
        done = c.header.imaged ? advance_substeps<true>(p, disc, total, done, t)
                               : advance_substeps<false>(p, disc, total, done, t);
        const int own_seat = sh.seat[t];
        s = sh.position[own_seat];
        m = sh.motion[own_seat];
        w = Real(2) * m.half_w;
        int slot = first_slot(0, own_seat);
        contacts = 0;
        for (unsigned rest = sh.owned[t]; rest != 0; rest &= rest - 1, slot += LANES) {
            const Contact contact = sh.slot.contact[slot];
            own.tangential(__ffs(int(rest)) - 1) = contact.tangential;
            contacts += contact.overlap > Real(0);
        }
        if (t == 0 && done < int(p.substeps)) inspect(c, p);
        __syncthreads();
        if (done == int(p.substeps)) break;
    }

    own.position() = s;
    own.velocity() = {m.x, m.y};
    own.spin() = w;
    const bool broken = __syncthreads_or(has_disc && !isfinite(m.x + m.y + w));
    const Vec normal = block_sum(total.xx, total.yy, t);
    const Vec shear = block_sum(total.shear, Real(contacts), t);
    const Real overlap = block_max(total.relative_overlap, t);
    if (t != 0) return;

    Header& h = c.header;
    State state = {};
    state.area = determinant(h.cell);
    const double weight = 1.0 / (state.area * p.thickness * p.samples);
    state.stress = {weight * double(normal.x), 0.5 * weight * double(shear.x),
                    0.5 * weight * double(shear.x), weight * double(normal.y)};
    state.solid_fraction = h.solid / state.area;
    state.coordination = 2.0 * double(shear.y) / DISCS;
    state.relative_overlap = double(overlap);
    state.min_width = min_width(h.cell);
    state.searches = c.searches;
    state.thin = c.thin;
    if (c.status == OK && broken) c.status = NOT_FINITE;
    if (c.status == OK && state.relative_overlap > p.overlap_limit) c.status = OVERLAP;
    if (c.status != OK) {
        h.status = c.status;
        atomicMin(batch.failed, rve);
    }
    batch.header[rve] = h;
    batch.state[rve] = state;
    batch.stress[rve] = state.stress;
    batch.area_ratio[rve] = state.area / h.reference_area;
}
