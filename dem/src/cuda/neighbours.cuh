// Verlet list: twin of dem/src/neighbours.rs.
//
// A list is kept in shared memory from search to search, and in device memory between launches.

// A skin weighs searches against pairs listed in vain. A search costs as much as about 16 substeps
// and is due whenever the fastest disc has moved half the skin; every skin of one largest radius
// makes a substep 0.4 times dearer. With n substeps in which the fastest disc moves v, the cost
// 16 * 2 v / skin + 0.4 n skin / r_max is least at this skin for n = 9.
__device__ inline double best_skin(double travel, const Header& h, const Parameters& p) {
    const double skin = 3.0 * sqrt(0.5 * h.reach * travel);
    return fmin(fmax(skin, p.least_skin), p.skin);
}

// Lattice reduction until the cell vectors are as short as can be, and what the search needs.
// `fastest` is the largest speed of a disc (m/s).
__device__ void reduce_lattice(Control& c, const Parameters& p, double fastest) {
    Header& h = c.header;
    Fraction m[4] = {1, 0, 0, 1};
    to_real(scaled(h.cell, 1.0 / PERIOD), c.old_cell);
    // Terminates as every step shortens a vector; the bound is for cells that are not finite.
#pragma unroll 1
    for (int step = 0; step < 64 && oblique(h.cell); ++step) {
        // The longer vector loses the other one k times.
        const double dot = h.cell.xx * h.cell.xy + h.cell.yx * h.cell.yy;
        const double aa = h.cell.xx * h.cell.xx + h.cell.yx * h.cell.yx;
        const double bb = h.cell.xy * h.cell.xy + h.cell.yy * h.cell.yy;
        const double k = round(dot / fmin(aa, bb));
        const Fraction n = Fraction(Signed(k));
        if (aa <= bb) {
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
    to_real(scaled(h.cell, 1.0 / PERIOD), c.cell);
    to_real(scaled(h.cell, 1.0 / PERIOD), c.reference_cell);
    double gradient2 = 0.0;
    for (int i = 0; i < 4; ++i) gradient2 += double(c.drive[i]) * double(c.drive[i]);
    const double speed = fastest + 0.5 * h.reach * sqrt(gradient2);
    h.skin = best_skin(speed * p.dt * p.substeps, h, p);
    const double2 w = widths(h.cell);
    // With three bins each way no pair within reach has a second image within reach.
    const double x = floor(w.x / (h.reach + h.skin));
    const double y = floor(w.y / (h.reach + h.skin));
    c.old_imaged = h.imaged;
    h.imaged = !(x >= 3.0 && y >= 3.0);
    c.bins[0] = int(fmin(x, double(BINS)));
    c.bins[1] = int(fmin(y, double(BINS)));
    c.searches += 1;
}

// Neighbours of one disc while they are searched.
struct Found {
    // Neighbour << 16 | image.
    unsigned word[ROWS];
    int count;
    bool full;

    __device__ void add(unsigned entry) {
        full |= count == ROWS;
        if (count < ROWS) word[count++] = entry;
    }

    // Ascending by neighbour and image. Selection: lanes of a warp stay together.
    __device__ void sort() {
#pragma unroll 1
        for (int row = 0; row < count; ++row) {
            unsigned least = word[row];
            int place = row;
            for (int k = row + 1; k < count; ++k) {
                const unsigned other = word[k];
                if (other < least) {
                    least = other;
                    place = k;
                }
            }
            word[place] = word[row];
            word[row] = least;
        }
    }
};

// Counting sort of the seats into bins. Within a bin their order depends on timing, but what
// is found gets sorted.
__device__ void fill_bins(Position s, int t) {
    Shared& sh = shared();
    const int nx = sh.control.bins[0];
    const int ny = sh.control.bins[1];
    const int bin = bin_of(s.y, ny) * nx + bin_of(s.x, nx);
    for (int b = t; b < nx * ny; b += THREADS) sh.search.bin_end[b] = 0;
    __syncthreads();
    if (t < DISCS) atomicAdd(&sh.search.bin_end[bin], 1u);
    __syncthreads();
    if (t < LANES) {
        unsigned before = 0;
        for (int b = t; b - t < nx * ny; b += LANES) {
            const unsigned own = b < nx * ny ? sh.search.bin_end[b] : 0;
            unsigned sum = own;
            for (int d = 1; d < LANES; d *= 2) {
                const unsigned other = __shfl_up_sync(ALL, sum, d);
                if (t >= d) sum += other;
            }
            if (b < nx * ny) sh.search.bin_end[b] = before + sum - own;
            before += __shfl_sync(ALL, sum, LANES - 1);
        }
    }
    __syncthreads();
    // Each bin's start walks up to its end.
    if (t < DISCS) sh.search.bin[atomicAdd(&sh.search.bin_end[bin], 1u)] = (unsigned short)t;
    __syncthreads();
}

// Nearest images among the seats `bin[first..end]`.
__device__ inline void find_in(Found& found, int first, int end, Position s, Real r, int t) {
    const Shared& sh = shared();
    const Real* const cell = sh.control.cell;
    const Real skin = Real(sh.control.header.skin);
#pragma unroll 1
    for (int k = first; k < end; ++k) {
        const int j = sh.search.bin[k];
        // Summed in this order both discs of a pair find the same.
        const Real range = r + sh.search.radius[j] + skin;
        const Vec d = nearest(s, sh.position[j]);
        if (length2(cell, d) < range * range && j != t) found.add(unsigned(sh.disc[j]) << 16);
    }
}

// Nearest images in the 3 x 3 bins around the disc in seat t. Bins of a row follow each other.
__device__ void find_binned(Found& found, Position s, Real r, int t) {
    const unsigned* const bin_end = shared().search.bin_end;
    const int nx = shared().control.bins[0];
    const int ny = shared().control.bins[1];
    const int bx = bin_of(s.x, nx);
    const int by = bin_of(s.y, ny);
    const auto start = [&](int bin) { return bin == 0 ? 0 : int(bin_end[bin - 1]); };
#pragma unroll 1
    for (int dy = -1; dy <= 1; ++dy) {
        const int y = by + dy < 0 ? ny - 1 : by + dy == ny ? 0 : by + dy;
        const int row = y * nx;
        find_in(found, start(row + max(bx - 1, 0)), int(bin_end[row + min(bx + 1, nx - 1)]), s, r, t);
        // The bin across the edge of the cell.
        const int across = row + (bx == 0 ? nx - 1 : 0);
        if (bx == 0 || bx == nx - 1) find_in(found, start(across), int(bin_end[across]), s, r, t);
    }
}

// All images of all discs around the disc in seat t, its own included: right for any cell.
__device__ void find_all_images(Found& found, Position s, Real r, int t) {
    const Shared& sh = shared();
    const double skin = sh.control.header.skin;
    const Matrix h = sh.control.header.cell;
    const double2 w = widths(h);
#pragma unroll 1
    for (int j = 0; j < DISCS; ++j) {
        const double range = double(r) + double(sh.search.radius[j]) + skin;
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
                if (t == j && kx == 0 && ky == 0) continue;
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
                found.add(unsigned(sh.disc[j]) << 16 | image_code(shift_y, uy) << 7 |
                             image_code(shift_x, ux));
            }
        }
    }
}

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

// Tangential force that the discs in seats t and j had in the old list, where the disc in seat
// `owner` has the pair; `word` is how t found it. Several images of one neighbour are told apart by
// their branch vectors, which a reduction does not change.
__device__ Real history(int t, int j, unsigned word, int owner) {
    const Shared& sh = shared();
    const Control& c = sh.control;
    const Rows rows = sh.rows[owner];
    Real tangential = 0;
    for (int slot = rows.owned; slot < rows.owned_end; slot += LANES) {
        const unsigned old_word = sh.slot.neighbour[slot];
        if (seat_in(old_word) != (owner == t ? j : t)) continue;
        if (sh.slot.tangential[slot] == Real(0)) continue;
        bool same = true;
        if (c.header.imaged) {
            const Position a = sh.position[t];
            const Position b = sh.position[j];
            const Position from = owner == t ? a : b;
            const Position to = owner == t ? b : a;
            const Vec now = branch(c.cell, separation<true>(a, b, word << 16));
            const Vec old = branch(c.old_cell,
                                   any_separation(c.old_imaged, before_reduction(c.transform, from),
                                                  before_reduction(c.transform, to), old_word));
            // Of a disc's own two images the other one may have been listed.
            const bool turned = t == j ? now.x * old.x + now.y * old.y < Real(0) : owner == j;
            const Real dx = turned ? now.x + old.x : now.x - old.x;
            const Real dy = turned ? now.y + old.y : now.y - old.y;
            same = dx * dx + dy * dy < Real(0.01) * (now.x * now.x + now.y * now.y);
        }
        if (same) tangential = sh.slot.tangential[slot];
    }
    return tangential;
}

// Seats disc i: a stable counting sort of the block's threads by falling class, so that the discs of
// a warp own as many pairs. Also gives it its slots.
__device__ void take_seat(int owned, int incoming, int i, bool has_disc, int t) {
    Shared& sh = shared();
    Header& header = sh.control.header;
    const int lane = t % LANES;
    const int warp = t / LANES;
    // First by owned pairs, then by the others, falling and rising in turns so that neither jumps.
    // Other numbers than these are rare; their classes need not be exact.
    const int other = min(max(owned + incoming - 3, 0), 4);
    const int kind = has_disc ? 1 + 5 * min(owned, 5) + (owned % 2 == 0 ? other : 4 - other) : 0;

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
    sh.seat[i] = (unsigned short)seat;
    sh.disc[seat] = (unsigned short)i;
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
    sh.rows[seat] = {
        (unsigned short)first_owned, (unsigned short)(first_owned + owned * LANES),
        (unsigned short)first_incoming, (unsigned short)(first_incoming + incoming * LANES)};
}

// Slot that the owner in seat j gives to the pair with its neighbour `word`, or -1.
__device__ int owner_slot(int j, unsigned word) {
    const Rows rows = shared().rows[j];
    for (int slot = rows.owned; slot < rows.owned_end; slot += LANES) {
        if (shared().slot.neighbour[slot] == word) return slot;
    }
    return -1;
}

// Renews the list, keeping the tangential forces. Positions, velocities and `search.virial` are by
// seat, before by the old seats and then by the new ones. Ends with a barrier.
__device__ __noinline__ void search(const Batch& batch, const Parameters& p, const Disc* discs) {
    Shared& sh = shared();
    Control& c = sh.control;
    const unsigned rve = c.rve;
    const int t = int(threadIdx.x);
    const bool has_disc = t < DISCS;
    const int i = sh.disc[t];
    const Disc disc = discs[i];
    const Motion m = sh.motion[t];
    const Virial virial = sh.search.virial[t];

    const Real fastest2 = warp_max(has_disc ? m.x * m.x + m.y * m.y : Real(0));
    if (t % LANES == 0) sh.partial[t / LANES].largest = fastest2;
    __syncthreads();
    if (t == 0) {
        Real most = 0;
        for (int w = 0; w < WARPS; ++w) most = max(most, sh.partial[w].largest);
        reduce_lattice(c, p, sqrt(double(most)));
    }
    __syncthreads();
    Position s = sh.position[t];
    s = {c.transform[0] * s.x + c.transform[1] * s.y, c.transform[2] * s.x + c.transform[3] * s.y};
    sh.position[t] = s;
    sh.search.radius[t] = disc.r;
    __syncthreads();

    Found found;
    found.count = 0;
    found.full = false;
    const bool imaged = c.header.imaged;
    if (imaged) {
        if (has_disc) find_all_images(found, s, disc.r, t);
    } else {
        fill_bins(s, t);
        if (has_disc) find_binned(found, s, disc.r, t);
    }
    if (found.full) c.status = LIST_FULL;
    found.sort();

    // Masks over what was found.
    unsigned owned = 0;
    for (int row = 0; row < found.count; ++row) {
        const unsigned word = found.word[row];
        const Position other = sh.position[sh.seat[word >> 16]];
        owned |= unsigned(owns(i, s, word >> 16, other, imaged, word & 0xffffu)) << row;
    }
    const unsigned others = ((1u << found.count) - 1u) & ~owned;
    Real tangential[ROWS];
    int count = 0;
    for (unsigned rest = owned; rest != 0; rest &= rest - 1, ++count) {
        const unsigned word = found.word[__ffs(int(rest)) - 1];
        const int j = sh.seat[word >> 16];
        Real force = history(t, j, word, t);
        if (force == Real(0)) force = history(t, j, word, j);
        tangential[count] = force;
    }
    // All have read what goes by the old seats.
    __syncthreads();
    take_seat(__popc(owned), __popc(others), i, has_disc, t);
    if (c.status != OK) return;

    const int seat = sh.seat[i];
    const Rows rows = sh.rows[seat];
    int slot = rows.owned;
    count = 0;
    for (unsigned rest = owned; rest != 0; rest &= rest - 1, ++count, slot += LANES) {
        const unsigned word = found.word[__ffs(int(rest)) - 1];
        const Disc other = discs[word >> 16];
        sh.slot.neighbour[slot] = sh.seat[word >> 16] * sizeof(Position) | word << 16;
        sh.slot.pair[slot] = {
            disc.r + other.r,
            p.dashpot * sqrt(p.normal_stiffness / (disc.inv_mass + other.inv_mass))};
        sh.slot.tangential[slot] = tangential[count];
    }
    sh.position[seat] = s;
    sh.motion[seat] = m;
    sh.search.virial[seat] = virial;
    batch.reference[rve * THREADS + i] = s;
    batch.seat[rve * THREADS + i] = (unsigned short)seat;
    __syncthreads();

    slot = rows.incoming;
    for (unsigned rest = others; rest != 0; rest &= rest - 1, slot += LANES) {
        const unsigned word = found.word[__ffs(int(rest)) - 1];
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
    batch.rows[rve * THREADS + t] = sh.rows[t];
    __syncthreads();
}
