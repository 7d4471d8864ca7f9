// Renewal of the list, its seats and slots.
//
// A list is kept in shared memory from search to search, and in device memory between launches.

__device__ inline Vec any_separation(bool imaged, Position a, Position b, unsigned word) {
    return imaged ? separation<true>(a, b, word) : nearest(a, b);
}

// Position before the lattice reduction: its matrix has determinant 1.
__device__ inline Position before_reduction(const Fraction* m, Position s) {
    return {m[3] * s.x - m[1] * s.y, m[0] * s.y - m[2] * s.x};
}

__device__ inline int seat_in(unsigned neighbour) {
    return int((neighbour & 0xffffu) / sizeof(Position));
}

// The springs of a pair (N).
struct Springs {
    Real tangential;
#if ROLLING
    // Seen from the owner.
    Real rolling;
#endif

    __device__ bool relaxed() const {
#if ROLLING
        return tangential == Real(0) && rolling == Real(0);
#else
        return tangential == Real(0);
#endif
    }
};

// Springs in a slot.
__device__ inline Springs springs_at(int slot) {
    Springs springs;
    springs.tangential = shared().slot.tangential[slot];
#if ROLLING
    springs.rolling = shared().slot.rolling[slot];
#endif
    return springs;
}

// Springs that the pair of discs i and j had in the old list, if `owner` owned it there, seen from i;
// `word` is how i found j. Several images of one neighbour are told apart by their branch vectors,
// which a reduction does not change.
__device__ Springs history(int i, int j, unsigned word, int owner) {
    const Shared& sh = shared();
    const Control& c = sh.control;
    const int other = owner == i ? j : i;
    const Range rows = sh.owned[sh.seat[owner]];
    Springs springs = {};
    for (int slot = rows.first; slot < rows.end; slot += LANES) {
        const unsigned old_word = sh.slot.neighbour[slot];
        if (seat_in(old_word) != sh.seat[other]) continue;
        if (springs_at(slot).relaxed()) continue;
        bool same = true;
        if (c.header.imaged) {
            const Vec now = branch(c.cell, separation<true>(sh.body[i].s, sh.body[j].s, word << 16));
            const Position from = before_reduction(c.transform, sh.body[owner].s);
            const Position to = before_reduction(c.transform, sh.body[other].s);
            const Vec old = branch(c.old_cell, any_separation(c.old_imaged, from, to, old_word));
            // Of a disc's own two images the other one may have been listed.
            const bool turned = i == j ? now.x * old.x + now.y * old.y < Real(0) : owner == j;
            const Real dx = turned ? now.x + old.x : now.x - old.x;
            const Real dy = turned ? now.y + old.y : now.y - old.y;
            same = dx * dx + dy * dy < Real(0.01) * (now.x * now.x + now.y * now.y);
        }
        if (same) springs = springs_at(slot);
    }
#if ROLLING
    if (owner == j) springs.rolling = -springs.rolling;
#endif
    return springs;
}

// Seats disc t: a stable counting sort by falling class, so that the discs of a warp own as many
// pairs. Also gives it its slots. The seats depend on the list only: list.rs takes the same.
__device__ void take_seat(int owned, int incoming, int t) {
    Shared& sh = shared();
    Header& header = sh.control.header;
    const int lane = t % LANES;
    const int warp = t / LANES;
    // First by owned pairs, then by the others, falling and rising in turns so that neither jumps.
    // Other numbers than these are rare; their classes need not be exact.
    const int other = min(max(owned + incoming - 3, 0), 4);
    const int kind = t < DISCS ? 1 + 5 * min(owned, 5) + (owned % 2 == 0 ? other : 4 - other) : 0;

    const unsigned peers = __match_any_sync(ALL, kind);
    const unsigned before = peers & ((1u << lane) - 1u);
    sh.search.census[warp][lane] = 0;
    if (warp == 0) sh.search.rows[0][lane] = sh.search.rows[1][lane] = 0;
    __syncwarp();
    if (before == 0) sh.search.census[warp][kind] = (unsigned short)__popc(peers);
    __syncthreads();

    // Lane = class: threads of it in earlier warps, and in all; then all of higher classes.
    int earlier = 0;
    int total = 0;
    for (int w = 0; w < WARPS; ++w) {
        const int n = sh.search.census[w][lane];
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
    atomicMax(&sh.search.rows[0][seat / LANES], unsigned(owned));
    atomicMax(&sh.search.rows[1][seat / LANES], unsigned(incoming));
    __syncthreads();

    // Warp 0 places the slots of owned pairs and, if there is one, warp 1 the others.
    for (int k = warp; k < 2; k += WARPS) {
        const unsigned own = LANES * sh.search.rows[k][lane];
        unsigned sum = own;
        for (int d = 1; d < LANES; d *= 2) {
            const unsigned other = __shfl_up_sync(ALL, sum, d);
            if (lane >= d) sum += other;
        }
        const unsigned room = k == 0 ? SLOTS : INCOMING_SLOTS;
        if (sum > room && sh.control.status == OK) sh.control.status = SLOTS_FULL;
        sh.search.first[k][lane] = sum - own;
        if (lane == LANES - 1) (k == 0 ? header.owned : header.incoming) = min(sum, room);
    }
    __syncthreads();
    const int first_owned = int(sh.search.first[0][seat / LANES]) + seat % LANES;
    const int first_incoming = int(sh.search.first[1][seat / LANES]) + seat % LANES;
    sh.owned[seat] = {(unsigned short)first_owned, (unsigned short)(first_owned + owned * LANES)};
    sh.incoming[seat] = {(unsigned short)first_incoming,
                         (unsigned short)(first_incoming + incoming * LANES)};
}

// Slot that the owner in seat j gives to the pair with its neighbour `word`, or -1.
__device__ int owner_slot(int j, unsigned word) {
    const Range rows = shared().owned[j];
    for (int slot = rows.first; slot < rows.end; slot += LANES) {
        if (shared().slot.neighbour[slot] == word) return slot;
    }
    return -1;
}

// Renews the list, keeping the springs. Thread t searches for disc t. Positions and
// velocities are by seat, before by the old seats and then by the new ones. Ends with a barrier.
__device__ __noinline__ void search(const Batch& batch, const Parameters& p, const Disc* discs) {
    Shared& sh = shared();
    Control& c = sh.control;
    const unsigned rve = c.rve;
    const int t = int(threadIdx.x);
    const bool has_disc = t < DISCS;
    const Disc disc = discs[t];

    // Into the order of discs.
    Body body = sh.body[t];
    Real half_w = sh.half_w[t];
    const int seated = sh.disc[t];
    sh.seat[seated] = (unsigned short)t;
    const Real fastest2 = warp_max(body.u.x * body.u.x + body.u.y * body.u.y);
    if (t % LANES == 0) sh.search.fastest2[t / LANES] = fastest2;
    __syncthreads();
    sh.body[seated] = body;
    sh.half_w[seated] = half_w;
    if (t == 0) {
        Real most = 0;
        for (int w = 0; w < WARPS; ++w) most = max(most, sh.search.fastest2[w]);
        reduce_lattice(c, p, sqrt(most));
    }
    __syncthreads();
    body = sh.body[t];
    half_w = sh.half_w[t];
    const Position before = body.s;
    const Position s = {c.transform[0] * before.x + c.transform[1] * before.y,
                        c.transform[2] * before.x + c.transform[3] * before.y};
    body.s = s;
    sh.body[t].s = s;
    __syncthreads();

    Found found;
    found.count = 0;
    const bool imaged = found.imaged = c.header.imaged;
    fill_bins(s, disc.r, t);
    if (has_disc && imaged) find_images(found, s, disc.r, t);
    if (has_disc && !imaged) find_nearest(found, s, disc.r, t);
    if (found.count > ROWS) {
        found.count = ROWS;
        c.status = LIST_FULL;
    }
    __syncthreads();
    sh.search.constants[t] = {disc.r, disc.inv_mass};
    found.sort();

    // Masks over what was found.
    unsigned owned = 0;
    for (int row = 0; row < found.count; ++row) {
        const unsigned word = found.at(row);
        const Position other = sh.body[word >> 16].s;
        owned |= unsigned(owns(t, s, word >> 16, other, imaged, word & 0xffffu)) << row;
    }
    const unsigned others = ((1u << found.count) - 1u) & ~owned;
    Springs springs[ROWS];
    int count = 0;
    for (unsigned rest = owned; rest != 0; rest &= rest - 1, ++count) {
        const unsigned word = found.at(__ffs(int(rest)) - 1);
        const int j = word >> 16;
        Springs found_here = history(t, j, word, t);
        if (found_here.relaxed()) found_here = history(t, j, word, j);
        springs[count] = found_here;
    }
    // All have read what goes by discs and by the old seats.
    __syncthreads();
    take_seat(__popc(owned), __popc(others), t);
    if (c.status != OK) return;

    const int seat = sh.seat[t];
    int slot = sh.owned[seat].first;
    count = 0;
    for (unsigned rest = owned; rest != 0; rest &= rest - 1, ++count, slot += LANES) {
        const unsigned word = found.at(__ffs(int(rest)) - 1);
        const Vec other = sh.search.constants[word >> 16];
        sh.slot.neighbour[slot] = sh.seat[word >> 16] * sizeof(Position) | word << 16;
        sh.slot.pair[slot] = {
            disc.r + other.x,
            p.dashpot * sqrt(p.normal_stiffness / (disc.inv_mass + other.y))};
        sh.slot.tangential[slot] = springs[count].tangential;
#if ROLLING
        sh.slot.rolling[slot] = springs[count].rolling;
#endif
    }
    sh.body[seat] = body;
    sh.half_w[seat] = half_w;
    batch.reference[rve * THREADS + seat] = s;
    batch.seated[rve * THREADS + seat] = (unsigned short)t;
    __syncthreads();

    slot = sh.incoming[seat].first;
    for (unsigned rest = others; rest != 0; rest &= rest - 1, slot += LANES) {
        const unsigned word = found.at(__ffs(int(rest)) - 1);
        const unsigned image = imaged ? reversed(word >> 7 & 127u) << 7 | reversed(word & 127u) : 0;
        const int at_owner =
            owner_slot(sh.seat[word >> 16], seat * sizeof(Position) | image << 16);
        // Only a full list misses it.
        if (at_owner < 0) c.status = LIST_FULL;
        sh.slot.incoming[slot] = (unsigned short)max(at_owner, 0);
        batch.incoming[size_t(rve) * INCOMING_SLOTS + slot] = sh.slot.incoming[slot];
    }
    for (int k = t; k < int(c.header.owned); k += THREADS) {
        batch.neighbour[size_t(rve) * SLOTS + k] = sh.slot.neighbour[k];
        batch.pair[size_t(rve) * SLOTS + k] = sh.slot.pair[k];
    }
    const Range own = sh.owned[t], other = sh.incoming[t];
    batch.rows[rve * THREADS + t] = {own.first, own.end, other.first, other.end};
    __syncthreads();
}
