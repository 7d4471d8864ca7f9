// Types and functions of all kernels of an assembly. The structs that Rust knows too are in abi.rs.

constexpr unsigned LANES = 32;
constexpr unsigned ALL = 0xffffffffu;
// `Motion::info`: rows in use, whether bodies are near, two bits of its rest (sleep.cu), and one for each row that
// touches.
constexpr unsigned ROWS_MASK = 31u;
constexpr unsigned BODIES_NEAR = 1u << 5;
constexpr unsigned FIRST_ROW = 8;
constexpr unsigned NO_BODY = 255;
// Most bodies near a disc.
constexpr unsigned NEAR_BODIES = 4;
// Bins along a side of a tile.
constexpr unsigned TILE = 8;

struct Vec {
    Real x, y;
};

__device__ inline Fraction bits_of(Real x) {
#if REAL_BITS == 32
    return __float_as_uint(x);
#else
    return __double_as_longlong(x);
#endif
}

__device__ inline Real real_of(Fraction bits) {
#if REAL_BITS == 32
    return __uint_as_float(bits);
#else
    return __longlong_as_double(bits);
#endif
}

__device__ inline Fraction warp_max(Fraction x) {
#if REAL_BITS == 32 && __CUDA_ARCH__ >= 800
    return __reduce_max_sync(ALL, x);
#else
    for (int d = LANES / 2; d > 0; d /= 2) x = max(x, __shfl_xor_sync(ALL, x, d));
    return x;
#endif
}

// The sum over the lanes of a warp, in a fixed order.
__device__ inline double warp_sum(double x) {
    for (int d = LANES / 2; d > 0; d /= 2) x += __shfl_xor_sync(ALL, x, d);
    return x;
}

// A coordinate in metres: the first, or the second if `k` is 1.
__device__ inline double position_of(const Parameters& p, Fraction s, int k) {
    return p.origin[k] + p.side * (double(s) / PERIOD);
}

// Notes a failure: the earliest counts, and of one step the gravest of the lowest disc.
__device__ inline void fail(Control& c, unsigned step, unsigned kind, unsigned id) {
    const unsigned long long code =
        (unsigned long long)step << 36 | (unsigned long long)kind << 32 | id;
    atomicMin(&c.failed, code);
}

// A square of a displacement (m²) that makes any list outdated: no further step is made.
constexpr Real FAILED = Real(1e30);

__device__ inline bool has_failed(const Control& c) { return ~c.failed != 0; }

// Whether a disc of any rank has moved too far for the windows: only the host can widen them.
__device__ inline bool has_drifted(const Control& c, const Parameters& p) {
    return p.margin != 0 && c.drift > p.margin;
}

// What a contact remembers.
#if ROLLING
struct Memory {
    History sliding, rolling;
};
#else
using Memory = History;
#endif

__device__ inline History sliding_of(const Memory& memory) {
#if ROLLING
    return memory.sliding;
#else
    return memory;
#endif
}

// A contact whose history of sliding is in one of `rows`: that of rolling is as many rows further.
__device__ inline Memory memory_at(const Parameters& p, const History& place, unsigned rows) {
#if ROLLING
    return {place, *(&place + size_t(rows) * p.row)};
#else
    return place;
#endif
}

__device__ inline void remember(const Parameters& p, History& place, unsigned rows,
                                Memory memory) {
#if ROLLING
    place = memory.sliding;
    *(&place + size_t(rows) * p.row) = memory.rolling;
#else
    place = memory;
#endif
}

// Discs before step `k` of a round, which is step `step` of all. Ranks exchange discs at fixed addresses:
// their rounds begin and end with the first buffer.
__device__ inline Disc* discs_before(const Arrays& a, const Parameters& p, unsigned step, unsigned k) {
    // `ranked ? k : step`, which would take registers.
    return a.disc + size_t((step - p.ranked * (step - k)) & 1u) * p.discs;
}

// Discs between two rounds, after `step` steps.
__device__ inline Disc* discs_after(const Arrays& a, const Parameters& p, unsigned step) {
    return discs_before(a, p, step, 0);
}

// Time (s) after `step` steps.
__device__ inline double time_after(const Control& c, const Parameters& p, unsigned step) {
    return c.time + (step - c.first) * p.dt;
}

// Vector from `from` to `to` (m).
__device__ inline Vec separation(const Parameters& p, const Place& from, const Place& to) {
    return {p.unit * Real(Signed(to.x - from.x)), p.unit * Real(Signed(to.y - from.y))};
}

// A contact at its present place: what both the step and the output need.
struct Contact {
    // From the disc to its partner.
    Real nx, ny;
    Real overlap;
    // Distance from the disc's centre to the contact.
    Real arm;
#if ROLLING
    // Reduced radius, and rolling velocity of the partner relative to the disc.
    Real radius, vr;
#endif
    // Velocity of the partner relative to the disc at the contact.
    Real vn, vt;
    Real dashpot;
    // Inverse of the effective mass.
    Real inv_mass;
};

__device__ inline Contact contact_of(const Parameters& p, const Disc& disc, const Disc& other,
                                     Vec l, Real distance2) {
    Contact c;
    const Vec length = length_and_inverse<Vec>(distance2);
    c.nx = l.x * length.y;
    c.ny = l.y * length.y;
    c.overlap = disc.place.r + other.place.r - length.x;
    c.arm = disc.place.r - Real(0.5) * c.overlap;
    const Real other_arm = other.place.r - Real(0.5) * c.overlap;
    const Real ux = other.motion.x - disc.motion.x;
    const Real uy = other.motion.y - disc.motion.y;
    c.vn = ux * c.nx + uy * c.ny;
    // Seen from either disc the same bits, without fused operations: so is the force.
#if REAL_BITS == 32
    const Real turning =
        __fadd_rn(__fmul_rn(c.arm, disc.motion.w), __fmul_rn(other_arm, other.motion.w));
#else
    const Real turning =
        __dadd_rn(__dmul_rn(c.arm, disc.motion.w), __dmul_rn(other_arm, other.motion.w));
#endif
    c.vt = (uy * c.nx - ux * c.ny) - turning;
#if ROLLING
    c.radius = ratio(disc.place.r * other.place.r, disc.place.r + other.place.r);
    c.vr = c.radius * (other.motion.w - disc.motion.w);
#endif
    c.inv_mass = disc.place.inv_mass + other.place.inv_mass;
    c.dashpot = p.dashpot * length_and_inverse<Vec>(c.inv_mass).y;
    return c;
}

// A coordinate (m) as a fraction of the region; one outside of it is moved to its edge.
__device__ inline Fraction encoded(double x, double origin, double side) {
    const double unit = 1.0 / PERIOD;
    const double largest = 1.0 - max(unit, 2.220446049250313e-16);
    return Fraction(min(max((x - origin) / side, 0.0), largest) * PERIOD);
}

// Writes where a body is at `time`. Returns its displacement since `before`, squared (m²). Work of few
// threads: not inlined, so that it takes no registers from the others.
__device__ __noinline__ double place_body(const Body* body, PlacedBody* at, double origin_x,
                                          double origin_y, double side, double time,
                                          double before) {
    const bool moves = time >= body->start;
    const double moved = moves ? time - body->start : 0.0;
    const double x = body->velocity[0] * moved;
    const double y = body->velocity[1] * moved;
    at->min[0] = encoded(body->min[0] + x, origin_x, side);
    at->min[1] = encoded(body->min[1] + y, origin_y, side);
    at->max[0] = encoded(body->max[0] + x, origin_x, side);
    at->max[1] = encoded(body->max[1] + y, origin_y, side);
    for (int k = 0; k < 2; ++k) at->velocity[k] = moves ? Real(body->velocity[k]) : Real(0);
    for (int k = 0; k < 4; ++k) at->friction[k] = Real(min(body->friction[k], 1e30));
    const double since = moved - max(before - body->start, 0.0);
    const double dx = body->velocity[0] * since;
    const double dy = body->velocity[1] * since;
    return dx * dx + dy * dy;
}

// Bodies after `step` steps. Those that never move are the same at all times.
__device__ inline PlacedBody* bodies_after(const Arrays& a, const Parameters& p, unsigned step) {
    return a.placed + (p.bodies_move != 0 && (step & 1u) != 0 ? p.bodies : 0);
}

// Distance along one axis from s to the interval from min to max, in units.
__device__ inline Real distance_to(Fraction s, Fraction min, Fraction max) {
    return s < min ? Real(Signed(min - s)) : s > max ? Real(Signed(max - s)) : Real(0);
}

// From the disc's centre to the nearest point of a body (m); zero inside.
__device__ inline Vec branch_to(const Parameters& p, const PlacedBody& body, const Place& disc) {
    return {p.unit * distance_to(disc.x, body.min[0], body.max[0]),
            p.unit * distance_to(disc.y, body.min[1], body.max[1])};
}

// Friction of the side that a branch ends on; at a corner, of the side that it faces more directly.
__device__ inline Real friction_of(const PlacedBody& body, Vec branch) {
    const bool sideways = fabs(branch.x) >= fabs(branch.y);
    return body.friction[sideways ? (branch.x > Real(0) ? 0 : 1) : (branch.y > Real(0) ? 2 : 3)];
}

__device__ inline Contact contact_with(const Parameters& p, const Disc& disc,
                                       const PlacedBody& body, Vec branch, Real distance2) {
    Contact c;
    const Vec length = length_and_inverse<Vec>(distance2);
    c.nx = branch.x * length.y;
    c.ny = branch.y * length.y;
    c.overlap = disc.place.r - length.x;
    c.arm = length.x;
    const Real ux = body.velocity[0] - disc.motion.x;
    const Real uy = body.velocity[1] - disc.motion.y;
    c.vn = ux * c.nx + uy * c.ny;
    c.vt = (uy * c.nx - ux * c.ny) - c.arm * disc.motion.w;
#if ROLLING
    c.radius = disc.place.r;
    c.vr = -(disc.place.r * disc.motion.w);
#endif
    c.inv_mass = disc.place.inv_mass;
    c.dashpot = p.dashpot * length_and_inverse<Vec>(c.inv_mass).y;
    return c;
}
