// Sums of the losses of all discs.

constexpr unsigned SUM_THREADS = 256;
constexpr int LOSSES = 4;

// Adds the losses of each block's discs in this sequence of steps to the block's totals, and forgets them.
extern "C" __global__ void __launch_bounds__(SUM_THREADS) assembly_losses(Arrays a, Parameters p, double* total) {
    __shared__ double sum[LOSSES][SUM_THREADS / LANES];
    const unsigned i = blockIdx.x * SUM_THREADS + threadIdx.x;
    double losses[LOSSES] = {};
    if (i < p.discs) {
        losses[0] = a.loss[i].dashpots;
        losses[1] = a.loss[i].friction;
        losses[2] = a.rare_loss[i].damping;
        losses[3] = a.rare_loss[i].boxes;
        a.loss[i] = {};
        a.rare_loss[i] = {};
    }
    for (int n = 0; n < LOSSES; ++n) {
        const double warp = warp_sum(losses[n]);
        if (threadIdx.x % LANES == 0) sum[n][threadIdx.x / LANES] = warp;
    }
    __syncthreads();
    if (threadIdx.x >= LOSSES) return;
    double block = 0;
    for (unsigned warp = 0; warp < SUM_THREADS / LANES; ++warp) block += sum[threadIdx.x][warp];
    total[LOSSES * blockIdx.x + threadIdx.x] += block;
}
