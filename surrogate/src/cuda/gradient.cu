// Gradients of weights of many linears at once. Numbers are bf16 or, with their range of sizes, sums
// of two bf16: 16 bits of mantissa are enough here, where errors do not pass through further layers.

constexpr int ROWS = 64;
// Words of 16 bytes of a row in shared memory: one more than its own against bank conflicts.
constexpr int STRIDE = 17;

struct Rows64 {
    uint4 part[PARTS][ROWS][STRIDE];
};

// Two numbers as one or two pairs of bf16.
__device__ __forceinline__ void split(float a, float b, u32 (&part)[PARTS]) {
    part[0] = pack(a, b);
#if PARTS == 2
    part[1] = pack(a - low(part[0]), b - high(part[0]));
#endif
}

// Splits eight numbers into shared memory.
__device__ __forceinline__ void put8(Rows64& to, int row, int chunk, const float (&v)[8]) {
    u32 word[4][PARTS];
#pragma unroll
    for (int r = 0; r < 4; r++) split(v[2 * r], v[2 * r + 1], word[r]);
#pragma unroll
    for (int p = 0; p < PARTS; p++)
        to.part[p][row][chunk] = make_uint4(word[0][p], word[1][p], word[2][p], word[3][p]);
}

__device__ __forceinline__ const void* at8(const Rows64& from, int part, int row, int column) {
    return &from.part[part][row][column / 8];
}

constexpr int GRADIENT_THREADS = 256;
// Chunks of eight numbers that each thread copies.
constexpr int COPIES = ROWS * 16 / GRADIENT_THREADS;
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
        const int local = (threadIdx.x + n * GRADIENT_THREADS) / 16, part = threadIdx.x % 16;
        const u32 row = tile * ROWS + local;
        const bool valid = row < rows;
        fetch8(to.dz, local, part, a.dz + (valid ? (size_t)row * WIDTH + 8 * part : 0), valid);
        if (!a.x) continue;
        const u32 from = !valid ? NONE : a.index ? a.index[row] : row;
        const bool there = from != NONE;
        fetch8(to.x, local, part, a.x + (there ? (size_t)from * WIDTH + 8 * part : 0), there);
    }
    if (a.x) return;
    for (int n = threadIdx.x; n < 4 * ROWS; n += GRADIENT_THREADS) {
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

extern "C" __global__ void __launch_bounds__(GRADIENT_THREADS, 3 - PARTS)
    weight_gradient(const Product* products) {
    const Product& a = products[blockIdx.y];
    if ((int)blockIdx.x >= a.blocks) return;
    extern __shared__ uint4 shared[];
    Stage* stages = (Stage*)shared;
    __shared__ float partial[4][WIDTH];
    if (!a.x)
        for (int s = 0; s < STAGES; s++)
            for (int k = threadIdx.x; k < PARTS * ROWS * STRIDE; k += GRADIENT_THREADS)
                ((uint4*)&stages[s].x)[k] = make_uint4(0, 0, 0, 0);
    wait_for_kernel_before();
    __syncthreads();

    const u32 rows = a.count ? *a.count : a.rows, tiles = (rows + ROWS - 1) / ROWS;
    const int lane = threadIdx.x % 32, warp = threadIdx.x / 32;
    // Each warp has 32 x 64 of the sums.
    const int row0 = 32 * (warp % 4), column0 = 64 * (warp / 4);
    const bool works = a.x || row0 < a.feature_count;
    float sum[2][8][4] = {};
    float bias_sum[2] = {};

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

        if (works)
#pragma unroll
            for (int k = 0; k < ROWS; k += 16) {
                // Matrices in the order of the operands' registers.
                const int left = k + 8 * (lane / 16) + lane % 8, right = k + lane % 16;
                u32 p[PARTS][2][4];
#pragma unroll
                for (int s = 0; s < PARTS; s++)
#pragma unroll
                    for (int m = 0; m < 2; m++)
                        load_transposed(p[s][m],
                                        at8(x, s, left, row0 + 16 * m + 8 * (lane / 8 % 2)));
#pragma unroll
                for (int j = 0; j < 8; j += 2)
#pragma unroll
                    for (int s = 0; s < PARTS; s++) {
                        u32 b[4];
                        load_transposed(b, at8(dz, s, right, column0 + 8 * j + 8 * (lane / 16)));
#pragma unroll
                        for (int m = 0; m < 2; m++)
#pragma unroll
                            for (int r = 0; r < PARTS; r++) {
                                multiply_add(sum[m][j], p[r][m], b[0], b[1]);
                                multiply_add(sum[m][j + 1], p[r][m], b[2], b[3]);
                            }
                    }
            }
        if (a.bias) {
            const u32* pairs = (const u32*)&dz;
#pragma unroll
            for (int s = 0; s < PARTS; s++)
#pragma unroll
                for (int k = 0; k < ROWS / 4; k++) {
                    int row = s * ROWS + threadIdx.x / 64 * (ROWS / 4) + k;
                    u32 both = pairs[row * STRIDE * 4 + threadIdx.x % 64];
                    bias_sum[0] += low(both);
                    bias_sum[1] += high(both);
                }
        }
    }

    const int g = lane / 4, t = lane % 4;
    float* weight = a.weight + (size_t)blockIdx.x * WIDTH * WIDTH;
#pragma unroll
    for (int m = 0; m < 2; m++)
#pragma unroll
        for (int j = 0; j < 8; j++) {
            float* to = weight + (row0 + 16 * m + g) * WIDTH + column0 + 8 * j + 2 * t;
            *(float2*)to = make_float2(sum[m][j][0], sum[m][j][1]);
            *(float2*)(to + 8 * WIDTH) = make_float2(sum[m][j][2], sum[m][j][3]);
        }
    if (!a.bias) return;
    for (int i = 0; i < 2; i++)
        partial[threadIdx.x / 64][2 * (threadIdx.x % 64) + i] = bias_sum[i];
    __syncthreads();
    if (threadIdx.x < WIDTH) {
        float total = 0.f;
        for (int k = 0; k < 4; k++) total += partial[k][threadIdx.x];
        a.bias[blockIdx.x * WIDTH + threadIdx.x] = total;
    }
}
