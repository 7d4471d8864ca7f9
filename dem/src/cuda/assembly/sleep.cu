// Which grains rest and are held: twin of sleep.rs and resting.rs in dem/src/assembly. What a disc does is in two bits
// of `Motion::info`, so that its neighbours know.

enum : unsigned { AWAKE = 0, DROWSY = 1, ASLEEP = 2, WATCHED = 3 };
constexpr unsigned STATE_SHIFT = 6;
constexpr unsigned STATE_MASK = 3u << STATE_SHIFT;

__device__ inline unsigned state_of(Fraction info) {
    return (unsigned(info) & STATE_MASK) >> STATE_SHIFT;
}

__device__ inline bool is_held(unsigned state) { return state == DROWSY || state == ASLEEP; }

// Whether a disc and all that it can feel stay as they are.
__device__ inline bool is_quiet(const Arrays& a, unsigned i) {
    return (a.quiet[i / LANES] >> (i % LANES) & 1u) != 0;
}

// Compares the force on a held disc with that when it was held first. `pressing` is the sum of its normal
// forces and its weight.
__device__ inline void feel(const Parameters& p, Rest& rest, Real x, Real y, Real torque,
                            Real pressing) {
    if (rest.allowed < Real(0)) {
        rest.force[0] = x;
        rest.force[1] = y;
        rest.force[2] = torque;
        rest.allowed = p.sleep_force * pressing;
    }
    const Real dx = x - rest.force[0];
    const Real dy = y - rest.force[1];
    const Real dt = torque - rest.force[2];
    if (dx * dx + dy * dy + dt * dt > rest.allowed * rest.allowed) rest.disturbed = 1;
}

// A number that looks random, the same on the CPU.
__device__ inline unsigned patch_hash(unsigned seed, unsigned x, unsigned y) {
    unsigned h = seed ^ x * 0x9e3779b1u ^ y * 0x85ebca77u;
    h = (h ^ h >> 16) * 0x7feb352du;
    h = (h ^ h >> 15) * 0x846ca68bu;
    return h ^ h >> 16;
}

// Displacement of a disc from its place, squared (m²).
__device__ inline Real strayed2(const Parameters& p, const Rest& rest, const Place& place) {
    const Real x = p.unit * Real(Signed(place.x - rest.x));
    const Real y = p.unit * Real(Signed(place.y - rest.y));
    return x * x + y * y;
}

// Takes a look at a disc. Returns its new state.
__device__ inline unsigned look_at(const Parameters& p, Rest& rest, const Disc& disc,
                                   unsigned state) {
    const bool disturbed = rest.disturbed != 0;
    rest.disturbed = 0;
    if (is_held(state) && !disturbed) return ASLEEP;
    const Motion& u = disc.motion;
    const Real rim = disc.place.r * u.w;
    const bool slow = u.x * u.x + u.y * u.y + rim * rim <= p.sleep_speed * p.sleep_speed;
    if (state == WATCHED && slow) {
        if (disturbed) {
            rest.x = disc.place.x;
            rest.y = disc.place.y;
        }
        return WATCHED;
    }
    const bool near = state == AWAKE && slow &&
                      strayed2(p, rest, disc.place) <= p.sleep_distance * p.sleep_distance;
    if (near && rest.looks + 1 < p.sleep_looks) {
        rest.looks += 1;
        return AWAKE;
    }
    rest.x = disc.place.x;
    rest.y = disc.place.y;
    rest.looks = 0;
    rest.allowed = Real(-1);
    if (!near) return AWAKE;
    const unsigned x = unsigned(bin_of(disc.place.x, int(p.patches)));
    const unsigned y = unsigned(bin_of(disc.place.y, int(p.patches)));
    return patch_hash(p.seed, x, y) < p.audited ? WATCHED : DROWSY;
}

// Looks whether disc `i`, which is at `place` in memory, rests: after a round with steps.
__device__ inline void look(const Arrays& a, const Parameters& p, Disc& place, unsigned i) {
    if (is_quiet(a, i)) return;
    const Disc disc = place;
    if (disc.place.inv_mass == Real(0)) return;
    const unsigned before = state_of(disc.motion.info);
    Rest rest = a.rest[i];
    const unsigned state = look_at(p, rest, disc, before);
    a.rest[i] = rest;
    if (state == before) return;
    const Fraction others = disc.motion.info & ~Fraction(STATE_MASK);
    place.motion.info = others | Fraction(state << STATE_SHIFT);
    if (state != DROWSY) return;
    const Motion& u = disc.motion;
    const Real rim = disc.place.r * u.w;
    const Real energy = (u.x * u.x + u.y * u.y + Real(0.5) * rim * rim) / disc.place.inv_mass;
    atomicAdd(&a.loss[i / LANES].damping, (unsigned long long)units_of(p, Real(0.5) * energy));
    place.motion.x = Real(0);
    place.motion.y = Real(0);
    place.motion.w = Real(0);
}

// Looks what is around the discs that rest. Where nothing moves, both buffers hold them, and steps leave them out.
extern "C" __global__ void assembly_quiet(Arrays a, Parameters p, unsigned force) {
    await_turn();
    Control& c = *a.control;
    if (has_failed(c) || (force == 0 && c.done == 0)) return;
    const unsigned i = blockIdx.x * blockDim.x + threadIdx.x;
    const unsigned step = c.steps + c.done;
    const Disc* now = discs_after(a, p, step);
    bool quiet = true, skipped = false;
    if (i < p.discs) {
        const Disc disc = now[i];
        const unsigned state = state_of(disc.motion.info);
        const bool fixed = disc.place.inv_mass == Real(0);
        skipped = !fixed && is_quiet(a, i);
        quiet = fixed || (state == ASLEEP && (p.bodies_move == 0 ||
                                              (unsigned(disc.motion.info) & BODIES_NEAR) == 0));
        bool calm = state == WATCHED;
        if (!fixed && (quiet || calm)) {
            const unsigned rows = unsigned(disc.motion.info) & ROWS_MASK;
            for (unsigned row = 0; row < rows; ++row) {
                const Disc& other = now[a.list[size_t(row) * p.row + i]];
                if (other.place.inv_mass == Real(0)) continue;
                const unsigned theirs = state_of(other.motion.info);
                quiet = quiet && theirs == ASLEEP;
                calm = calm && theirs != AWAKE;
            }
        }
        if (calm) {
            const Fraction strayed = bits_of(strayed2(p, a.rest[i], disc.place));
            if (strayed > c.audit) atomicMax(&c.audit, strayed);
        } else if (state == WATCHED) {
            a.rest[i].disturbed = 1;
        }
        if (quiet) discs_before(a, p, step + 1, 1)[i] = disc;
    }
    const unsigned left_out = __popc(__ballot_sync(ALL, skipped));
    const unsigned mask = __ballot_sync(ALL, quiet);
    if (i % LANES != 0 || i >= p.discs) return;
    if (left_out != 0) atomicAdd(&c.skipped, (unsigned long long)(left_out) * c.done);
    a.quiet[i / LANES] = mask;
}
