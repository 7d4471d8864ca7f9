// One macro step of a batch of RVEs: one thread block per RVE, one thread per disc.
//
// The CPU twin is `Rve::advance` in dem/src/rve.rs; formulas are explained there and in the files
// it calls. What differs is only how the work is laid out:
//
// * One disc of each pair, its owner, evaluates the contact, adds the force to its own sum and leaves
//   the reaction in shared memory; after a barrier the other disc adds it to its sum. There are no
//   atomics on forces, every sum has a fixed order, and the result does not depend on timing.
// * Threads take the discs in the order of falling numbers of owned pairs ("seats"), so that the
//   lanes of a warp finish together. Results do not depend on the seats: pairs are visited in the
//   order of neighbours and images, and sums over the RVE go by discs.
// * Seats and list last from one search to the next, over many launches. A launch only copies them
//   to shared memory.

// The fresh packing, with its list.
__device__ void copy_packing(const Batch& b, unsigned to_rve, unsigned from_rve, int t) {
    const size_t to = size_t(to_rve) * THREADS + t;
    const size_t from = size_t(from_rve) * THREADS + t;
    b.position[to] = b.position[from];
    b.velocity[to] = b.velocity[from];
    b.spin[to] = b.spin[from];
    b.reference[to] = b.reference[from];
    b.seat[to] = b.seat[from];
    b.rows[to] = b.rows[from];
    const Header& h = b.header[from_rve];
    const size_t to_slot = size_t(to_rve) * SLOTS;
    const size_t from_slot = size_t(from_rve) * SLOTS;
    for (int k = t; k < int(h.owned); k += THREADS) {
        b.neighbour[to_slot + k] = b.neighbour[from_slot + k];
        b.pair[to_slot + k] = b.pair[from_slot + k];
        b.tangential[to_slot + k] = b.tangential[from_slot + k];
    }
    for (int k = t; k < int(h.incoming); k += THREADS) {
        b.incoming[size_t(to_rve) * INCOMING_SLOTS + k] = b.incoming[size_t(from_rve) * INCOMING_SLOTS + k];
    }
}

// Begins to copy the list to shared memory.
__device__ void fetch_list(const Batch& b, unsigned rve, int t) {
    Slots& slot = shared().slot;
    const size_t first = size_t(rve) * SLOTS;
    const unsigned owned = b.header[rve].owned;
    const unsigned incoming = b.header[rve].incoming;
    copy_async(slot.neighbour, b.neighbour + first, owned * sizeof(unsigned), t);
    copy_async(slot.pair, b.pair + first, owned * sizeof(Vec), t);
    copy_async(slot.tangential, b.tangential + first, owned * sizeof(Real), t);
    copy_async(slot.incoming, b.incoming + size_t(rve) * INCOMING_SLOTS, incoming * sizeof(unsigned short), t);
}

// Leaves the RVE as it was before this macro step, for good; one thread.
__device__ void fail(const Batch& batch, unsigned rve) {
    Header& h = batch.header[rve];
    h.status = shared().control.status;
    h.steps += 1;
    atomicMin(batch.failed, int(rve));
}

// Stress and state of the RVE from the sums over its discs (homogenise.rs); one thread.
__device__ void finish(const Batch& batch, const Parameters& p, unsigned rve, const Partial& sums) {
    Control& c = shared().control;
    Header& h = c.header;
    State state = {};
    state.area = determinant(h.cell);
    const double inverse_area = 1.0 / state.area;
    const double weight = inverse_area * p.stress_weight;
    const double shear = 0.5 * weight * double(sums.sum[2]);
    state.stress = {weight * double(sums.sum[0]), shear, shear, weight * double(sums.sum[1])};
    state.solid_fraction = h.solid * inverse_area;
    state.coordination = 2.0 * double(sums.sum[3]) / DISCS;
    state.relative_overlap = double(sums.largest);
    state.min_width = min_width(h.cell);
    state.searches = c.searches;
    state.thin = c.thin;
    if (c.status == OK && sums.broken) c.status = NOT_FINITE;
    if (c.status == OK && state.relative_overlap > p.overlap_limit) c.status = OVERLAP;
    if (c.status != OK) {
        h.status = c.status;
        atomicMin(batch.failed, int(rve));
    }
    batch.header[rve] = h;
    batch.state[rve] = state;
    batch.stress[rve] = state.stress;
    batch.area_ratio[rve] = state.area / h.reference_area;
}

extern "C" __global__ void __launch_bounds__(THREADS, BLOCKS)
rve_advance(const __grid_constant__ Batch batch, const __grid_constant__ Parameters p,
            const Matrix* __restrict__ velocity_gradient) {
    Shared& sh = shared();
    Control& c = sh.control;
    const unsigned launch = batch.queue->launch;
    const unsigned rve = next_rve(batch, launch);
    const int t = int(threadIdx.x);
    const int lane = t % LANES;
    const int warp = t / LANES;
    const unsigned mine = rve * THREADS + t;

    // All loads first, to wait only once.
    const int first_seat = batch.seat[mine];
    const Position position = batch.position[mine];
    const Position at_search = batch.reference[mine];
    const Vec velocity = batch.velocity[mine];
    const Real spin = batch.spin[mine];
    const Rows rows = batch.rows[mine];
    const Disc* const discs = batch.disc + size_t(batch.header[rve].grading) * THREADS;
    fetch_list(batch, rve, t);
    if (warp == 0) {
        if (lane == 0) c.action = begin(c, batch, p, rve, velocity_gradient[rve]);
        __syncwarp();
        if (c.action == ADVANCE) plan_substeps(p, 0, lane);
    }

    // Into the order of seats, and the momentum in the order of discs. Threads without a disc hold
    // one at rest that nobody sees.
    sh.seat[t] = (unsigned short)first_seat;
    sh.disc[first_seat] = (unsigned short)t;
    sh.rows[t] = rows;
    sh.position[first_seat] = position;
    sh.reference[first_seat] = at_search;
    sh.motion[first_seat] = {velocity.x, velocity.y, Real(0.5) * spin, Real(0)};
    const Real mass = Real(1) / discs[t].inv_mass;
    const Vec momentum = {warp_sum(mass * velocity.x), warp_sum(mass * velocity.y)};
    if (lane == 0) {
        sh.partial[warp].sum[0] = momentum.x;
        sh.partial[warp].sum[1] = momentum.y;
    }
    __syncthreads();
    if (c.action != ADVANCE) {
        wait_for_copies();
        if (c.action == RESTART) copy_packing(batch, rve, p.rves, t);
        if (t == 0 && c.status == OK) batch.header[rve] = c.header;
        if (t == 0 && c.status != OK) fail(batch, rve);
        if (t == 0) queue_again(batch, launch, rve, c.action == RESTART);
        return;
    }

    Disc disc = discs[sh.disc[t]];
    Position reference = sh.reference[t];
    {
        // Without their mean momentum, which rattlers would carry away.
        const Real x = warp_sum(lane < WARPS ? sh.partial[lane].sum[0] : Real(0));
        const Real y = warp_sum(lane < WARPS ? sh.partial[lane].sum[1] : Real(0));
        Motion m = sh.motion[t];
        if (t < DISCS) {
            m.x -= x / Real(c.header.mass);
            m.y -= y / Real(c.header.mass);
            m.half_w += Real(0.5) * c.spin_change;
            m.rim = Real(2) * disc.r * m.half_w;
        }
        sh.motion[t] = m;
    }
    wait_for_copies();
    bool stale = __syncthreads_or(moved_far(reference, sh.position[t], sh.substep[0].allowed2));

    Totals total = {};
    int done = 0;
    int planned = 0;
    while (true) {
        if (stale) {
            sh.search.virial[t] = total.virial;
            search(batch, p, discs);
            disc = discs[sh.disc[t]];
            reference = sh.position[t];
            total.virial = sh.search.virial[t];
        }
        if (stale || done > 0) {
            __syncthreads();
            if (warp == 0) plan_substeps(p, done, lane);
            __syncthreads();
        }
        if (c.status != OK) {
            if (t == 0) fail(batch, rve);
            if (t == 0) queue_again(batch, launch, rve, false);
            return;
        }
        planned = c.header.imaged ? advance_substeps<true>(p, disc, reference, total, stale, t)
                                  : advance_substeps<false>(p, disc, reference, total, stale, t);
        done += planned;
        if (done == int(p.substeps)) break;
    }

    // Back into the order of discs. A search may be due soon where half of the squared way to it is
    // done.
    sh.virial[t] = total.virial;
    const Real half = Real(0.5) * sh.substep[planned].allowed2;
    const bool slow = __syncthreads_or(t < DISCS && moved_far(reference, sh.position[t], half));
    if (t == THREADS - 1) queue_again(batch, launch, rve, slow);
    const int seat = sh.seat[t];
    const Motion m = sh.motion[seat];
    const Virial virial = sh.virial[seat];
    batch.position[mine] = sh.position[seat];
    batch.velocity[mine] = {m.x, m.y};
    batch.spin[mine] = Real(2) * m.half_w;
    for (int k = t; k < int(c.header.owned); k += THREADS) {
        batch.tangential[size_t(rve) * SLOTS + k] = sh.slot.tangential[k];
    }
    const bool broken = t < DISCS && !isfinite(m.x + m.y + m.half_w);
    Partial part = {{warp_sum(virial.xx), warp_sum(virial.yy), warp_sum(virial.shear),
                     warp_sum(Real(total.contacts))},
                    warp_max(total.relative_overlap),
                    __any_sync(ALL, broken)};
    if (lane == 0) sh.partial[warp] = part;
    __syncthreads();
    if (warp > 0) return;
    part = lane < WARPS ? sh.partial[lane] : Partial{};
    part = {{warp_sum(part.sum[0]), warp_sum(part.sum[1]), warp_sum(part.sum[2]),
             warp_sum(part.sum[3])},
            warp_max(part.largest),
            __any_sync(ALL, part.broken)};
    if (lane == 0) finish(batch, p, rve, part);
}
