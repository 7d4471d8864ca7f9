// MLPs of edges, backward, in bf16 on Hopper: gradients of the weights and of what was read. A block takes its
// share of the rows, 64 at a time, through one linear after the other, from the last to the first:
//
//     dW += X^T dZ,   dX = dZ W^T,   dZ of the linear before = dX where X > 0, else slope dX
//
// with X, the output of the layer before, read once for both. Two warp groups add up dW, of which
// each keeps 64 rows in registers. Two compute 64 columns of dX each and, of the next tile, the last
// dZ, that of LayerNorm's derivative, which stays in shared memory.

#if PARTS == 1 && defined(__CUDA_ARCH_FEAT_SM90_ALL)

constexpr int GROUP_THREADS = 128;
constexpr int SUM_THREADS = 2 * GROUP_THREADS;
constexpr int EDGE_THREADS = 2 * SUM_THREADS;
constexpr int STAGES = 3;
constexpr int ROWS = 64;
// Threads that share a pair of columns in sums over rows.
constexpr int SHARERS = SUM_THREADS / (WIDTH / 2);
// Rows of a tile of which a thread copies eight columns.
constexpr int SHARE = ROWS * 16 / SUM_THREADS;

// 128 columns as the tensor cores read them: of half the columns first, rows of 128 bytes, in which
// chunks of eight numbers are exchanged lest those of a column share memory banks.
template <int N>
struct Matrix {
    uint4 chunks[2][N][8];

    __device__ uint4& at(int row, int chunk) { return chunks[chunk / 8][row][(chunk ^ row) & 7]; }
    __device__ const uint4& at(int row, int chunk) const {
        return chunks[chunk / 8][row][(chunk ^ row) & 7];
    }
};

struct Stage {
    Matrix<ROWS> dz, x;
    // Gradients of the MLP's output; of the first linear the features before they are rounded.
    uint4 output[ROWS][16];
};

struct Shared {
    // W, whose rows are in the order in which the tensor cores shall get them.
    Matrix<WIDTH> weights;
    Stage stages[STAGES];
    float scale[WIDTH];
    float partial[SHARERS][WIDTH];
};

// What the tensor cores need to know of a part of a `Matrix`: bytes from 64 columns to the next, if
// columns are contiguous for the product, and from eight rows to the next.
__device__ unsigned long long describe(const void* part, int columns) {
    const unsigned long long address = (u32)__cvta_generic_to_shared(part), swizzle_128_bytes = 1;
    return address >> 4 | (unsigned long long)(columns >> 4) << 16 | 1024ull >> 4 << 32 |
           swizzle_128_bytes << 62;
}

#define FOUR(j) "+f"(z[j][0]), "+f"(z[j][1]), "+f"(z[j][2]), "+f"(z[j][3])

// z += x^T y with 16 rows each of x, 64 columns, and y, 128 columns.
__device__ __forceinline__ void add_rows_product(float (&z)[16][4], unsigned long long x,
                                                 unsigned long long y) {
    asm volatile("{ .reg .pred yes; setp.eq.u32 yes, 0, 0; "
                 "wgmma.mma_async.sync.aligned.m64n128k16.f32.bf16.bf16 {"
                 "%0, %1, %2, %3, %4, %5, %6, %7, %8, %9, %10, %11, %12, %13, %14, %15, "
                 "%16, %17, %18, %19, %20, %21, %22, %23, %24, %25, %26, %27, %28, %29, %30, %31, "
                 "%32, %33, %34, %35, %36, %37, %38, %39, %40, %41, %42, %43, %44, %45, %46, %47, "
                 "%48, %49, %50, %51, %52, %53, %54, %55, %56, %57, %58, %59, %60, %61, %62, %63}, "
                 "%64, %65, yes, 1, 1, 1, 1; }"
                 : FOUR(0), FOUR(1), FOUR(2), FOUR(3), FOUR(4), FOUR(5), FOUR(6), FOUR(7), FOUR(8),
                   FOUR(9), FOUR(10), FOUR(11), FOUR(12), FOUR(13), FOUR(14), FOUR(15)
                 : "l"(x), "l"(y));
}

// z += x y^T with 16 columns each of x and y, 64 rows.
__device__ __forceinline__ void add_columns_product(float (&z)[8][4], unsigned long long x,
                                                    unsigned long long y) {
    asm volatile("{ .reg .pred yes; setp.eq.u32 yes, 0, 0; "
                 "wgmma.mma_async.sync.aligned.m64n64k16.f32.bf16.bf16 {"
                 "%0, %1, %2, %3, %4, %5, %6, %7, %8, %9, %10, %11, %12, %13, %14, %15, "
                 "%16, %17, %18, %19, %20, %21, %22, %23, %24, %25, %26, %27, %28, %29, %30, %31}, "
                 "%32, %33, yes, 1, 1, 0, 0; }"
                 : FOUR(0), FOUR(1), FOUR(2), FOUR(3), FOUR(4), FOUR(5), FOUR(6), FOUR(7)
                 : "l"(x), "l"(y));
}
#undef FOUR

// The rows of a tile of which this thread copies eight columns.
struct Mine {
    int chunk = threadIdx.x % 16;

    __device__ int local(int n) const {
        return threadIdx.x % SUM_THREADS / 16 + SUM_THREADS / 16 * n;
    }
};

// Where a row of W is in shared memory, so that neighbours there are columns of dX that a lane has
// next to each other (tile_column of weights.cu).
__device__ int place_of(int row) {
    return (row & 96) | (row >> 1 & 3) << 3 | (row >> 3 & 3) << 1 | (row & 1);
}

__device__ void fetch_weights(Shared& shared, const uint4* weights) {
    for (int n = threadIdx.x; n < UNIT; n += EDGE_THREADS)
        copy_async(&shared.weights.at(place_of(n / 16), n % 16), &weights[n], true);
    end_copies();
}

// Row of `output` that is the gradient of an edge's, or NONE.
__device__ u32 output_row(const Backward& a, u32 row, u32 rows) {
    if (row >= rows) return NONE;
    if (a.selection && (a.selection[row] == NONE) != (a.select_none != 0)) return NONE;
    return a.output_index ? a.output_index[row] : row;
}

// Begins to copy X of a tile.
__device__ void fetch_x(Stage& to, const Product& p, u32 tile, u32 rows) {
    const Mine mine;
    if (p.x) {
#pragma unroll
        for (int n = 0; n < SHARE; n++) {
            const u32 row = tile * ROWS + mine.local(n);
            const u32 from = row >= rows ? NONE : p.index ? p.index[row] : row;
            const bool there = from != NONE;
            copy_async(&to.x.at(mine.local(n), mine.chunk),
                       p.x + (there ? (size_t)from * WIDTH + 8 * mine.chunk : 0), there);
        }
        return;
    }
    const size_t first = (size_t)tile * ROWS * p.feature_count;
    const size_t end = (size_t)rows * p.feature_count;
    for (int n = threadIdx.x; n < ROWS * p.feature_count; n += SUM_THREADS) {
        const bool valid = first + n < end;
        copy_async((float*)to.output + n, p.features + (valid ? first + n : 0), valid);
    }
}

// Begins to copy `dz`, the gradient of the linear's output or, of the last linear, what LayerNorm
// made of it; then the output's gradient too.
template <bool LAST>
__device__ void fetch_dz(Stage& to, const Backward& a, const Stored* dz, u32 tile, u32 rows,
                         const u32 (&output)[SHARE]) {
    const Mine mine;
#pragma unroll
    for (int n = 0; n < SHARE; n++) {
        const int local = mine.local(n), column = 8 * mine.chunk;
        const u32 row = tile * ROWS + local;
        const bool valid = row < rows, there = output[n] != NONE;
        copy_async(&to.dz.at(local, mine.chunk), dz + (valid ? (size_t)row * WIDTH + column : 0),
                   valid);
        if (LAST && a.output)
            copy_async(&to.output[local][mine.chunk],
                       a.output + (there ? (size_t)output[n] * WIDTH + column : 0), there);
    }
}

// Rounds the features that this thread has copied.
__device__ void round_features(Stage& stage, int count) {
    for (int n = threadIdx.x; n < ROWS * count; n += SUM_THREADS)
        ((Stored*)&stage.x.at(n / count, n % count / 8))[n % count % 8] =
            pack(((const float*)stage.output)[n], 0.f);
}

// What the derivative of LayerNorm needs besides the tile, of this thread's rows.
struct Ahead {
    // Row that is added to the output's gradient, or NONE; reciprocal standard deviation.
    u32 node[SHARE];
    float inverse[SHARE];

    __device__ void read(const Backward& a, u32 tile, u32 rows) {
#pragma unroll
        for (int n = 0; n < SHARE; n++) {
            const u32 row = tile * ROWS + Mine().local(n);
            node[n] = row < rows && a.gathered ? a.gathered_index[row] : NONE;
            inverse[n] = row < rows ? a.deviation[row] : 0.f;
        }
    }

    // What is added.
    __device__ void gather(const Backward& a, float (&rows)[SHARE][8]) const {
#pragma unroll
        for (int n = 0; n < SHARE; n++) {
            const bool there = node[n] != NONE;
            load8(a.gathered + (there ? (size_t)node[n] * WIDTH : 0) + 8 * Mine().chunk, rows[n]);
#pragma unroll
            for (int k = 0; k < 8; k++) rows[n][k] = there ? rows[n][k] : 0.f;
        }
    }
};

// dy -> dz = (dx - mean(dx) - x mean(dx x)) / deviation with dx = scale dy, for y = scale x + shift
// and x = (z - mean(z)) / deviation, of the parts of rows that this thread has copied; x is where dz
// shall be. Adds dy x and dy to `sums`.
__device__ void normalise_backward(Stage& stage, const Backward& a, const float* scale,
                                   const float (&gathered)[SHARE][8], const Ahead& ahead,
                                   float (&sums)[2][8]) {
    const Mine mine;
    const float share = 1.f / a.width;
    float s[8];
    load8(scale + 8 * mine.chunk, s);
#pragma unroll
    for (int n = 0; n < SHARE; n++) {
        Stored* place = (Stored*)&stage.dz.at(mine.local(n), mine.chunk);
        float x[8], dy[8], mean = 0.f, product = 0.f;
        load8(place, x);
#pragma unroll
        for (int k = 0; k < 8; k++) dy[k] = gathered[n][k];
        if (a.output) {
            float more[8];
            load8((const Stored*)&stage.output[mine.local(n)][mine.chunk], more);
#pragma unroll
            for (int k = 0; k < 8; k++) dy[k] += more[k];
        }
#pragma unroll
        for (int k = 0; k < 8; k++) {
            sums[0][k] += dy[k] * x[k];
            sums[1][k] += dy[k];
            dy[k] *= s[k];
            mean += dy[k];
            product += dy[k] * x[k];
        }
        // A row is sixteen lanes'.
#pragma unroll
        for (int bit = 1; bit < 16; bit *= 2) {
            mean += __shfl_xor_sync(ALL, mean, bit);
            product += __shfl_xor_sync(ALL, product, bit);
        }
        mean *= share, product *= share;
#pragma unroll
        for (int k = 0; k < 8; k++) dy[k] = ahead.inverse[n] * (dy[k] - mean - x[k] * product);
        store8(place, dy);
    }
}

// dX of a tile, by the warp groups that do not add up dW: each has half the columns.
__device__ void input_gradient(const Shared& shared, const Stage& stage, Stored* to, u32 tile,
                               u32 rows, bool hidden, float slope, bool accumulate) {
    const int side = threadIdx.x / GROUP_THREADS % 2;
    const int lane = threadIdx.x % 32, g = lane / 4, t = lane % 4;
    float z[8][4] = {};
    begin_products();
#pragma unroll
    for (int k = 0; k < 8; k++)
        add_columns_product(z, describe((const char*)stage.dz.chunks[k / 4] + k % 4 * 32, 0),
                            describe((const char*)shared.weights.chunks[k / 4][64 * side] + k % 4 * 32, 0));
    end_products();
#pragma unroll
    for (int q = 0; q < 2; q++)
#pragma unroll
        for (int half = 0; half < 2; half++) {
            const int local = threadIdx.x % GROUP_THREADS / 32 * 16 + 8 * half + g;
            const int chunk = 4 * (2 * side + q) + t;
            const u32 row = tile * ROWS + local;
            if (row >= rows) continue;
            float v[8], other[8];
#pragma unroll
            for (int k = 0; k < 8; k++) v[k] = z[4 * q + k / 2][2 * half + k % 2];
            Stored* place = to + (size_t)row * WIDTH + 8 * chunk;
            if (hidden) {
                load8((const Stored*)&stage.x.at(local, chunk), other);
#pragma unroll
                for (int k = 0; k < 8; k++)
                    if (!(other[k] > 0.f)) v[k] *= slope;
            } else if (accumulate) {
                load8(place, other);
#pragma unroll
                for (int k = 0; k < 8; k++) v[k] += other[k];
            }
            store8(place, v);
        }
}

// dW and the column sums of dZ, of a block's rows.
struct Sums {
    // 64 rows of dW for each warp group.
    float weight[16][4] = {};
    float bias[2] = {};
    int side = threadIdx.x / GROUP_THREADS;

    __device__ void add(const Stage& stage, bool with_bias) {
        if (with_bias) {
            const int pair = threadIdx.x % (WIDTH / 2), share = ROWS / SHARERS;
#pragma unroll
            for (int k = 0; k < share; k++) {
                const uint4& chunk = stage.dz.at(threadIdx.x / (WIDTH / 2) * share + k, pair / 4);
                const u32 both = ((const u32*)&chunk)[pair % 4];
                bias[0] += low(both);
                bias[1] += high(both);
            }
        }
        begin_products();
#pragma unroll
        for (int k = 0; k < ROWS; k += 16)
            add_rows_product(weight, describe(stage.x.chunks[side][k], sizeof stage.x.chunks[0]),
                             describe(stage.dz.chunks[0][k], sizeof stage.dz.chunks[0]));
        end_products();
    }

    // The block's share of the gradient; of the bias, what is left to be added up.
    __device__ void write(const Product& a, float (*partial)[WIDTH]) const {
        const int g = threadIdx.x % 32 / 4, t = threadIdx.x % 4;
        float* to = a.weight + (size_t)blockIdx.x * WIDTH * WIDTH +
                    (threadIdx.x / 32 * 16 + g) * WIDTH + 2 * t;
#pragma unroll
        for (int j = 0; j < 16; j++) {
            *(float2*)(to + 8 * j) = make_float2(weight[j][0], weight[j][1]);
            *(float2*)(to + 8 * j + 8 * WIDTH) = make_float2(weight[j][2], weight[j][3]);
        }
        for (int i = 0; i < 2; i++)
            partial[threadIdx.x / (WIDTH / 2)][2 * (threadIdx.x % (WIDTH / 2)) + i] = bias[i];
    }
};

// The block's share of the gradient of the bias, once all partial sums are there.
__device__ void write_bias(const Product& a, const float (*partial)[WIDTH]) {
    if (!a.bias || threadIdx.x >= WIDTH) return;
    float total = 0.f;
    for (int k = 0; k < SHARERS; k++) total += partial[k][threadIdx.x];
    a.bias[blockIdx.x * WIDTH + threadIdx.x] = total;
}

// The block's sums for LayerNorm's scale and shift, of the threads that have any.
__device__ void write_norm_sums(Shared& shared, float* to, const float (&sums)[2][8], bool any) {
    float(*all)[2 * WIDTH] = (float(*)[2 * WIDTH])shared.stages;
    barrier();
    if (any)
#pragma unroll
        for (int i = 0; i < 2; i++)
#pragma unroll
            for (int k = 0; k < 8; k++) {
                const float sum = sums[i][k] + __shfl_xor_sync(ALL, sums[i][k], 16);
                if (threadIdx.x % 32 < 16)
                    all[threadIdx.x % SUM_THREADS / 32][i * WIDTH + 8 * Mine().chunk + k] = sum;
            }
    barrier();
    if (threadIdx.x < 2 * WIDTH) {
        float sum = 0.f;
        for (int warp = 0; warp < SUM_THREADS / 32; warp++) sum += all[warp][threadIdx.x];
        to[blockIdx.x * 2 * WIDTH + threadIdx.x] = sum;
    }
}

// One linear: product n. ADDS: this warp is one of those that add up dW. LAST: the one before
// LayerNorm.
template <bool ADDS, bool LAST>
__device__ void linear_backward(Shared& shared, const Backward& a, int n) {
    const Product p = a.products[n];
    const bool hidden = n < a.layers;
    Stored* to = hidden ? (Stored*)a.products[n + 1].dz : p.x ? a.input : nullptr;
    const Stored* dz = LAST ? a.normal : p.dz;
    const u32 rows = *a.count, tiles = (rows + ROWS - 1) / ROWS, step = a.blocks;

    // All have done with the linear before, and what they have written can be read.
    barrier();
    if (to) fetch_weights(shared, a.weights + n * UNIT);
    if (!p.x) {
        for (int s = 0; s < STAGES; s++)
            for (int k = threadIdx.x; k < ROWS * 16; k += EDGE_THREADS)
                (&shared.stages[s].x.chunks[0][0][0])[k] = make_uint4(0, 0, 0, 0);
        barrier();
    }
    // Rows of the output's gradient for the tile to be fetched next.
    u32 output[SHARE] = {};
    auto read_output = [&](u32 tile) {
        if (!ADDS && LAST && a.output)
#pragma unroll
            for (int k = 0; k < SHARE; k++)
                output[k] = output_row(a, tile * ROWS + Mine().local(k), rows);
    };
    auto fetch = [&](int stage, u32 tile) {
        if (tile < tiles) {
            if (ADDS) fetch_x(shared.stages[stage], p, tile, rows);
            else fetch_dz<LAST>(shared.stages[stage], a, dz, tile, rows, output);
        }
        end_copies();
        read_output(tile + step);
    };
    read_output(blockIdx.x);
    for (int s = 0; s < STAGES - 1; s++) fetch(s, blockIdx.x + s * step);
    Ahead ahead;
    if (!ADDS && LAST) ahead.read(a, blockIdx.x, rows);
    float norm_sums[2][8] = {};
    Sums sums;

    int current = 0;
    for (u32 tile = blockIdx.x; tile < tiles; tile += step) {
        Stage& stage = shared.stages[current];
        if (!ADDS && LAST) {
            float gathered[SHARE][8] = {};
            if (a.gathered) ahead.gather(a, gathered);
            wait_for_copies<STAGES - 2>();
            normalise_backward(stage, a, shared.scale, gathered, ahead, norm_sums);
        } else {
            wait_for_copies<STAGES - 2>();
            if (ADDS && !p.x) round_features(stage, p.feature_count);
        }
        show_to_products();
        barrier();
        // Into the stage that all have done with.
        fetch((current + STAGES - 1) % STAGES, tile + (STAGES - 1) * step);
        if (!ADDS && LAST) ahead.read(a, tile + step, rows);
        if (ADDS) sums.add(stage, p.bias);
        else if (to)
            input_gradient(shared, stage, to, tile, rows, hidden, a.slope, a.accumulate & 1);
        current = (current + 1) % STAGES;
    }
    if (ADDS) sums.write(p, shared.partial);
    if (LAST) write_norm_sums(shared, a.norm_sums, norm_sums, !ADDS);
    barrier();
    write_bias(p, shared.partial);
}

template <bool ADDS>
__device__ void backward(Shared& shared, const Backward& a) {
    linear_backward<ADDS, true>(shared, a, 0);
    for (int n = 1; n < a.product_count; n++) linear_backward<ADDS, false>(shared, a, n);
}

extern "C" __global__ void __launch_bounds__(EDGE_THREADS, 1)
    edges_backward(const __grid_constant__ BackwardBatch batch) {
    extern __shared__ __align__(1024) uint4 memory[];
    Shared& shared = *(Shared*)memory;
    const Backward& a = batch.item[blockIdx.y];
    if (threadIdx.x < WIDTH)
        shared.scale[threadIdx.x] =
            threadIdx.x < a.width ? a.parameters[a.norm + threadIdx.x] : 0.f;
    wait_for_kernel_before();
    if (threadIdx.x < SUM_THREADS) backward<true>(shared, a);
    else backward<false>(shared, a);
}

#endif
