// One macro step of a batch of RVEs: one thread block per RVE, one thread per disc.
//
// The CPU twin is `Rve::advance` in dem/src/rve.rs; formulas are explained there and in the files
// it calls. What differs is only how the work is laid out:
//
// * One disc of each pair, its owner, evaluates the contact, adds the force to its own sum and leaves
//   the reaction in shared memory; after a barrier the other disc adds it to its sum. There are no
//   atomics on forces, every sum has a fixed order, and the result does not depend on timing.
// * Threads take the discs in the order of falling numbers of owned pairs ("seats"), so that the
//   lanes of a warp finish together. Seats and list last from one search to the next, over many
//   launches. State in device memory goes by seats: a launch copies it to shared memory and back.
// * A list alone decides the seats, and pairs are visited in the order of neighbours and images: a
//   batch that was downloaded and uploaded goes on bit by bit.

// The fresh packing, with its list.
__device__ void copy_packing(const Batch& b, unsigned to_rve, unsigned from_rve, int t) {
    const size_t to = size_t(to_rve) * THREADS + t;
    const size_t from = size_t(from_rve) * THREADS + t;
    b.position[to] = b.position[from];
    b.motion[to] = b.motion[from];
    b.reference[to] = b.reference[from];
    b.seated[to] = b.seated[from];
    b.rows[to] = b.rows[from];
    const Header& h = b.header[from_rve];
    const size_t to_slot = size_t(to_rve) * SLOTS;
    const size_t from_slot = size_t(from_rve) * SLOTS;
    for (int k = t; k < int(h.owned); k += THREADS) {
        b.neighbour[to_slot + k] = b.neighbour[from_slot + k];
        b.pair[to_slot + k] = b.pair[from_slot + k];
        b.spring[SPRINGS * to_slot + k] = b.spring[SPRINGS * from_slot + k];
#if ROLLING
        b.spring[SPRINGS * to_slot + SLOTS + k] = b.spring[SPRINGS * from_slot + SLOTS + k];
#endif
    }
    for (int k = t; k < int(h.incoming); k += THREADS) {
        b.incoming[size_t(to_rve) * INCOMING_SLOTS + k] = b.incoming[size_t(from_rve) * INCOMING_SLOTS + k];
    }
}

// Begins to copy an RVE to shared memory.
__device__ void fetch_rve(const Batch& b, unsigned rve) {
    Shared& sh = shared();
    const size_t seat = size_t(rve) * THREADS;
    const size_t slot = size_t(rve) * SLOTS;
    begin_copies(sh.copies);
    fetch(sh.copies, sh.disc, b.seated + seat, THREADS * sizeof(unsigned short));
    const unsigned owned = b.header[rve].owned;
    fetch(sh.copies, sh.slot.neighbour, b.neighbour + slot, owned * sizeof(unsigned));
    fetch(sh.copies, sh.slot.pair, b.pair + slot, owned * sizeof(Vec));
    fetch(sh.copies, sh.slot.tangential, b.spring + SPRINGS * slot, owned * sizeof(Real));
#if ROLLING
    fetch(sh.copies, sh.slot.rolling, b.spring + SPRINGS * slot + SLOTS, owned * sizeof(Real));
#endif
    fetch(sh.copies, sh.slot.incoming, b.incoming + 2 * slot,
          b.header[rve].incoming * sizeof(unsigned short));
    end_copies(sh.copies);
}

// Copies back what every launch changes of the list.
__device__ void store_rve(const Batch& b, unsigned rve) {
    const Shared& sh = shared();
    store(b.spring + size_t(rve) * (SPRINGS * SLOTS), sh.slot.tangential,
          sh.control.header.owned * sizeof(Real));
#if ROLLING
    store(b.spring + size_t(rve) * (SPRINGS * SLOTS) + SLOTS, sh.slot.rolling,
          sh.control.header.owned * sizeof(Real));
#endif
}

// Adds `summand` up into `sum`; each warp takes some of the sums. In the order of seats, always the
// same.
__device__ void add_up(int first, int end, int t) {
    Shared& sh = shared();
    for (int k = first + t / LANES; k < end; k += WARPS) {
        Real x = 0;
        for (int seat = t % LANES; seat < THREADS; seat += LANES) {
            const Real y = sh.summand[k][seat];
            x = k == OVERLAPS ? max(x, y) : x + y;
        }
        x = k == OVERLAPS ? warp_max(x) : warp_sum(x);
        if (t % LANES == 0) sh.sum[k] = x;
    }
}

__device__ void put_momentum(Real mass, Vec u, int t) {
    Shared& sh = shared();
    sh.summand[MOMENTUM_X][t] = mass * u.x;
    sh.summand[MOMENTUM_Y][t] = mass * u.y;
}

// Mean velocity, from the sums.
__device__ Vec drift() {
    const Shared& sh = shared();
    const Real mass = Real(sh.control.header.mass);
    return {sh.sum[MOMENTUM_X] / mass, sh.sum[MOMENTUM_Y] / mass};
}

// Leaves the RVE as it was before this macro step, for good; one thread.
__device__ void fail(const Batch& batch, unsigned rve) {
    Header& h = batch.header[rve];
    h.status = shared().control.status;
    h.steps += 1;
    atomicMin(batch.failed, int(rve));
}

// Stress and state of the RVE from the sums (homogenise.rs); one thread.
__device__ void finish(const Batch& batch, const Parameters& p, unsigned rve, bool broken) {
    Shared& sh = shared();
    Control& c = sh.control;
    Header& h = c.header;
    State state = {};
    state.area = determinant(h.cell);
    const double inverse_area = 1.0 / state.area;
    const double weight = inverse_area * p.stress_weight;
    const double shear = 0.5 * weight * double(sh.sum[VIRIAL_SHEAR]);
    state.stress = {weight * double(sh.sum[VIRIAL_XX]), shear,
                    shear, weight * double(sh.sum[VIRIAL_YY])};
    state.solid_fraction = h.solid * inverse_area;
    state.coordination = 2.0 * double(sh.sum[CONTACTS]) / DISCS;
    state.relative_overlap = double(sh.sum[OVERLAPS]);
    state.min_width = min_width(h.cell);
    state.searches = c.searches;
    state.thin = c.thin;
    state.dense = c.dense;
#if UNEQUAL
    const double normal = double(p.normal_stiffness) * double(sh.sum[TOTAL_OVERLAP]);
    state.unbalanced = double(sh.sum[RESULTANTS]) / DISCS * double(sh.sum[CONTACTS]) / normal;
#endif
    if (c.status == OK && broken) c.status = NOT_FINITE;
    if (c.status == OK && state.relative_overlap > p.overlap_limit) c.status = OVERLAP;
    if (c.status != OK) {
        h.status = c.status;
        atomicMin(batch.failed, int(rve));
    }
    h.drift_x = drift().x;
    h.drift_y = drift().y;
    batch.header[rve] = h;
    batch.state[rve] = state;
}

extern "C" __global__ void __launch_bounds__(THREADS, BLOCKS)
rve_advance(const __grid_constant__ Batch batch, const __grid_constant__ Parameters common,
            const Matrix* __restrict__ velocity_gradient) {
    await_turn();
    Shared& sh = shared();
    Control& c = sh.control;
    const unsigned launch = batch.queue->launch;
    const unsigned rve = next_rve(batch, launch);
#if UNEQUAL
    const Parameters& p = batch.each[rve];
#else
    const Parameters& p = common;
#endif
    const int t = int(threadIdx.x);
    const int lane = t % LANES;
    const int warp = t / LANES;

    const Disc* const discs = batch.disc + size_t(batch.header[rve].grading) * THREADS;
    const unsigned mine = rve * THREADS + t;
    Position reference = batch.reference[mine];
    const Position position = batch.position[mine];
    const Motion motion = batch.motion[mine];
    const Rows rows = batch.rows[mine];
    Disc disc = discs[batch.seated[mine]];
    if (copies(t)) fetch_rve(batch, rve);
    if (t == 0) c.action = begin(c, batch, p, rve, velocity_gradient[rve]);
    // By another warp, if there is one.
    if (warp == 1 % WARPS) prepare_plan(p, velocity_gradient[rve], lane);
    __syncthreads();
    if (warp == 0 && c.action == ADVANCE) plan_substeps(p, 0, true, lane);
    wait_for_copies(sh.copies);
    if (c.action != ADVANCE) {
        if (c.action == RESTART) copy_packing(batch, rve, p.rves + c.header.kind, t);
        if (t == 0 && c.status == OK) batch.header[rve] = c.header;
        if (t == 0 && c.status != OK) fail(batch, rve);
        if (t == 0) queue_again(batch, launch, rve, c.action == RESTART);
        return;
    }

    // Threads without a disc hold one at rest that nobody sees.
    {
        // Without their mean momentum, which rattlers would carry away.
        Vec u = {motion.x, motion.y};
        Real half_w = motion.half_w;
        Vec mean = c.drift;
        if (isnan(mean.x)) {
            put_momentum(disc.mass, u, t);
            __syncthreads();
            add_up(MOMENTUM_X, MOMENTUM_Y + 1, t);
            __syncthreads();
            mean = drift();
        }
        if (t < DISCS) {
            u = {u.x - mean.x, u.y - mean.y};
            half_w += Real(0.5) * c.spin_change;
        }
        sh.body[t] = {position, u};
        sh.half_w[t] = half_w;
        sh.owned[t] = {rows.owned, rows.owned_end};
        sh.incoming[t] = {rows.incoming, rows.incoming_end};
    }
    __syncthreads();
    const bool stale = __syncthreads_or(moved_far(reference, position, sh.substep[0].allowed2));

    Totals total = {};
    int done = 0;
    Progress progress = {0, stale};
    while (true) {
        if (progress.stale) {
            // Sums that are kept in registers meanwhile get spilled in all substeps.
            volatile Real aside[] = {total.virial.xx, total.virial.yy, total.virial.shear,
                                     total.relative_overlap};
            search(batch, p, discs);
            // Contacts are counted in the last substep only.
            total = {{aside[0], aside[1], aside[2]}, aside[3], 0};
            disc = discs[sh.disc[t]];
            reference = sh.body[t].s;
        }
        if (progress.stale || done > 0) {
            __syncthreads();
            if (warp == 0) plan_substeps(p, done, false, lane);
            __syncthreads();
        }
        if (c.status != OK) {
            if (t == 0) fail(batch, rve);
            if (t == 0) queue_again(batch, launch, rve, false);
            return;
        }
        progress = c.header.imaged ? advance_substeps<true>(p, disc, reference, total, t)
                                   : advance_substeps<false>(p, disc, reference, total, t);
        done += progress.substeps;
        if (done == int(p.substeps)) break;
    }

    const Body body = sh.body[t];
    const Real half_w = sh.half_w[t];
    batch.position[mine] = body.s;
    batch.motion[mine] = {body.u.x, body.u.y, half_w, Real(0)};
    sh.summand[VIRIAL_XX][t] = total.virial.xx;
    sh.summand[VIRIAL_YY][t] = total.virial.yy;
    sh.summand[VIRIAL_SHEAR][t] = total.virial.shear;
    sh.summand[CONTACTS][t] = Real(total.contacts);
    sh.summand[OVERLAPS][t] = total.relative_overlap;
#if UNEQUAL
    sh.summand[RESULTANTS][t] = t < DISCS ? total.resultant : Real(0);
    sh.summand[TOTAL_OVERLAP][t] = total.overlap;
#endif
    put_momentum(disc.mass, body.u, t);
    offer_stores();
    // A search may be due soon where half of the squared way to it will be done in another macro step.
    const Real half = Real(0.5) * sh.substep[progress.substeps].allowed2;
    const Real* const units = sh.substep[progress.substeps - 1].to_units;
    const Real ahead = Real(p.substeps);
    const Position next = {moved(body.s.x, ahead * (units[0] * body.u.x + units[1] * body.u.y)),
                           moved(body.s.y, ahead * (units[2] * body.u.x + units[3] * body.u.y))};
    const bool far = __syncthreads_or(t < DISCS && moved_far(reference, next, half));
    // Among several images both a search and a substep take longer.
    const bool slow = far || c.header.imaged;
    if (copies(t)) store_rve(batch, rve);
    if (t == THREADS - 1) queue_again(batch, launch, rve, slow);
    add_up(0, SUMS, t);
    const bool broken = __syncthreads_or(!isfinite(body.u.x + body.u.y + half_w));
    if (t == 0) finish(batch, p, rve, broken);
    if (copies(t)) end_stores();
}
