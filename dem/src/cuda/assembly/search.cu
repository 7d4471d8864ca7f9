// Search for neighbours: twin of dem/src/assembly/search.rs. Bins are filled with the discs of the window,
// and every own disc lists the discs within reach in the bins around it.

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
    return ((x / TILE * p.tiles[1] + y / TILE) * TILE + y % TILE) * TILE + x % TILE;
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

// In the count of a bin, a disc that has moved since the last search: beyond any number of discs.
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

// Puts every disc of the window into its bin.
extern "C" __global__ void assembly_bins(Arrays a, Parameters p, unsigned force) {
    await_turn();
    Control& c = *a.control;
    const unsigned i = p.window[0] + blockIdx.x * blockDim.x + threadIdx.x;
    if (has_failed(c) || has_drifted(c, p) || !is_due(c, p, force) || i >= p.window[1]) return;
    const Place place = discs_after(a, p, c.steps + c.done)[i].place;
    if (p.margin != 0 && p.own[0] <= i && i < p.own[1]) {
        const Signed drift = Signed(place.x - a.sorted[i]);
        const Fraction distance = Fraction(drift < 0 ? -drift : drift);
        if (distance > c.drift) atomicMax(&c.drift, distance);
    }
    const unsigned bin = bin_index(p, bin_x(p, place.x), bin_y(p, place.y));
    unsigned one = 1;
#if SLEEP
    const Position last = a.reference[i];
    if (place.x != last.x || place.y != last.y) one += MOVED;
#endif
    const unsigned slot = atomicAdd(&counts(a, p, c.searches)[bin], one) % MOVED;
    if (slot < p.capacity) {
        a.binned[size_t(bin) * p.capacity + slot] = {place.x, place.y, place.r, i};
    } else {
        fail(c, c.steps + c.done, BIN_FULL, a.id[i]);
    }
    a.reference[i] = {place.x, place.y};
}

// A disc within reach, and in the upper half how near it is, in the order of floating-point numbers.
using Near = unsigned long long;
constexpr Near NOBODY = ~Near(0);

__device__ inline Near near(Real distance2, Real touch, unsigned disc) {
    const unsigned bits = __float_as_uint(float(distance2 - touch * touch));
    const unsigned ordered = bits ^ (bits >> 31 ? 0xffffffffu : 0x80000000u);
    return Near(ordered) << 32 | disc;
}

// Collects the discs within reach, the nearest first: rows of a warp then touch alike, and the order does
// not depend on that of the bins. Returns their number, which may be more than there is room for.
__device__ inline unsigned collect(const Arrays& a, const Parameters& p, const Place& place,
                                   unsigned i, Near (&list)[ROWS]) {
    const unsigned* count = counts(a, p, a.control->searches);
    const unsigned x = bin_x(p, place.x);
    const unsigned y = bin_y(p, place.y);
    unsigned found = 0;
#pragma unroll
    for (unsigned row = 0; row < ROWS; ++row) list[row] = NOBODY;
    for (unsigned by = max(y, 1u) - 1; by <= min(y + 1, p.tiles[1] * TILE - 1); ++by) {
        for (unsigned bx = max(x, 1u) - 1; bx <= min(x + 1, p.tiles[0] * TILE - 1); ++bx) {
            const unsigned bin = bin_index(p, bx, by);
            const unsigned discs = min(count[bin] % MOVED, p.capacity);
            for (unsigned n = 0; n < discs; ++n) {
                const Binned other = a.binned[size_t(bin) * p.capacity + n];
                const Real lx = p.unit * Real(Signed(other.x - place.x));
                const Real ly = p.unit * Real(Signed(other.y - place.y));
                const Real touch = place.r + other.r;
                const Real distance2 = lx * lx + ly * ly;
                if (distance2 >= (touch + p.skin) * (touch + p.skin)) continue;
                if (unsigned(other.disc) == i) continue;
                ++found;
                // Insertion, without indices that are not known to the compiler.
                Near entry = near(distance2, touch, unsigned(other.disc));
#pragma unroll
                for (unsigned row = 0; row < ROWS; ++row) {
                    if (row >= found) break;
                    const Near larger = max(entry, list[row]);
                    list[row] = min(entry, list[row]);
                    entry = larger;
                }
            }
        }
    }
    return found;
}

// Whether a disc in the bins around has moved since the last search.
__device__ inline bool has_motion_near(const Arrays& a, const Parameters& p, const Place& place) {
    const unsigned* count = counts(a, p, a.control->searches);
    const unsigned x = bin_x(p, place.x);
    const unsigned y = bin_y(p, place.y);
    unsigned moved = p.bodies_move;
    for (unsigned by = max(y, 1u) - 1; by <= min(y + 1, p.tiles[1] * TILE - 1); ++by) {
        for (unsigned bx = max(x, 1u) - 1; bx <= min(x + 1, p.tiles[0] * TILE - 1); ++bx) {
            moved |= count[bin_index(p, bx, by)] / MOVED;
        }
    }
    return moved != 0;
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

    // Where nothing has moved since the last search, its lists hold.
    if (SLEEP && force == 0 && !has_motion_near(a, p, place)) return;

    Near list[ROWS];
    unsigned found = collect(a, p, place, i, list);
    if (found > ROWS) {
        fail(c, step, LIST_FULL, a.id[i]);
        found = ROWS;
    }

    const unsigned info = unsigned(now[i].motion.info);
    unsigned old_disc[ROWS];
    Memory old_memory[ROWS];
    unsigned old = 0;
    for (unsigned touched = info >> FIRST_ROW; touched != 0; touched &= touched - 1) {
        const size_t at = size_t(__ffs(int(touched)) - 1) * p.row + i;
        old_disc[old] = a.list[at];
        old_memory[old] = memory_at(p, a.history[at], ROWS);
        ++old;
    }
    unsigned touching = 0;
#pragma unroll
    for (unsigned row = 0; row < ROWS; ++row) {
        if (row >= found) continue;
        const size_t at = size_t(row) * p.row + i;
        const unsigned disc = unsigned(list[row]);
        a.list[at] = disc;
        for (unsigned k = 0; k < old; ++k) {
            if (old_disc[k] != disc) continue;
            remember(p, a.history[at], ROWS, old_memory[k]);
            touching |= 1u << row;
        }
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
