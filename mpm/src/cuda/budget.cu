// Adds up what the nodes, or the points, have booked, and clears their entries. One block for each
// quantity; a fixed order.
extern "C" __global__ void sum_ledger(double* ledger, int slots, double* total) {
    __shared__ double part[SUM_THREADS];
    const int t = int(threadIdx.x);
    double* const entries = ledger + size_t(blockIdx.x) * slots;
    double sum = 0.0;
    for (int slot = t; slot < slots; slot += SUM_THREADS) {
        sum += entries[slot];
        entries[slot] = 0.0;
    }
    part[t] = sum;
    for (int half = SUM_THREADS / 2; half > 0; half /= 2) {
        __syncthreads();
        if (t < half) part[t] += part[t + half];
    }
    if (t == 0) total[blockIdx.x] += part[0];
}
