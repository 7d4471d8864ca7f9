// MLPs, forward: a linear of up to two matrices, of features and of gathered rows, then LeakyReLU
// and linear for each hidden layer, then LayerNorm. A warp takes 16 rows through all of it without
// leaving its registers. `Forward` is defined in forward.rs.

// Biases of all linears, LayerNorm's scale and shift and those of x_0's, 128 numbers each with zeros
// for padding.
__device__ void load_vectors(float* to, const Forward& a) {
    for (int k = threadIdx.x; k < (a.layers + 5) * WIDTH; k += blockDim.x) {
        const int column = k % WIDTH, vector = k / WIDTH, after = vector - a.layers;
        int offset = after < 0 ? a.bias < 0 ? -1 : a.bias + vector * a.bias_stride
                     : after == 0 ? a.last_bias
                     : after < 3 ? a.norm
                                 : a.input_norm;
        const int count = after < 0 || after > 2 ? a.width : a.columns;
        // Shifts follow scales.
        if (after == 2 || after == 4) offset += offset < 0 ? 0 : count;
        to[k] = offset >= 0 && column < count ? read_early(a.parameters + offset + column) : 0.f;
    }
}

// Features, as sums of two f16 in any precision: they carry positions.
__device__ void multiply_features(Tile& z, const Forward& a, const Place& at, const uint4* weights) {
    scale_rows(z, WEIGHT_SCALE, WEIGHT_SCALE);
    for (int s = 0; s < a.feature_steps; s++) {
        u32 x[2][4];
#pragma unroll
        for (int r = 0; r < 4; r++) {
            int half = r % 2;
            float v[2];
#pragma unroll
            for (int i = 0; i < 2; i++) {
                int column = 16 * s + 2 * at.t + 8 * (r / 2) + i;
                bool real = at.live[half] && column < a.feature_count;
                float x = a.features[real ? (size_t)at.row[half] * a.feature_stride + column : 0];
                v[i] = real ? x : 0.f;
            }
            u32 part[2];
            split_f16(v[0], v[1], part);
            x[0][r] = part[0], x[1][r] = part[1];
        }
        const uint4* w = weights + s * STEP;
        begin_products();
        add_product<true>(z, x[0], w + a.feature_steps * STEP);
        add_product<true>(z, x[1], w);
        add_product<true>(z, x[0], w);
        end_products();
    }
    scale_rows(z, 1.f / WEIGHT_SCALE, 1.f / WEIGHT_SCALE);
}

// z -> (z - mean) / sqrt(variance + 1e-5) over the `width` columns that are not padding.
__device__ void normalise(Tile& z, int width, float (&deviation)[2]) {
    const float share = 1.f / width;
#pragma unroll
    for (int half = 0; half < 2; half++) {
        float sum = 0.f;
#pragma unroll
        for (int j = 0; j < 16; j++) sum += z[j][2 * half] + z[j][2 * half + 1];
        float mean = row_sum(sum) * share, square = 0.f;
#pragma unroll
        for (int j = 0; j < 16; j++)
#pragma unroll
            for (int i = 0; i < 2; i++) {
                float x = z[j][2 * half + i] -= mean;
                square += x * x;
            }
        // Columns of padding are 0 and count for mean^2 each.
        float variance = (row_sum(square) - (WIDTH - width) * mean * mean) * share;
        deviation[half] = rsqrtf(fmaxf(variance, 0.f) + 1e-5f);
#pragma unroll
        for (int j = 0; j < 16; j++) {
            z[j][2 * half] *= deviation[half];
            z[j][2 * half + 1] *= deviation[half];
        }
    }
}

// Adds up the rows of each receiver. k + v differs between any two runs: either their tiles or their
// receivers ascend.
__device__ void sum_runs(const Tile& z, float* sums, const u32 (&receiver)[2], const Place& at) {
    const u32 lane = threadIdx.x % 32;
    u32 now = __shfl_sync(ALL, receiver[0], 0);
    while (now != NONE) {
        float* to = sums + (size_t)(at.row[0] / 16 + now) * WIDTH + 8 * at.t + lane / 16 * 4 + lane / 8 % 2 * 2 + lane / 4 % 2;
#pragma unroll
        for (int q = 0; q < 4; q++) {
            float v[8];
#pragma unroll
            for (int k = 0; k < 8; k++)
                v[k] = (receiver[0] == now ? z[4 * q + k / 2][k % 2] : 0.f)
                       + (receiver[1] == now ? z[4 * q + k / 2][2 + k % 2] : 0.f);
            // Each lane hands on half of its columns and keeps the other half.
#pragma unroll
            for (int size = 4, bit = 16; size >= 1; size /= 2, bit /= 2)
#pragma unroll
                for (int k = 0; k < size; k++) {
                    const bool upper = lane & bit;
                    const float give = upper ? v[k] : v[k + size];
                    v[k] = (upper ? v[k + size] : v[k]) + __shfl_xor_sync(ALL, give, bit);
                }
            to[32 * q] = v[0];
        }
        // The next receiver.
        const u32 after[2] = {receiver[0] > now ? receiver[0] : NONE,
                              receiver[1] > now ? receiver[1] : NONE};
        now = __reduce_min_sync(ALL, min(after[0], after[1]));
    }
}

// Scale and shift, and what is done with the output.
__device__ void finish(Tile& z, const Forward& a, const Place& at, const u32 (&source)[2],
                       const u32 (&receiver)[2], const float* scales) {
    u32 own[2];
    at.rows(own);
    if (a.norm >= 0) {
        float deviation[2];
        normalise(z, a.width, deviation);
        if (a.sums) sum_runs(z, a.sums, receiver, at);
        if (a.normal) store_rows(z, a.normal, at);
        if (a.deviation) {
            if (at.t == 0)
#pragma unroll
                for (int half = 0; half < 2; half++)
                    if (at.live[half]) a.deviation[at.row[half]] = deviation[half];
        }
        // Many edges need no scale and shift: their readers apply them.
        if (!a.output && !a.output32 && !a.narrow) return;
#pragma unroll
        for (int q = 0; q < 4; q++) {
            float s[8], b[8];
            load8(scales + at.column(q), s);
            load8(scales + WIDTH + at.column(q), b);
#pragma unroll
            for (int k = 0; k < 8; k++)
#pragma unroll
                for (int half = 0; half < 2; half++) {
                    float& x = z[4 * q + k / 2][2 * half + k % 2];
                    x = s[k] * x + b[k];
                }
        }
    }
    if (a.residual) add_rows(z, a.residual, own, at.t);
    if (a.output) {
        Place written = at;
        written.live[0] = source[0] != NONE, written.live[1] = source[1] != NONE;
        store_rows(z, a.output, written);
    }
    if (a.output32) {
        if (a.accumulate) add_rows(z, a.output32, own, at.t);
        store_rows(z, a.output32, at);
    }
    if (a.narrow && at.t == 0) {
#pragma unroll
        for (int half = 0; half < 2; half++)
#pragma unroll
            for (int k = 0; k < 8; k++)
                if (at.live[half] && k < a.columns)
                    a.narrow[at.row[half] * a.columns + k] = z[k / 2][2 * half + k % 2];
    }
}

// All of a block's tiles; `biases` points to the vectors of `load_vectors`.
template <class Weights>
__device__ __forceinline__ void forward(const Forward& a, Weights& weights, const float* biases,
                                        u32 rows) {
    const float* scales = biases + (a.layers + 1) * WIDTH;
    const float* input_scales = scales + 2 * WIDTH;
    const int matrix = PARTS * UNIT, feature_matrix = 2 * a.feature_steps * STEP;
    for (Tiles<Weights::TOGETHER> tile(rows); tile.next();) {
        weights.begin_tile();
        const Place at(tile.index, rows);
        Tile z;
        fill(z, biases, at.t);
        // Rows of x_0 and those that are added.
        u32 own[2], source[2], added[2][2];
        at.rows(own);
#pragma unroll
        for (int half = 0; half < 2; half++) {
            const u32 row = own[half] != NONE ? own[half] : 0;
            const u32 from[3] = {a.index ? a.index[row] : row, a.added[0] ? a.added_index[0][row] : 0,
                                 a.added[1] ? a.added_index[1][row] : 0};
            source[half] = own[half] != NONE ? from[0] : NONE;
#pragma unroll
            for (int k = 0; k < 2; k++) added[k][half] = own[half] != NONE ? from[1 + k] : NONE;
        }
#pragma unroll
        for (int k = 0; k < 2; k++)
            if (a.added[k]) add_rows(z, a.added[k], added[k], at.t);
#pragma unroll 1
        for (int k = 0; k < 2; k++) {
            if (!a.x[k]) continue;
            Operand x;
            const float* scale = k == 0 && a.input_norm >= 0 ? input_scales : nullptr;
            load_operand(x, a.x[k], k == 0 ? source : own, scale, at.t);
            multiply(z, x, weights.next(matrix));
        }
        if (a.features) multiply_features(z, a, at, weights.next(feature_matrix));
#pragma unroll 1
        for (int l = 0; l < a.layers; l++) {
            Operand x;
#pragma unroll
            for (int j = 0; j < 16; j++)
#pragma unroll
                for (int k = 0; k < 4; k++) z[j][k] = leaky(z[j][k], a.slope);
            if (a.hidden) store_rows(z, a.hidden + l * a.stride, at);
            to_operand(z, x);
            fill(z, biases + (l + 1) * WIDTH, at.t);
            multiply(z, x, weights.next(matrix));
        }
        finish(z, a, at, source, added[1], scales);
    }
}

__device__ int vectors_of(const Forward& a) { return (a.layers + 5) * WIDTH; }

// One of the two kernels, as each takes the compiler seconds.
#if !STREAMED
// MLPs side by side, whose weights fit into shared memory.
extern "C" __global__ void __launch_bounds__(THREADS, 1)
    mlp_forward(const __grid_constant__ ForwardBatch batch) {
    extern __shared__ uint4 shared[];
    const Forward& a = batch.item[blockIdx.y];
    float* vectors = (float*)shared;
    Resident weights(a.weights, (uint4*)(vectors + vectors_of(a)), a.units);
    load_vectors(vectors, a);
    const u32 rows = read_early(a.count);
    wait_for_kernel_before();
    weights.wait();
    forward(a, weights, vectors, rows);
}
#else
__device__ Matrix16 matrix_of(const Forward& a, int n) {
    const int states = (a.x[0] != nullptr) + (a.x[1] != nullptr), features = a.features != nullptr;
    const int matrix = PARTS * UNIT, feature_matrix = 2 * a.feature_steps * STEP;
    if (n >= states + features + a.layers) return {nullptr, 0};
    const bool after = features && n > states;
    return {a.weights + (after ? (n - 1) * matrix + feature_matrix : n * matrix),
            features && n == states ? feature_matrix : matrix};
}

// The same for weights that pass through shared memory.
extern "C" __global__ void __launch_bounds__(STREAM_THREADS, 1)
    mlp_forward_streamed(const __grid_constant__ ForwardBatch batch) {
    extern __shared__ uint4 shared[];
    const Forward& a = batch.item[blockIdx.y];
    const u32 rows = read_early(a.count);
    Stream<Forward> weights(a, shared, Tiles<true>(rows).rounds());
    float* vectors = (float*)(shared + RING * weights.SLOT);
    load_vectors(vectors, a);
    wait_for_kernel_before();
    __syncthreads();
    forward(a, weights, vectors, rows);
}
#endif
