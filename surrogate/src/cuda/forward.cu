// MLPs, forward: a linear of up to two matrices, of features and of gathered rows, then LeakyReLU
// and linear for each hidden layer, then LayerNorm. A warp takes 16 rows through all of it without
// leaving its registers.

struct Forward {
    // Number of rows in device memory; if null, it is `rows`.
    const u32* count;
    // Inputs, rows x 128: x_0 W_0 + x_1 W_1. Row k of x_0 is `index[k]` if there is an index.
    const Stored* x[2];
    const u32* index;
    // Inputs of few columns, rows x feature_count, `feature_stride` numbers from row to row.
    const float* features;
    // Rows that are added to the first linear.
    const Stored* added[2];
    const u32* added_index[2];
    // Packed: x_0, x_1, features, then hidden layers.
    const uint4* weights;
    // All weights of the network, of which biases and LayerNorm are read.
    const float* parameters;
    // Outputs; each may be null. Activations of the hidden layers, `stride` numbers apart.
    Stored* hidden;
    size_t stride;
    // Before LayerNorm's scale and shift, and the reciprocal standard deviation.
    Stored* normal;
    float* deviation;
    // After them, with `residual` added. Rows whose `index` is NONE are not written.
    Stored* output;
    const Stored* residual;
    // Output in f32, added to what is there if `accumulate`.
    float* output32;
    // The first `columns` (at most 8) of the output alone, rows x columns.
    float* narrow;

    u32 rows;
    int units, resident, feature_count, feature_stride, feature_steps;
    // Offsets in `parameters`: of biases (-1 for none), of LayerNorm (-1 for none), of the
    // LayerNorm whose scale and shift apply to x_0 (-1 for none).
    int bias, bias_stride, last_bias, norm, input_norm;
    int layers, width, columns, accumulate;
    float slope;
};

struct ForwardBatch {
    Forward item[8];
};

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
        to[k] = offset >= 0 && column < count ? a.parameters[offset + column] : 0.f;
    }
}

// Features, as sums of two f16 in any precision: they carry positions.
__device__ void multiply_features(Tile& z, const Forward& a, const Place& at, const uint4* weights) {
    scale_rows(z, WEIGHT_SCALE, WEIGHT_SCALE);
    for (int s = 0; s < a.feature_steps; s++) {
        u32 x[2][4];
#pragma unroll
        for (int r = 0; r < 4; r++) {
            int half = r % 2, first = 16 * s + 2 * at.t + 8 * (r / 2);
            const float* row = a.features + (size_t)at.row[half] * a.feature_stride;
            bool live = at.live[half];
            float v0 = live && first < a.feature_count ? row[first] : 0.f;
            float v1 = live && first + 1 < a.feature_count ? row[first + 1] : 0.f;
            u32 part[2];
            split_f16(v0, v1, part);
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

// Scale and shift, and what is done with the output.
__device__ void finish(Tile& z, const Forward& a, const Place& at, const u32 (&source)[2],
                       const float* scales) {
    u32 own[2];
    at.rows(own);
    if (a.norm >= 0) {
        float deviation[2];
        normalise(z, a.width, deviation);
        if (a.normal) {
            store_rows(z, a.normal, at);
            if (at.t == 0)
#pragma unroll
                for (int half = 0; half < 2; half++)
                    if (at.live[half]) a.deviation[at.row[half]] = deviation[half];
        }
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

__device__ __forceinline__ void forward(const Forward& a) {
    extern __shared__ uint4 shared[];
    float* biases = (float*)shared;
    float* scales = biases + (a.layers + 1) * WIDTH;
    float* input_scales = scales + 2 * WIDTH;
    const int matrix = PARTS * UNIT, feature_matrix = 2 * a.feature_steps * STEP;
    Weights weights(a.weights, (uint4*)(input_scales + 2 * WIDTH), a.units, a.resident);
    load_vectors(biases, a);
    weights.wait();

    const u32 rows = a.count ? *a.count : a.rows;
    for (Tiles tile(rows, a.resident); tile.next();) {
        weights.cursor = 0;
        const Place at(tile.index, rows);
        Tile z;
        fill(z, biases, at.t);
        u32 own[2], source[2];
        at.rows(own);
#pragma unroll
        for (int half = 0; half < 2; half++)
            source[half] = a.index && own[half] != NONE ? a.index[own[half]] : own[half];
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
        for (int k = 0; k < 2; k++) {
            if (!a.added[k]) continue;
            u32 from[2];
#pragma unroll
            for (int half = 0; half < 2; half++)
                from[half] = own[half] != NONE ? a.added_index[k][own[half]] : NONE;
            add_rows(z, a.added[k], from, at.t);
        }
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
        finish(z, a, at, source, scales);
    }
}

extern "C" __global__ void __launch_bounds__(THREADS, 1)
    mlp_forward(const __grid_constant__ ForwardBatch batch) {
    forward(batch.item[blockIdx.y]);
}
