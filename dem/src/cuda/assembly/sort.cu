// Puts the discs in the order of bins, so that neighbours are near in memory.

constexpr unsigned SCAN_THREADS = 1024;
// Bins that one block sums up.
constexpr unsigned CHUNK = 8 * SCAN_THREADS;

// Sum over the threads up to and including this one.
__device__ inline unsigned block_scan(unsigned x) {
    __shared__ unsigned warps[LANES];
    const unsigned lane = threadIdx.x % LANES;
    const unsigned warp = threadIdx.x / LANES;
    for (unsigned d = 1; d < LANES; d *= 2) {
        const unsigned below = __shfl_up_sync(ALL, x, d);
        if (lane >= d) x += below;
    }
    if (lane == LANES - 1) warps[warp] = x;
    __syncthreads();
    if (warp == 0) {
        unsigned sum = warps[lane];
        for (unsigned d = 1; d < LANES; d *= 2) {
            const unsigned below = __shfl_up_sync(ALL, sum, d);
            if (lane >= d) sum += below;
        }
        warps[lane] = sum;
    }
    __syncthreads();
    const unsigned before = warp == 0 ? 0 : warps[warp - 1];
    __syncthreads();
    return before + x;
}

// Number of discs in each chunk of bins.
extern "C" __global__ void __launch_bounds__(SCAN_THREADS) assembly_count(Arrays a, Parameters p, unsigned* chunk) {
    const unsigned* count = counts(a, p, a.control->searches);
    const unsigned bins = bins_in_all(p);
    unsigned sum = 0;
    for (unsigned n = threadIdx.x; n < CHUNK; n += SCAN_THREADS) {
        const unsigned bin = blockIdx.x * CHUNK + n;
        sum += bin < bins ? count[bin] % MOVED : 0;
    }
    sum = block_scan(sum);
    if (threadIdx.x == SCAN_THREADS - 1) chunk[blockIdx.x] = sum;
}

// Turns these numbers into the number of discs before each chunk. One block.
extern "C" __global__ void __launch_bounds__(SCAN_THREADS) assembly_scan(unsigned* chunk, unsigned chunks) {
    unsigned before = 0;
    __shared__ unsigned total;
    for (unsigned first = 0; first < chunks; first += SCAN_THREADS) {
        const unsigned n = first + threadIdx.x;
        const unsigned own = n < chunks ? chunk[n] : 0;
        const unsigned sum = block_scan(own);
        if (n < chunks) chunk[n] = before + sum - own;
        if (threadIdx.x == SCAN_THREADS - 1) total = sum;
        __syncthreads();
        before += total;
        __syncthreads();
    }
}

// Number of discs before each bin.
extern "C" __global__ void __launch_bounds__(SCAN_THREADS) assembly_starts(Arrays a, Parameters p, const unsigned* chunk, unsigned* start) {
    const unsigned* count = counts(a, p, a.control->searches);
    const unsigned bins = bins_in_all(p);
    unsigned before = chunk[blockIdx.x];
    __shared__ unsigned total;
    for (unsigned n = 0; n < CHUNK; n += SCAN_THREADS) {
        const unsigned bin = blockIdx.x * CHUNK + n + threadIdx.x;
        const unsigned own = bin < bins ? count[bin] % MOVED : 0;
        const unsigned sum = block_scan(own);
        if (bin < bins) start[bin] = before + sum - own;
        if (threadIdx.x == SCAN_THREADS - 1) total = sum;
        __syncthreads();
        before += total;
        __syncthreads();
    }
}

// Number of discs before each column of tiles. One block.
extern "C" __global__ void assembly_columns(Parameters p, const unsigned* start, unsigned* column) {
    for (unsigned x = threadIdx.x; x < p.tiles[0]; x += blockDim.x) {
        column[x] = start[bin_index(p, x * TILE, 0)];
    }
}

// New place of every disc: by bins, and within a bin by identity.
extern "C" __global__ void assembly_places(Arrays a, Parameters p, const unsigned* start, unsigned* place_of, unsigned* disc_at) {
    const unsigned i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= p.discs) return;
    const Position at = a.reference[i];
    const unsigned bin = bin_index(p, bin_x(p, at.x), bin_y(p, at.y));
    const unsigned count = min(counts(a, p, a.control->searches)[bin] % MOVED, p.capacity);
    unsigned place = start[bin];
    for (unsigned n = 0; n < count; ++n) {
        place += a.id[unsigned(a.binned[size_t(bin) * p.capacity + n].disc)] < a.id[i];
    }
    place_of[i] = place;
    disc_at[place] = i;
}

// Copies all discs, with their contacts, to their new places.
extern "C" __global__ void assembly_reorder(Arrays a, Arrays b, Parameters p, const unsigned* place_of, const unsigned* disc_at) {
    const unsigned n = blockIdx.x * blockDim.x + threadIdx.x;
    if (n >= p.discs) return;
    const unsigned i = disc_at[n];
    const unsigned step = a.control->steps;
    const Disc disc = discs_after(a, p, step)[i];
    discs_after(b, p, step)[n] = disc;
    b.id[n] = a.id[i];
#if SLEEP
    b.rest[n] = a.rest[i];
#endif
    if (p.ranked != 0) a.sorted[n] = disc.place.x;
    const unsigned info = unsigned(disc.motion.info);
    for (unsigned row = 0; row < (info & ROWS_MASK); ++row) {
        const size_t from = size_t(row) * p.row + i;
        const size_t to = size_t(row) * p.row + n;
        b.list[to] = place_of[a.list[from]];
        remember(p, b.history[to], ROWS, memory_at(p, a.history[from], ROWS));
    }
    if ((info & BODIES_NEAR) == 0) return;
    b.near_bodies[n] = a.near_bodies[i];
    for (unsigned k = 0; k < 4; ++k) {
        remember(p, b.body_history[size_t(k) * p.row + n], NEAR_BODIES,
                 memory_at(p, a.body_history[size_t(k) * p.row + i], NEAR_BODIES));
    }
}
