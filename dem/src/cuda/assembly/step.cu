// One DEM step of all own discs, one thread each: twin of contacts.rs, bodies.rs and
// motion.rs in dem/src/assembly. Both discs of a pair evaluate their contact, with the same bits, so that no thread
// writes what another one reads.

// Sums over the contacts of a disc.
struct Sums {
    // Minus the force (N) and minus the torque (N m) on the disc.
    Real x, y, torque;
#if SLEEP
    // Normal forces (N).
    Real pressing;
#endif
    // Largest overlap over the smaller radius.
    Real overlap;
    // Power (W).
    Real dashpots, friction, boxes;
};

// Adds a contact and returns its new history. `share` is the part of its power that counts here: half where
// both discs evaluate the contact.
__device__ inline Memory evaluate(const Parameters& p, const Contact& c, Real friction,
                                  Memory memory, Real share, Sums& sum, Vec& force) {
    const History before = sliding_of(memory);
    const auto [overlap, opens] =
        mean_overlap(p.normal_stiffness, p.step, c.overlap, c.vn, c.dashpot, c.inv_mass);
    const Real normal =
        max(spring_and_dashpot(p.normal_stiffness, overlap, c.dashpot, c.vn), Real(0));
    const Real tangential =
        tangential_force(before.spring, p.spring, c.vt, friction * normal);
    // Power over the step by the mean of the forces at its two ends, less what the springs store. A contact that
    // opens is not seen again: its dashpot acts until the end of the step.
    const Real viscous = normal - p.normal_stiffness * overlap;
    const Real last = opens ? Real(0.5) * viscous : Real(0);
    sum.dashpots -= share * ((Real(0.5) * (viscous + before.viscous) + last) * c.vn);
    sum.friction -= share * ((tangential + before.spring) *
                             (Real(0.5) * c.vt + (tangential - before.spring) * p.compliance));
    force = {normal * c.nx - tangential * c.ny, normal * c.ny + tangential * c.nx};
    sum.x += force.x;
    sum.y += force.y;
    sum.torque += tangential * c.arm;
#if SLEEP
    sum.pressing += normal;
#endif
#if ROLLING
    const History old = memory.rolling;
    const RollingForces rolling =
        rolling_forces(old.spring, p.rolling_spring, p.rolling_dashpot * c.dashpot, c.vr,
                       p.rolling_friction * normal);
    const Real damping = rolling.total - rolling.spring;
    const Real springs = rolling.spring + old.spring;
    sum.friction -= share * (Real(0.5) * (springs + damping + old.viscous) * c.vr +
                             springs * (rolling.spring - old.spring) * p.rolling_compliance);
    sum.torque += c.radius * rolling.total;
    return {{tangential, viscous}, {rolling.spring, damping}};
#else
    return {tangential, viscous};
#endif
}

// Asks for what the warp that advances the discs from `first` on will read, so that it finds it in the L2 cache: the
// places of blocks in memory are in the order in which they begin. A lane asks for a row.
__device__ inline void prefetch(const Arrays& a, const Parameters& p, const Disc* now,
                                unsigned first) {
#if REAL_BITS == 32 && __CUDA_ARCH__ >= 900
    constexpr unsigned LISTED = 10, TOUCHING = 6;
    const unsigned lane = threadIdx.x % LANES;
    first -= first % LANES;  // Slabs of ranks begin anywhere.
    if (p.ahead == 0 || first + LANES > p.own[1]) return;
    const void* from = now + first;
    unsigned bytes = LANES * sizeof(Disc);
    if (lane < LISTED) {
        from = a.list + (size_t(min(lane, ROWS - 1)) * p.row + first);
        bytes = LANES * sizeof(unsigned);
    } else if (lane < LISTED + TOUCHING) {
        from = a.history + (size_t(lane - LISTED) * p.row + first);
        bytes = LANES * sizeof(History);
    } else if (lane == LISTED + TOUCHING) {
        from = a.reference + first;
        bytes = LANES * sizeof(Position);
    } else if (lane > LISTED + TOUCHING + 1) {
        return;
    }
    asm volatile("cp.async.bulk.prefetch.L2.global [%0], %1;" ::"l"(from), "r"(bytes));
#endif
}

// Neighbours that are loaded together.
constexpr unsigned BATCH = 2;

// Contacts with discs. Returns which rows touch.
__device__ inline unsigned touch_discs(const Arrays& a, const Parameters& p, const Disc* now,
                                       const Disc& disc, unsigned i, Sums& sum) {
    const unsigned count = unsigned(disc.motion.info) & ROWS_MASK;
    const unsigned touched = unsigned(disc.motion.info) >> FIRST_ROW;
    unsigned touching = 0;
    for (unsigned first = 0; first < count; first += BATCH) {
        const Disc* other[BATCH];
        Place place[BATCH];
#pragma unroll
        for (unsigned k = 0; k < BATCH; ++k) {
            other[k] = now + (first + k < count ? a.list[size_t(first + k) * p.row + i] : i);
        }
#pragma unroll
        for (unsigned k = 0; k < BATCH; ++k) place[k] = other[k]->place;
#pragma unroll
        for (unsigned k = 0; k < BATCH; ++k) {
            const unsigned row = first + k;
            const Vec l = separation(p, disc.place, place[k]);
            const Real distance2 = l.x * l.x + l.y * l.y;
            const Real reach = disc.place.r + place[k].r;
            if (row >= count || distance2 >= reach * reach) continue;
            History& history = a.history[size_t(row) * p.row + i];
            const Memory before =
                touched >> row & 1u ? memory_at(p, history, ROWS) : Memory{};
            const Contact c =
                contact_of(p, disc, {place[k], other[k]->motion}, l, distance2);
            // A fixed disc does not evaluate its side.
            const Real share = place[k].inv_mass == Real(0) ? Real(1) : Real(0.5);
            Vec force;
            remember(p, history, ROWS, evaluate(p, c, p.friction, before, share, sum, force));
            sum.overlap = max(sum.overlap, ratio(c.overlap, min(disc.place.r, place[k].r)));
            touching |= 1u << row;
        }
    }
    return touching;
}

// Contacts with rigid bodies. Returns false if the disc is inside one.
__device__ inline bool touch_bodies(const Arrays& a, const Parameters& p, const Disc& disc,
                                    unsigned i, unsigned step, Sums& sum) {
    const unsigned near = a.near_bodies[i];
    for (unsigned k = 0; k < 4; ++k) {
        const unsigned index = near >> (8 * k) & 255u;
        if (index == NO_BODY) break;
        const PlacedBody& body = bodies_after(a, p, step)[index];
        const Vec l = branch_to(p, body, disc.place);
        const Real distance2 = l.x * l.x + l.y * l.y;
        if (distance2 == Real(0)) return false;
        History& history = a.body_history[size_t(k) * p.row + i];
        if (distance2 >= disc.place.r * disc.place.r) {
            remember(p, history, NEAR_BODIES, {});
            continue;
        }
        const Contact c = contact_with(p, disc, body, l, distance2);
        Vec force;
        remember(p, history, NEAR_BODIES,
                 evaluate(p, c, friction_of(body, l), memory_at(p, history, NEAR_BODIES), Real(1),
                          sum, force));
        sum.boxes -= force.x * body.velocity[0] + force.y * body.velocity[1];
        sum.overlap = max(sum.overlap, ratio(c.overlap, disc.place.r));
    }
    return true;
}

// Moves a disc: symplectic Euler. Returns the power of damping (W).
__device__ inline Real move(const Parameters& p, const Sums& sum, Disc& disc) {
    Motion& u = disc.motion;
    const Real mass = Real(1) / disc.place.inv_mass;
    const Real inertia = Real(0.5) * mass * disc.place.r * disc.place.r;
    Real fx = mass * p.gravity[0] - sum.x;
    Real fy = mass * p.gravity[1] - sum.y;
    Real torque = -sum.torque;
    Real lost = 0;
    if (p.local_damping != Real(0) || p.drag != Real(0)) {
        const Real x = fx + damped(-fx, u.x, p.local_damping) + mass * p.drag * u.x;
        const Real y = fy + damped(-fy, u.y, p.local_damping) + mass * p.drag * u.y;
        const Real t = torque + damped(-torque, u.w, p.local_damping) + inertia * p.drag * u.w;
        lost = x * u.x + y * u.y + t * u.w;
        fx -= x;
        fy -= y;
        torque -= t;
    }
    const Real kick = p.step * disc.place.inv_mass;
    u.x += fx * kick;
    u.y += fy * kick;
    u.w += torque * ratio(p.step, inertia);
    disc.place.x = moved(disc.place.x, p.per_unit * u.x);
    disc.place.y = moved(disc.place.y, p.per_unit * u.y);
    return lost;
}

// Lets a disc that is held feel the forces on it.
__device__ inline void hold(const Arrays& a, const Parameters& p, const Sums& sum, const Disc& disc,
                            unsigned i) {
#if SLEEP
    const Real weight = p.weight / disc.place.inv_mass;
    feel(p, a.rest[i], -sum.x, -sum.y, -sum.torque / disc.place.r, sum.pressing + weight);
#endif
}

// Adds to the losses of a warp of discs from `first` on in this sequence of steps. `lost` is the power of damping (W).
__device__ inline void add_losses(const Arrays& a, const Parameters& p, unsigned first,
                                  const Sums& sum, Real lost) {
    Loss& loss = a.loss[first / LANES];
    add_energy(p, p.step * sum.dashpots, loss.dashpots);
    add_energy(p, p.step * sum.friction, loss.friction);
    add_energy(p, p.step * lost, loss.damping);
    add_energy(p, p.step * sum.boxes, loss.boxes);
}

// Notes the displacement of a disc since the search. Exact at the end of a round; before it, only what
// makes the lists outdated counts.
__device__ inline void note_move(Control& c, const Parameters& p, unsigned k, Real moved2) {
    const bool last = k + 1 == STEPS;
    if (last) {
        const Fraction largest = warp_max(bits_of(moved2));
        if (threadIdx.x % LANES == 0 && largest > c.moved[k + 1]) {
            atomicMax(&c.moved[k + 1], largest);
        }
    } else if (moved2 > p.allowed * p.allowed) {
        atomicMax(&c.moved[k + 1], bits_of(moved2));
    }
}

// The last block, which has no discs of its own where bodies move, places them for the next step. Returns
// the square of a displacement since the last search (m²).
__device__ inline Real move_bodies(const Arrays& a, const Parameters& p, const Control& c,
                                   unsigned step) {
    if (p.bodies_move == 0) return Real(0);
    double largest2 = 0.0;
    for (unsigned b = threadIdx.x; b < p.bodies; b += THREADS) {
        largest2 = max(largest2, place_body(&a.body[b], &bodies_after(a, p, step + 1)[b],
                                            p.origin[0], p.origin[1], p.side,
                                            time_after(c, p, step + 1),
                                            time_after(c, p, c.searched)));
    }
    return Real(largest2);
}

// Notes a failure in step `k` of a round, and stops all ranks.
__device__ inline void fail_step(Control& c, unsigned step, unsigned k, unsigned kind, unsigned id) {
    fail(c, step, kind, id);
    atomicMax(&c.moved[k + 1], bits_of(FAILED));
}

// In place of a step. A rank whose round ends after an odd number of steps copies its discs to the first
// buffer.
__device__ inline void keep(const Arrays& a, const Parameters& p, const Control& c, unsigned k,
                            unsigned i) {
    if (p.ranked == 0 || c.done != k || (k & 1u) == 0 || i >= p.own[1]) return;
    *(discs_before(a, p, 0, k + 1) + i) = *(discs_before(a, p, 0, k) + i);
}

extern "C" __global__ void __launch_bounds__(THREADS, BLOCKS)
    assembly_step(Arrays a, Parameters p, unsigned k) {
    await_turn();
    Control& c = *a.control;
    const unsigned step = c.steps + k;
    const unsigned n = blockIdx.x * THREADS + threadIdx.x;
    const unsigned i = p.own[0] + n;
    const Fraction moved_before = c.moved[k];
    if (has_failed(c)) return;
    const bool outdated = real_of(moved_before) > p.allowed * p.allowed;
    if (outdated || step >= c.target) {
        // Lists that are outdated remain so until a search.
        if (outdated && n == 0) c.moved[k + 1] = moved_before;
        keep(a, p, c, k, i);
        return;
    }
    if (n == 0) c.done = k + 1;
    Real moved2 = 0;
    if (blockIdx.x == gridDim.x - 1) moved2 = move_bodies(a, p, c, step);
#if SLEEP
    const bool left_out = i < p.own[1] && is_quiet(a, i);
    if (__all_sync(ALL, left_out)) return;
#else
    constexpr bool left_out = false;
#endif
    Sums sum = {};
    Real lost = 0;
    if (i < p.own[1] && !left_out) {
        const Disc* now = discs_before(a, p, step, k);
        prefetch(a, p, now, i - threadIdx.x % LANES + p.ahead);
        Disc disc = now[i];
        if (disc.place.inv_mass != Real(0)) {
            unsigned info = unsigned(disc.motion.info);
            const unsigned touching = touch_discs(a, p, now, disc, i, sum);
            if ((info & BODIES_NEAR) != 0 && !touch_bodies(a, p, disc, i, step, sum)) {
                fail_step(c, step, k, LEAK, a.id[i]);
            }
            info = (info & (ROWS_MASK | BODIES_NEAR | STATE_MASK)) | touching << FIRST_ROW;
            if (SLEEP && is_held(state_of(info))) {
                hold(a, p, sum, disc, i);
            } else {
                lost = move(p, sum, disc);
            }
            disc.motion.info = info;
            const Motion& u = disc.motion;
            if (!(u.x * u.x + u.y * u.y + u.w * u.w < Real(1e30))) {
                fail_step(c, step, k, NOT_FINITE, a.id[i]);
            }
            if (sum.overlap > real_of(c.overlap)) atomicMax(&c.overlap, bits_of(sum.overlap));
            if (sum.overlap > p.overlap_limit) fail_step(c, step, k, OVERLAP, a.id[i]);
            const Position r = a.reference[i];
            const Real x = p.unit * Real(Signed(disc.place.x - r.x));
            const Real y = p.unit * Real(Signed(disc.place.y - r.y));
            moved2 = max(moved2, x * x + y * y);
        }
        discs_before(a, p, step + 1, k + 1)[i] = disc;
    }
    add_losses(a, p, i - threadIdx.x % LANES, sum, lost);
    note_move(c, p, k, moved2);
}
