// MLPs of edges, backward, in bf16: gradients of the weights and of what was read. A block takes its
// share of the rows, 64 at a time, through one linear after the other, from the last to the first:
//
//     dW += X^T dZ,   dX = dZ W^T,   dZ of the linear before = dX where X > 0, else slope dX
//
// with X, the output of the layer before, read once for both. Eight warps add up dW, of which they
// keep the sums in registers, eight compute dX. The last dZ is that of LayerNorm's derivative and
// stays in shared memory.

#if PARTS == 1

constexpr int EDGE_THREADS = 2 * SUM_THREADS;
constexpr int STAGES = 3;
// Rows of which a thread has eight columns.
constexpr int SHARE = ROWS * 16 / EDGE_THREADS;

struct Stage {
    Rows64 dz, x;
    // Gradients of the MLP's output; of the first linear the features before they are rounded.
    uint4 output[ROWS][16];
};

struct Shared {
    // W, whose rows are in the order in which the tensor cores shall get them.
    uint4 weights[WIDTH][STRIDE];
    float scale[WIDTH];
    float partial[SHARERS][WIDTH];
    Stage stages[STAGES];
};

// The rows of a tile of which this thread has eight columns.
struct Mine {
    int chunk = threadIdx.x % 16;

    __device__ int local(int n) const { return threadIdx.x / 16 + EDGE_THREADS / 16 * n; }
};

// Where a row of W is in shared memory, so that neighbours there are columns of dX that a lane has
// next to each other (tile_column of weights.cu).
__device__ int place_of(int row) {
    return (row & 96) | (row >> 1 & 3) << 3 | (row >> 3 & 3) << 1 | (row & 1);
}

__device__ void fetch_weights(Shared& shared, const uint4* weights) {
    for (int n = threadIdx.x; n < UNIT; n += EDGE_THREADS)
        copy_async(&shared.weights[place_of(n / 16)][n % 16], &weights[n], true);
    end_copies();
}

// Row of `output` that is the gradient of an edge's, or NONE.
__device__ u32 output_row(const Backward& a, u32 row, u32 rows) {
    if (row >= rows) return NONE;
    if (a.selection && (a.selection[row] == NONE) != (a.select_none != 0)) return NONE;
    return a.output_index ? a.output_index[row] : row;
}

// Begins to copy a tile. `dz` is the gradient of the linear's output or, of the last linear, what
// LayerNorm made of it.
template <bool LAST>
__device__ void fetch(Stage& to, const Backward& a, const Product& p, const Stored* dz, u32 tile,
                      u32 rows, const u32 (&output)[SHARE]) {
    const Mine mine;
#pragma unroll
    for (int n = 0; n < SHARE; n++) {
        const int local = mine.local(n), column = 8 * mine.chunk;
        const u32 row = tile * ROWS + local;
        const bool valid = row < rows;
        copy_async(&to.dz.part[0][local][mine.chunk], dz + (valid ? (size_t)row * WIDTH + column : 0),
                   valid);
        if (p.x) {
            const u32 from = !valid ? NONE : p.index ? p.index[row] : row;
            const bool there = from != NONE;
            copy_async(&to.x.part[0][local][mine.chunk],
                       p.x + (there ? (size_t)from * WIDTH + column : 0), there);
        }
        if (LAST && a.output) {
            const bool there = output[n] != NONE;
            copy_async(&to.output[local][mine.chunk],
                       a.output + (there ? (size_t)output[n] * WIDTH + column : 0), there);
        }
    }
    if (p.x) return;
    const size_t first = (size_t)tile * ROWS * p.feature_count;
    const size_t end = (size_t)rows * p.feature_count;
    for (int n = threadIdx.x; n < ROWS * p.feature_count; n += EDGE_THREADS) {
        const bool valid = first + n < end;
        copy_async((float*)to.output + n, p.features + (valid ? first + n : 0), valid);
    }
}

// Rounds the features that this thread has copied.
__device__ void round_features(Stage& stage, int count) {
    for (int n = threadIdx.x; n < ROWS * count; n += EDGE_THREADS)
        ((unsigned short*)stage.x.part[0][n / count])[n % count] =
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
    float s[8];
    load8(scale + 8 * mine.chunk, s);
#pragma unroll
    for (int n = 0; n < SHARE; n++) {
        Stored* place = (Stored*)&stage.dz.part[0][mine.local(n)][mine.chunk];
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
        mean /= a.width, product /= a.width;
#pragma unroll
        for (int k = 0; k < 8; k++) dy[k] = ahead.inverse[n] * (dy[k] - mean - x[k] * product);
        store8(place, dy);
    }
}

// dX of a tile, by the warps that do not add up dW: each has 32 rows and 32 columns.
__device__ void input_gradient(const Shared& shared, const Stage& stage, Stored* to, u32 tile,
                               u32 rows, bool hidden, float slope, bool accumulate) {
    const int lane = threadIdx.x % 32, warp = (threadIdx.x - SUM_THREADS) / 32;
    const int row0 = 32 * (warp % 2), chunk = warp / 2, g = lane / 4, t = lane % 4;
    float z[2][4][4] = {};
#pragma unroll
    for (int k = 0; k < 8; k++) {
        u32 x[2][4], w[2][4];
#pragma unroll
        for (int m = 0; m < 2; m++) {
            load_matrices(x[m], &stage.dz.part[0][row0 + 16 * m + lane % 16][2 * k + lane / 16]);
            load_matrices(w[m], &shared.weights[32 * chunk + 16 * m + 8 * (lane / 16) + lane % 8]
                                               [2 * k + lane / 8 % 2]);
        }
#pragma unroll
        for (int m = 0; m < 2; m++)
#pragma unroll
            for (int j = 0; j < 4; j++)
                multiply_add(z[m][j], x[m], w[j / 2][2 * (j % 2)], w[j / 2][2 * (j % 2) + 1]);
    }
#pragma unroll
    for (int m = 0; m < 2; m++)
#pragma unroll
        for (int half = 0; half < 2; half++) {
            const int local = row0 + 16 * m + 8 * half + g;
            const u32 row = tile * ROWS + local;
            if (row >= rows) continue;
            float v[8], other[8];
#pragma unroll
            for (int k = 0; k < 8; k++) v[k] = z[m][k / 2][2 * half + k % 2];
            Stored* place = to + (size_t)row * WIDTH + 32 * chunk + 8 * t;
            if (hidden) {
                load8((const Stored*)&stage.x.part[0][local][4 * chunk + t], other);
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

// The block's sums for LayerNorm's scale and shift.
__device__ void write_norm_sums(Shared& shared, float* to, float (&sums)[2][8]) {
    float(*all)[2 * WIDTH] = (float(*)[2 * WIDTH])shared.stages;
    barrier();
#pragma unroll
    for (int i = 0; i < 2; i++)
#pragma unroll
        for (int k = 0; k < 8; k++) {
            const float sum = sums[i][k] + __shfl_xor_sync(ALL, sums[i][k], 16);
            if (threadIdx.x % 32 < 16)
                all[threadIdx.x / 32][i * WIDTH + 8 * Mine().chunk + k] = sum;
        }
    barrier();
    if (threadIdx.x < 2 * WIDTH) {
        float sum = 0.f;
        for (int warp = 0; warp < EDGE_THREADS / 32; warp++) sum += all[warp][threadIdx.x];
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
            for (int k = threadIdx.x; k < ROWS * STRIDE; k += EDGE_THREADS)
                (&shared.stages[s].x.part[0][0][0])[k] = make_uint4(0, 0, 0, 0);
        barrier();
    }
    // Of the tile to be fetched next.
    u32 output[SHARE] = {};
    auto read_output = [&](u32 tile) {
        if (LAST && a.output)
#pragma unroll
            for (int k = 0; k < SHARE; k++)
                output[k] = output_row(a, tile * ROWS + Mine().local(k), rows);
    };
    read_output(blockIdx.x);
    for (int s = 0; s < STAGES - 1; s++) {
        const u32 tile = blockIdx.x + s * step;
        if (tile < tiles) fetch<LAST>(shared.stages[s], a, p, dz, tile, rows, output);
        end_copies();
        read_output(tile + step);
    }
    Ahead ahead;
    if (LAST) ahead.read(a, blockIdx.x, rows);
    float norm_sums[2][8] = {};
    Sums sums;

    int current = 0;
    for (u32 tile = blockIdx.x; tile < tiles; tile += step) {
        Stage& stage = shared.stages[current];
        float gathered[SHARE][8] = {};
        if (LAST && a.gathered) ahead.gather(a, gathered);
        wait_for_copies<STAGES - 2>();
        if (LAST) normalise_backward(stage, a, shared.scale, gathered, ahead, norm_sums);
        if (!p.x) round_features(stage, p.feature_count);
        barrier();
        // Into the stage that all have done with.
        const u32 next = tile + (STAGES - 1) * step;
        if (next < tiles)
            fetch<LAST>(shared.stages[(current + STAGES - 1) % STAGES], a, p, dz, next, rows,
                        output);
        end_copies();
        read_output(next + step);
        if (LAST) ahead.read(a, tile + step, rows);
        if (ADDS) sums.add(stage.x, stage.dz, p.x ? WIDTH : p.feature_count, p.bias);
        else if (to)
            input_gradient(shared, stage, to, tile, rows, hidden, a.slope, a.accumulate & 1);
        current = (current + 1) % STAGES;
    }
    if (ADDS) sums.write(p, shared.partial);
    if (LAST) write_norm_sums(shared, a.norm_sums, norm_sums);
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
    extern __shared__ uint4 memory[];
    Shared& shared = *(Shared*)memory;
    const Backward& a = batch.item[blockIdx.y];
    if (threadIdx.x < WIDTH)
        shared.scale[threadIdx.x] =
            threadIdx.x < a.width ? a.parameters[a.norm + threadIdx.x] : 0.f;
    if (threadIdx.x < SUM_THREADS) backward<true>(shared, a);
    else backward<false>(shared, a);
}

#endif
