// Gradients of the weights of many linears at once (`Product`, gradient.rs). Numbers are bf16 or, with their range of sizes, sums
// x1 + x2 of two bf16: 16 bits of mantissa are enough here, where errors do not pass through further
// layers. The product of x2 and y2, 2^-18 of that of x and y, is left out: the sums leave out as much.
// Sums of two are made while the tensor cores of Hopper multiply (`wgmma`) those of the tile before.

#if PARTS == 2 && defined(__CUDA_ARCH_FEAT_SM90_ALL)
#define GROUPS_MULTIPLY
#endif

constexpr int ROWS = 64;

struct Rows64 {
    Matrix<ROWS> part[PARTS];
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
        to.part[p].at(row, chunk) = make_uint4(word[0][p], word[1][p], word[2][p], word[3][p]);
}

// A warp has 32 rows and COLUMNS columns of the sums.
constexpr int COLUMNS = 64 / PARTS;
constexpr int GRADIENT_THREADS = 4 * 32 * (WIDTH / COLUMNS);
// Chunks of eight numbers that each thread copies.
constexpr int COPIES = ROWS * 16 / GRADIENT_THREADS;
// Tiles in shared memory: bf16 is copied there unchanged, ahead of time.
#ifdef GROUPS_MULTIPLY
constexpr int STAGES = 2;
#else
constexpr int STAGES = PARTS == 1 ? 3 : 1;
#endif

struct Stage {
    Rows64 x, dz;
};

// Row of X that is row `row` of the product, or NONE.
__device__ __forceinline__ u32 row_of_x(const Product& a, u32 row, u32 rows) {
    return row >= rows ? NONE : a.index ? a.index[row] : row;
}

#if PARTS == 1
// Begins to copy a tile.
__device__ __forceinline__ void fetch_chunk(Rows64& to, int local, int chunk, const Stored* from, u32 row) {
    const bool there = row != NONE;
    copy_async(&to.part[0].at(local, chunk), from + (there ? (size_t)row * WIDTH + 8 * chunk : 0), there);
}

__device__ __forceinline__ void fetch(const Product& a, Stage& to, u32 tile, u32 rows) {
#pragma unroll
    for (int n = 0; n < COPIES; n++) {
        const int local = (threadIdx.x + n * GRADIENT_THREADS) / 16, chunk = threadIdx.x % 16;
        const u32 row = tile * ROWS + local;
        fetch_chunk(to.dz, local, chunk, a.dz, row < rows ? row : NONE);
        if (a.x) fetch_chunk(to.x, local, chunk, a.x, row_of_x(a, row, rows));
    }
}
#else
// A thread's loads of a tile under way: values are split before they are stored. Rows that do not exist
// become zero only then, since a choice right after a load would wait for it.
struct Ahead {
    uint4 dz[COPIES][2], x[COPIES][2];
    bool dz_there[COPIES], x_there[COPIES];

    __device__ __forceinline__ static bool load(uint4 (&to)[2], const Stored* from, u32 row, int chunk) {
        const bool there = row != NONE;
        const uint4* start = (const uint4*)(from + (there ? (size_t)row * WIDTH : 0) + 8 * chunk);
#pragma unroll
        for (int k = 0; k < 2; k++) to[k] = start[k];
        return there;
    }

    __device__ __forceinline__ void fetch(const Product& a, u32 tile, u32 rows) {
#pragma unroll
        for (int n = 0; n < COPIES; n++) {
            const int chunk = threadIdx.x % 16;
            const u32 row = tile * ROWS + (threadIdx.x + n * GRADIENT_THREADS) / 16;
            dz_there[n] = load(dz[n], a.dz, row < rows ? row : NONE, chunk);
            if (a.x) x_there[n] = load(x[n], a.x, row_of_x(a, row, rows), chunk);
        }
    }

    __device__ __forceinline__ static void put(Rows64& to, int local, int chunk, const uint4 (&from)[2],
                                               bool there) {
        float v[8];
        unpack8(from, v);
#pragma unroll
        for (int k = 0; k < 8; k++) v[k] = there ? v[k] : 0.f;
        put8(to, local, chunk, v);
    }

    __device__ __forceinline__ void put(const Product& a, Stage& to) const {
#pragma unroll
        for (int n = 0; n < COPIES; n++) {
            const int local = (threadIdx.x + n * GRADIENT_THREADS) / 16, chunk = threadIdx.x % 16;
            put(to.dz, local, chunk, dz[n], dz_there[n]);
            if (a.x) put(to.x, local, chunk, x[n], x_there[n]);
        }
    }
};
#endif

// Features of a tile.
__device__ void put_features(const Product& a, Rows64& to, u32 tile, u32 rows) {
    for (int n = threadIdx.x; n < 4 * ROWS; n += GRADIENT_THREADS) {
        const u32 row = tile * ROWS + n / 4;
        const int first = 8 * (n % 4);
        if (first >= a.feature_count) continue;
        float v[8];
        for (int k = 0; k < 8; k++)
            v[k] = row < rows && first + k < a.feature_count
                       ? a.features[(size_t)row * a.feature_count + first + k]
                       : 0.f;
        put8(to, n / 4, first / 8, v);
    }
}

// X^T dZ of one tile after the other, of a thread.
#ifdef GROUPS_MULTIPLY
#define FOUR(j) "+f"(z[j][0]), "+f"(z[j][1]), "+f"(z[j][2]), "+f"(z[j][3])
// z += x^T y with 16 rows each of x and y, 64 columns.
__device__ __forceinline__ void add_rows_product(float (&z)[8][4], unsigned long long x,
                                                 unsigned long long y) {
    asm volatile("{ .reg .pred yes; setp.eq.u32 yes, 0, 0; "
                 "wgmma.mma_async.sync.aligned.m64n64k16.f32.bf16.bf16 {"
                 "%0, %1, %2, %3, %4, %5, %6, %7, %8, %9, %10, %11, %12, %13, %14, %15, "
                 "%16, %17, %18, %19, %20, %21, %22, %23, %24, %25, %26, %27, %28, %29, %30, %31}, "
                 "%32, %33, yes, 1, 1, 1, 1; }"
                 : FOUR(0), FOUR(1), FOUR(2), FOUR(3), FOUR(4), FOUR(5), FOUR(6), FOUR(7)
                 : "l"(x), "l"(y));
}
#undef FOUR

// A warp group's 64 x 64 of the sums.
struct Sums {
    float sum[8][4] = {};
    int half_x = threadIdx.x / 256, half_dz = threadIdx.x / 128 % 2;

    // Begins to multiply; the stage must not change until `wait_for_products`.
    __device__ __forceinline__ void add(const Stage& stage) {
        begin_products();
#pragma unroll
        for (int s = 0; s < PARTS; s++)
#pragma unroll
            for (int r = 0; r < PARTS - s; r++)
#pragma unroll
                for (int k = 0; k < ROWS; k += 16) {
                    const Matrix<ROWS>&x = stage.x.part[r], &dz = stage.dz.part[s];
                    add_rows_product(sum, describe(x.chunks[half_x][k], sizeof x.chunks[0]),
                                     describe(dz.chunks[half_dz][k], sizeof dz.chunks[0]));
                }
        commit_products();
    }

    __device__ void write(float* weight) const {
        const int lane = threadIdx.x % 32, row = 64 * half_x + threadIdx.x % 128 / 32 * 16 + lane / 4;
        float* to = weight + row * WIDTH + 64 * half_dz + 2 * (lane % 4);
#pragma unroll
        for (int j = 0; j < 8; j++) {
            *(float2*)(to + 8 * j) = make_float2(sum[j][0], sum[j][1]);
            *(float2*)(to + 8 * j + 8 * WIDTH) = make_float2(sum[j][2], sum[j][3]);
        }
    }
};
#else
// A warp's 32 x COLUMNS of the sums.
struct Sums {
    float sum[2][COLUMNS / 8][4] = {};
    int row0 = 32 * (threadIdx.x / 32 % 4), column0 = COLUMNS * (threadIdx.x / 128);

    __device__ __forceinline__ void add(const Stage& stage) {
        const int lane = threadIdx.x % 32;
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
                                    &stage.x.part[s].at(left, row0 / 8 + 2 * m + lane / 8 % 2));
#pragma unroll
            for (int j = 0; j < COLUMNS / 8; j += 2)
#pragma unroll
                for (int s = 0; s < PARTS; s++) {
                    u32 b[4];
                    load_transposed(b, &stage.dz.part[s].at(right, column0 / 8 + j + lane / 16));
#pragma unroll
                    for (int m = 0; m < 2; m++)
#pragma unroll
                        for (int r = 0; r < PARTS - s; r++) {
                            multiply_add(sum[m][j], p[r][m], b[0], b[1]);
                            multiply_add(sum[m][j + 1], p[r][m], b[2], b[3]);
                        }
                }
        }
    }

    __device__ void write(float* weight) const {
        const int lane = threadIdx.x % 32;
        float* start = weight + (row0 + lane / 4) * WIDTH + column0 + 2 * (lane % 4);
#pragma unroll
        for (int m = 0; m < 2; m++)
#pragma unroll
            for (int j = 0; j < COLUMNS / 8; j++) {
                float* to = start + 16 * m * WIDTH + 8 * j;
                *(float2*)to = make_float2(sum[m][j][0], sum[m][j][1]);
                *(float2*)(to + 8 * WIDTH) = make_float2(sum[m][j][2], sum[m][j][3]);
            }
    }
};
#endif

// Threads that share a pair of columns in sums over rows.
constexpr int SHARERS = GRADIENT_THREADS / (WIDTH / 2);

__device__ __forceinline__ void add_bias(float (&bias)[2], const Rows64& dz) {
    const int pair = threadIdx.x % (WIDTH / 2), first = threadIdx.x / (WIDTH / 2) * (ROWS / SHARERS);
#pragma unroll
    for (int s = 0; s < PARTS; s++)
#pragma unroll
        for (int k = 0; k < ROWS / SHARERS; k++) {
            const u32 both = ((const u32*)&dz.part[s].at(first + k, pair / 4))[pair % 4];
            bias[0] += low(both);
            bias[1] += high(both);
        }
}

extern "C" __global__ void __launch_bounds__(GRADIENT_THREADS, 3 - PARTS)
    weight_gradient(const Product* products) {
    wait_for_kernel_before();
    const Product a = products[blockIdx.y];
    if ((int)blockIdx.x >= a.blocks) return;
    extern __shared__ __align__(1024) uint4 shared[];
    Stage* stages = (Stage*)shared;
    if (!a.x)
        for (int s = 0; s < STAGES; s++)
            for (int k = threadIdx.x; k < sizeof(Rows64) / 16; k += GRADIENT_THREADS)
                ((uint4*)&stages[s].x)[k] = make_uint4(0, 0, 0, 0);
    __syncthreads();

    const u32 rows = *a.count, tiles = (rows + ROWS - 1) / ROWS;
    Sums sums;
    float bias[2] = {};
    int stage = 0;
#if PARTS == 1
    for (int s = 0; s < STAGES - 1; s++) {
        const u32 tile = blockIdx.x + s * a.blocks;
        if (tile < tiles) fetch(a, stages[s], tile, rows);
        end_copies();
    }
    for (u32 tile = blockIdx.x; tile < tiles; tile += a.blocks) {
        if (!a.x) put_features(a, stages[stage].x, tile, rows);
        wait_for_copies<STAGES - 2>();
        __syncthreads();
        // Into the stage that all threads are done with.
        const u32 next = tile + (STAGES - 1) * a.blocks;
        if (next < tiles) fetch(a, stages[(stage + STAGES - 1) % STAGES], next, rows);
        end_copies();
        sums.add(stages[stage]);
        if (a.bias) add_bias(bias, stages[stage].dz);
        stage = (stage + 1) % STAGES;
    }
#else
    Ahead ahead;
    // Stores the tile that was loaded, and begins to load the next one.
    auto put = [&](Stage& to, u32 tile) {
        if (tile >= tiles) return;
        ahead.put(a, to);
        if (!a.x) put_features(a, to.x, tile, rows);
        show_to_products();
        if (tile + a.blocks < tiles) ahead.fetch(a, tile + a.blocks, rows);
    };
    if (blockIdx.x < tiles) ahead.fetch(a, blockIdx.x, rows);
    put(stages[0], blockIdx.x);
    for (u32 tile = blockIdx.x; tile < tiles; tile += a.blocks) {
        __syncthreads();
        sums.add(stages[stage]);
        if (a.bias) add_bias(bias, stages[stage].dz);
        stage = (stage + 1) % STAGES;
        if (STAGES == 1) __syncthreads();
        put(stages[stage], tile + a.blocks);
        wait_for_products();
    }
#endif
    __syncthreads();

    sums.write(a.weight + (size_t)blockIdx.x * WIDTH * WIDTH);
    if (!a.bias) return;
    float(*partial)[WIDTH] = (float(*)[WIDTH])shared;
    for (int i = 0; i < 2; i++)
        partial[threadIdx.x / (WIDTH / 2)][2 * (threadIdx.x % (WIDTH / 2)) + i] = bias[i];
    __syncthreads();
    if (threadIdx.x < WIDTH) {
        float total = 0.f;
        for (int k = 0; k < SHARERS; k++) total += partial[k][threadIdx.x];
        a.bias[blockIdx.x * WIDTH + threadIdx.x] = total;
    }
}
