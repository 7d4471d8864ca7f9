// Search for neighbours: twin of dem/src/assembly/search.rs. Bins are filled with the discs of the window, and every own
// disc lists the discs within reach in the bins around it, if any of those in these bins has moved since its reference
// was taken.
//
// Lists miss no contact: discs make no step once one is further than `allowed` from its reference. Since a list was made,
// each of a pair has then moved by `allowed + stayed` at most, as references that were kept were at most `stayed` away,
// and the skin is twice that. Discs in bins that are not neighbours are a skin apart at any search.

// Whether a search is due after the present round: the lists are outdated, or would be within another
// round of the same motion.
__device__ inline bool is_due(const Control& c, const Parameters& p, unsigned force) {
    if (force != 0) return true;
    const Real now = sqrt(real_of(c.moved[c.done]));
    const Real before = sqrt(real_of(c.moved[0]));
    return now > p.allowed || now + Real(1.1) * (now - before) > p.allowed;
}

// Bins of a tile follow each other, and tiles column by column: a part of memory is a vertical slab.
__device__ inline unsigned bin_index(const Parameters& p, unsigned x, unsigned y) {
    return x / TILE * p.tiles[1] * TILE * TILE + y * TILE + x % TILE;
}

__device__ inline unsigned bins_in_all(const Parameters& p) {
    return p.tiles[0] * p.tiles[1] * TILE * TILE;
}

__device__ inline unsigned bin_x(const Parameters& p, Fraction s) {
    return min(unsigned(bin_of(s, int(p.bins))), p.tiles[0] * TILE - 1);
}

__device__ inline unsigned bin_y(const Parameters& p, Fraction s) {
    return min(unsigned(bin_of(s, int(p.bins))), p.tiles[1] * TILE - 1);
}

// In the count of a bin, a disc that has moved since its reference was taken: beyond any number of discs.
constexpr unsigned MOVED = 1u << 16;

__device__ inline unsigned* counts(const Arrays& a, const Parameters& p, unsigned searches) {
    return a.bin_count + size_t(searches & 1u) * bins_in_all(p);
}

// Places bodies at the start of a sequence of steps.
extern "C" __global__ void assembly_begin(Arrays a, Parameters p) {
    const Control& c = *a.control;
    const double time = time_after(c, p, c.steps);
    for (unsigned b = threadIdx.x; b < p.bodies; b += blockDim.x) {
        place_body(&a.body[b], &bodies_after(a, p, c.steps)[b], p.origin[0], p.origin[1], p.side,
                   time, time);
    }
}

// Ends the steps of a round for every disc of the window: looks whether it rests, and puts it into its bin where a
// search is due.
extern "C" __global__ void assembly_bins(Arrays a, Parameters p, unsigned force) {
    await_turn();
    Control& c = *a.control;
    const unsigned i = p.window[0] + blockIdx.x * blockDim.x + threadIdx.x;
    if (has_failed(c) || i >= p.window[1]) return;
    Disc& disc = discs_after(a, p, c.steps + c.done)[i];
#if SLEEP
    if (c.done != 0) look(a, p, disc, i);
#endif
    if (has_drifted(c, p) || !is_due(c, p, force)) return;
    const Place place = disc.place;
    if (p.margin != 0 && p.own[0] <= i && i < p.own[1]) {
        const Signed drift = Signed(place.x - a.sorted[i]);
        const Fraction distance = Fraction(drift < 0 ? -drift : drift);
        if (distance > c.drift) atomicMax(&c.drift, distance);
    }
    const unsigned bin = bin_index(p, bin_x(p, place.x), bin_y(p, place.y));
    const Position last = a.reference[i];
    const Real x = p.unit * Real(Signed(place.x - last.x));
    const Real y = p.unit * Real(Signed(place.y - last.y));
    const bool moved = force != 0 || x * x + y * y > p.stayed * p.stayed;
    if (moved) a.reference[i] = {place.x, place.y};
    const unsigned one = moved ? 1 + MOVED : 1;
    const unsigned slot = atomicAdd(&counts(a, p, c.searches)[bin], one) % MOVED;
    if (slot < p.capacity) {
        a.binned[size_t(bin) * p.capacity + slot] = {place.x, place.y, place.r, i};
    } else {
        fail(c, c.steps + c.done, BIN_FULL, a.id[i]);
    }
}

// The bins around a disc, row by row.
struct Around {
    unsigned bin[9];
    unsigned discs[9];
    // Whether a disc in them has moved.
    bool moved;
};

__device__ inline Around bins_around(const Arrays& a, const Parameters& p, const Place& place) {
    const unsigned* count = counts(a, p, a.control->searches);
    const unsigned x = bin_x(p, place.x);
    const unsigned y = bin_y(p, place.y);
    const unsigned columns = p.tiles[0] * TILE;
    const unsigned rows = p.tiles[1] * TILE;
    Around around;
    unsigned all = 0;
#pragma unroll
    for (unsigned k = 0; k < 9; ++k) {
        // Below zero wraps round to beyond the last one.
        const unsigned bx = x + k % 3 - 1;
        const unsigned by = y + k / 3 - 1;
        around.bin[k] = bin_index(p, bx, by);
        const unsigned discs = bx < columns && by < rows ? count[around.bin[k]] : 0;
        around.discs[k] = min(discs % MOVED, p.capacity);
        all |= discs;
    }
    around.moved = all >= MOVED;
    return around;
}

// A disc within reach, and in the upper half how near it is, in the order of floating-point numbers.
using Near = unsigned long long;
constexpr Near NOBODY = ~Near(0);

__device__ inline Near near(float distance2, unsigned disc) {
    const unsigned bits = __float_as_uint(distance2);
    const unsigned ordered = bits ^ (bits >> 31 ? 0xffffffffu : 0x80000000u);
    return Near(ordered) << 32 | disc;
}

// Puts the entries of a list in ascending order: Batcher's odd-even merge sort, all of whose comparisons are known
// to the compiler.
__device__ inline void sort_list(Near (&list)[ROWS]) {
#pragma unroll
    for (unsigned p = 1; p < ROWS; p *= 2) {
#pragma unroll
        for (unsigned k = p; k > 0; k /= 2) {
#pragma unroll
            for (unsigned n = k % p; n + k < ROWS; ++n) {
                if ((n - k % p) / k % 2 != 0 || n / (2 * p) != (n + k) / (2 * p)) continue;
                const Near first = list[n];
                const Near second = list[n + k];
                const bool swap = second < first;
                list[n] = swap ? second : first;
                list[n + k] = swap ? first : second;
            }
        }
    }
}

// A disc within reach as it is met, by how much further than touch (m²).
struct Met {
    float distance2;
    unsigned disc;
};

// Collects the discs within reach, the nearest first: rows of a warp then touch alike, and the order does
// not depend on that of the bins. Returns their number, which may be more than there is room for.
__device__ inline unsigned collect(const Arrays& a, const Parameters& p, const Around& around,
                                   const Place& place, unsigned i, Near (&list)[ROWS]) {
    // Of each thread its own, in the order of the bins: registers have no index that varies.
    __shared__ Met met[ROWS][COPY_THREADS];
    const Real reach = place.r + p.skin;
    unsigned found = 0;
#pragma unroll
    for (unsigned k = 0; k < 9; ++k) {
        const Binned* binned = a.binned + size_t(around.bin[k]) * p.capacity;
#pragma unroll 1
        for (unsigned n = 0; n < around.discs[k]; ++n) {
            const Binned other = binned[n];
            const Real lx = p.unit * Real(Signed(other.x - place.x));
            const Real ly = p.unit * Real(Signed(other.y - place.y));
            const Real within = reach + other.r;
            const Real distance2 = lx * lx + ly * ly;
            if (distance2 >= within * within || unsigned(other.disc) == i) continue;
            const Real touch = place.r + other.r;
            if (found < ROWS) {
                met[found][threadIdx.x] = {float(distance2 - touch * touch), unsigned(other.disc)};
            }
            ++found;
        }
    }
#pragma unroll
    for (unsigned row = 0; row < ROWS; ++row) {
        const Met& one = met[row][threadIdx.x];
        list[row] = row < found ? near(one.distance2, one.disc) : NOBODY;
    }
    sort_list(list);
    return found;
}

// Lists the bodies within reach; returns whether there are any.
__device__ inline bool list_bodies(const Arrays& a, const Parameters& p, const Place& place,
                                   unsigned i, unsigned step, bool had) {
    const unsigned old_bodies = a.near_bodies[i];
    Memory old_memory[4] = {};
    if (had) {
        for (unsigned k = 0; k < 4; ++k) {
            old_memory[k] = memory_at(p, a.body_history[size_t(k) * p.row + i], NEAR_BODIES);
        }
    }
    unsigned listed = 0xffffffffu;
    unsigned found = 0;
    const Real range = place.r + p.skin;
    for (unsigned b = 0; b < p.bodies; ++b) {
        const Vec l = branch_to(p, bodies_after(a, p, step)[b], place);
        if (l.x * l.x + l.y * l.y >= range * range) continue;
        if (found == 4) {
            fail(*a.control, step, BODIES_FULL, a.id[i]);
            break;
        }
        Memory memory = {};
        for (unsigned k = 0; k < 4; ++k) {
            if (had && (old_bodies >> (8 * k) & 255u) == b) memory = old_memory[k];
        }
        remember(p, a.body_history[size_t(found) * p.row + i], NEAR_BODIES, memory);
        listed &= ~(255u << (8 * found)) | b << (8 * found);
        ++found;
    }
    a.near_bodies[i] = listed;
    return found != 0;
}

// Lists the neighbours of every own disc; touching pairs keep their history.
extern "C" __global__ void assembly_list(Arrays a, Parameters p, unsigned force) {
    await_turn();
    Control& c = *a.control;
    if (has_failed(c) || has_drifted(c, p) || !is_due(c, p, force)) return;
    const unsigned n = blockIdx.x * blockDim.x + threadIdx.x;
    // For the next search.
    unsigned* next = counts(a, p, c.searches + 1);
    for (unsigned b = n; b < bins_in_all(p); b += gridDim.x * blockDim.x) next[b] = 0;
    const unsigned i = p.own[0] + n;
    if (i >= p.own[1]) return;
    const unsigned step = c.steps + c.done;
    Disc* now = discs_after(a, p, step);
    const Place place = now[i].place;
    if (place.inv_mass == Real(0)) return;

    // Where no disc has moved, the list holds.
    const Around around = bins_around(a, p, place);
    if (!around.moved && p.bodies_move == 0) return;

    Near list[ROWS];
    unsigned found = collect(a, p, around, place, i, list);
    if (found > ROWS) {
        fail(c, step, LIST_FULL, a.id[i]);
        found = ROWS;
    }

    const unsigned info = unsigned(now[i].motion.info);
    // Memories of contacts, by their new row: all are read before any is written.
    Memory kept[ROWS];
    unsigned touching = 0;
    for (unsigned touched = info >> FIRST_ROW; touched != 0; touched &= touched - 1) {
        const size_t at = size_t(__ffs(int(touched)) - 1) * p.row + i;
        const unsigned disc = a.list[at];
        const Memory memory = memory_at(p, a.history[at], ROWS);
        unsigned now_at = ROWS;
#pragma unroll
        for (unsigned row = 0; row < ROWS; ++row) {
            if (unsigned(list[row]) == disc) now_at = row;
        }
        if (now_at == ROWS) continue;
        kept[now_at] = memory;
        touching |= 1u << now_at;
    }
#pragma unroll
    for (unsigned row = 0; row < ROWS; ++row) {
        if (row < found) a.list[size_t(row) * p.row + i] = unsigned(list[row]);
    }
    for (unsigned rows = touching; rows != 0; rows &= rows - 1) {
        const unsigned row = unsigned(__ffs(int(rows)) - 1);
        remember(p, a.history[size_t(row) * p.row + i], ROWS, kept[row]);
    }
    const bool had = (info & BODIES_NEAR) != 0;
    const bool bodies = list_bodies(a, p, place, i, step, had);
    const unsigned state = info & STATE_MASK;
    now[i].motion.info = found | (bodies ? BODIES_NEAR : 0u) | state | touching << FIRST_ROW;
}

// Ends a round: counts its steps. Where windows have to be widened before the search that is due, no step is
// made until then.
extern "C" __global__ void assembly_finish(Arrays a, Parameters p, unsigned force) {
    await_turn();
    Control& c = *a.control;
    const bool drifted = has_drifted(c, p);
    const Fraction moved = drifted ? bits_of(FAILED) : c.moved[c.done];
    const bool searched = !drifted && is_due(c, p, force);
    c.rounds += c.done != 0;
    c.steps += c.done;
    c.done = 0;
    for (unsigned k = 0; k <= STEPS; ++k) c.moved[k] = 0;
    if (searched) {
        c.searches += 1;
        c.searched = c.steps;
    } else {
        c.moved[0] = moved;
    }
}
