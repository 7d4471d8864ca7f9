// Gradients of weights of many linears at once.

// Chunks of eight numbers that each thread copies.
constexpr int COPIES = ROWS * 16 / SUM_THREADS;
// Tiles in shared memory: bf16 is copied as it is, ahead of time.
constexpr int STAGES = PARTS == 1 ? 3 : 1;

struct Stage {
    Rows64 x, dz;
};

// Copies one chunk of eight stored numbers, or zeros.
__device__ __forceinline__ void fetch8(Rows64& to, int row, int chunk, const Stored* from, bool valid) {
#if PARTS == 1
    copy_async(&to.part[0][row][chunk], from, valid);
#else
    float v[8] = {};
    if (valid) load8(from, v);
    put8(to, row, chunk, v);
#endif
}

__device__ void fetch(const Product& a, Stage& to, u32 tile, u32 rows) {
#pragma unroll
    for (int n = 0; n < COPIES; n++) {
        const int local = (threadIdx.x + n * SUM_THREADS) / 16, part = threadIdx.x % 16;
        const u32 row = tile * ROWS + local;
        const bool valid = row < rows;
        fetch8(to.dz, local, part, a.dz + (valid ? (size_t)row * WIDTH + 8 * part : 0), valid);
        if (!a.x) continue;
        const u32 from = !valid ? NONE : a.index ? a.index[row] : row;
        const bool there = from != NONE;
        fetch8(to.x, local, part, a.x + (there ? (size_t)from * WIDTH + 8 * part : 0), there);
    }
    if (a.x) return;
    for (int n = threadIdx.x; n < 4 * ROWS; n += SUM_THREADS) {
        const u32 row = tile * ROWS + n / 4;
        const int first = 8 * (n % 4);
        if (first >= a.feature_count) continue;
        float v[8];
        for (int k = 0; k < 8; k++)
            v[k] = row < rows && first + k < a.feature_count
                       ? a.features[(size_t)row * a.feature_count + first + k]
                       : 0.f;
        put8(to.x, n / 4, first / 8, v);
    }
}

extern "C" __global__ void __launch_bounds__(SUM_THREADS, 3 - PARTS)
    weight_gradient(const Product* products) {
    const Product& a = products[blockIdx.y];
    if ((int)blockIdx.x >= a.blocks) return;
    extern __shared__ uint4 shared[];
    Stage* stages = (Stage*)shared;
    __shared__ float partial[SHARERS][WIDTH];
    if (!a.x)
        for (int s = 0; s < STAGES; s++)
            for (int k = threadIdx.x; k < PARTS * ROWS * STRIDE; k += SUM_THREADS)
                ((uint4*)&stages[s].x)[k] = make_uint4(0, 0, 0, 0);
    __syncthreads();

    const u32 rows = a.count ? *a.count : a.rows, tiles = (rows + ROWS - 1) / ROWS;
    Sums sums;

#if PARTS == 1
    for (int s = 0; s < STAGES - 1; s++) {
        const u32 tile = blockIdx.x + s * a.blocks;
        if (tile < tiles) fetch(a, stages[s], tile, rows);
        end_copies();
    }
#endif
    int stage = 0;
    for (u32 tile = blockIdx.x; tile < tiles; tile += a.blocks) {
        const Rows64 &x = stages[stage].x, &dz = stages[stage].dz;
#if PARTS == 1
        wait_for_copies<STAGES - 2>();
        __syncthreads();
        // Into the stage that all have done with.
        const u32 ahead = tile + (STAGES - 1) * a.blocks;
        if (ahead < tiles) fetch(a, stages[(stage + STAGES - 1) % STAGES], ahead, rows);
        end_copies();
#else
        __syncthreads();
        fetch(a, stages[0], tile, rows);
        __syncthreads();
#endif
        stage = (stage + 1) % STAGES;

        sums.add(x, dz, a.x ? WIDTH : a.feature_count, a.bias);
    }
    sums.write(a, partial);
    __syncthreads();
    write_bias(a, partial);
}
