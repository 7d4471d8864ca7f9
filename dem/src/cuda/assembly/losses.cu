// Energy that is lost, counted in units that are far smaller than what a disc loses in a step.

// The number of units nearest to an energy (J).
__device__ inline long long units_of(const Parameters& p, Real energy) {
#if REAL_BITS == 32
    return __float2ll_rn(energy * p.per_joule);
#else
    return __double2ll_rn(energy * p.per_joule);
#endif
}

// Sum over the lanes of a warp of numbers below 2^52: their upper and lower 26 bits, of which the sums fit in a word.
__device__ inline unsigned long long warp_total(long long x) {
#if __CUDA_ARCH__ >= 800
    constexpr unsigned BITS = 26;
    const int high = __reduce_add_sync(ALL, int(x >> BITS));
    const unsigned low = __reduce_add_sync(ALL, unsigned(x) & ((1u << BITS) - 1));
    return ((unsigned long long)(long long)high << BITS) + low;
#else
    for (int d = LANES / 2; d > 0; d /= 2) x += __shfl_xor_sync(ALL, x, d);
    return x;
#endif
}

// Adds the sum of an energy (J) over a warp, all of whose lanes take part. Parts of a rank may share a warp of discs.
__device__ inline void add_energy(const Parameters& p, Real energy, unsigned long long& sum) {
    if (!__any_sync(ALL, energy != Real(0))) return;
    const unsigned long long total = warp_total(units_of(p, energy));
    if (threadIdx.x % LANES == 0) atomicAdd(&sum, total);
}

// Adds the losses of all warps to the totals, and forgets them.
extern "C" __global__ void assembly_losses(Arrays a, Parameters p, Loss* total) {
    const unsigned warp = blockIdx.x * blockDim.x + threadIdx.x;
    if (warp * LANES >= p.discs) return;
    const Loss loss = a.loss[warp];
    a.loss[warp] = {};
    if (loss.dashpots != 0) atomicAdd(&total->dashpots, loss.dashpots);
    if (loss.friction != 0) atomicAdd(&total->friction, loss.friction);
    if (loss.damping != 0) atomicAdd(&total->damping, loss.damping);
    if (loss.boxes != 0) atomicAdd(&total->boxes, loss.boxes);
}
