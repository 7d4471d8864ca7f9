// MLPs, backward: from the gradient of the output to those of all linears' outputs (which
// gradient.cu turns into the weights') and of the inputs. A warp takes 16 rows through all
// of it. `Backward` is defined in backward.rs.

// Sums 16 numbers over the eight lanes of equal t; a lane gets the sums number
// 2 (lane / 4 % 2 + 2 (lane / 8 % 2) + 4 (lane / 16)) and the next.
__device__ __forceinline__ void sum_rows(float (&v)[16], float (&sum)[2]) {
    const int lane = threadIdx.x % 32;
#pragma unroll
    for (int size = 8, bit = 16; bit >= 4; size /= 2, bit /= 2) {
        const bool upper = lane & bit;
#pragma unroll
        for (int k = 0; k < size; k++) {
            float give = upper ? v[k] : v[k + size], keep = upper ? v[k + size] : v[k];
            v[k] = keep + __shfl_xor_sync(ALL, give, bit);
        }
    }
    sum[0] += v[0], sum[1] += v[1];
}

// dy -> dz = (dx - mean(dx) - x mean(dx x)) / deviation with dx = scale dy, for y = scale x + shift
// and x = (z - mean(z)) / deviation. Adds dy x and dy, summed over the rows, to `sums`.
__device__ void normalise_backward(Tile& z, const Backward& a, const Place& at, const float* scale,
                                   float (&sums)[4][2]) {
    float mean[2] = {0.f, 0.f}, product[2] = {0.f, 0.f}, inverse[2];
    u32 own[2];
    at.rows(own);
    const Rows<Stored> rows(a.normal, own, at.t);
#pragma unroll
    for (int half = 0; half < 2; half++)
        inverse[half] = at.live[half] ? a.deviation[at.row[half]] : 0.f;
#pragma unroll
    for (int q = 0; q < 4; q++) {
        float s[8], both[16] = {};
        load8(scale + at.column(q), s);
#pragma unroll
        for (int half = 0; half < 2; half++) {
            float x[8], dy[8];
            rows.numbers(half, q, x);
            chunk(z, q, half, dy);
#pragma unroll
            for (int k = 0; k < 8; k++) {
                both[k] += dy[k] * x[k];
                both[8 + k] += dy[k];
                mean[half] += s[k] * dy[k];
                product[half] += s[k] * dy[k] * x[k];
            }
        }
        sum_rows(both, sums[q]);
    }
    const float share = 1.f / a.width;
#pragma unroll
    for (int half = 0; half < 2; half++) {
        mean[half] = row_sum(mean[half]) * share;
        product[half] = row_sum(product[half]) * share;
    }
#pragma unroll
    for (int q = 0; q < 4; q++) {
        float s[8];
        load8(scale + at.column(q), s);
#pragma unroll
        for (int half = 0; half < 2; half++) {
            float x[8];
            rows.numbers(half, q, x);
#pragma unroll
            for (int k = 0; k < 8; k++) {
                float& dz = z[4 * q + k / 2][2 * half + k % 2];
                dz = inverse[half] * (s[k] * dz - mean[half] - x[k] * product[half]);
            }
        }
    }
}

// The derivative of LeakyReLU; the sign of its value is that of its argument.
__device__ void leaky_backward(Tile& z, const Stored* hidden, const Place& at, float slope) {
    u32 own[2];
    at.rows(own);
    const Rows<Stored> rows(hidden, own, at.t);
#pragma unroll
    for (int half = 0; half < 2; half++)
#pragma unroll
        for (int q = 0; q < 4; q++) {
            float h[8];
            rows.numbers(half, q, h);
#pragma unroll
            for (int k = 0; k < 8; k++)
                if (!(h[k] > 0.f)) z[4 * q + k / 2][2 * half + k % 2] *= slope;
        }
}

// The gradient of the output.
template <class Weights>
__device__ void output_gradient(Tile& z, const Backward& a, const Place& at, Weights& weights) {
    clear(z);
    u32 row[2];
    at.rows(row);
    if (a.selection)
#pragma unroll
        for (int half = 0; half < 2; half++)
            if (row[half] != NONE && (a.selection[row[half]] == NONE) != (a.select_none != 0))
                row[half] = NONE;
    if (a.output) {
        u32 from[2] = {row[0], row[1]};
        if (a.output_index)
#pragma unroll
            for (int half = 0; half < 2; half++)
                if (row[half] != NONE) from[half] = a.output_index[row[half]];
        add_rows(z, a.output, from, at.t);
    }
    if (a.output32) add_rows(z, a.output32, row, at.t);
    if (a.part_weights) {
#pragma unroll 1
        for (int k = 0; k < 2; k++) {
            Operand x;
            load_operand(x, a.parts[k], row, nullptr, at.t);
            multiply(z, x, weights.next(PARTS * UNIT));
        }
        if (a.accumulate & 1) store_rows(z, a.output32, at);
    }
    if (a.gathered) {
        u32 from[2];
#pragma unroll
        for (int half = 0; half < 2; half++)
            from[half] = row[half] == NONE ? NONE : a.gathered_index[row[half]];
        add_rows(z, a.gathered, from, at.t);
    }
}

// All of a block's tiles; adds to the sums of LayerNorm's parameters.
template <class Weights>
__device__ __forceinline__ void backward(const Backward& a, Weights& weights, const float* scale,
                                         u32 rows, float (&sums)[4][2]) {
    const int matrix = PARTS * UNIT;
    for (Tiles<Weights::TOGETHER> tile(rows); tile.next();) {
        weights.begin_tile();
        const Place at(tile.index, rows);
        Tile z;
        Operand x;
        output_gradient(z, a, at, weights);
        if (a.norm >= 0) normalise_backward(z, a, at, scale, sums);
        store_rows(z, a.linear + a.layers * a.stride, at);
        to_operand(z, x);
#pragma unroll 1
        for (int l = a.layers - 1; l >= 0; l--) {
            clear(z);
            multiply(z, x, weights.next(matrix));
            leaky_backward(z, a.hidden + l * a.stride, at, a.slope);
            store_rows(z, a.linear + l * a.stride, at);
            to_operand(z, x);
        }
#pragma unroll 1
        for (int k = 0; k < 2; k++) {
            if (!a.input32[k] && !(k == 0 && a.input)) continue;
            clear(z);
            multiply(z, x, weights.next(matrix));
            u32 own[2];
            at.rows(own);
            const bool adds = a.accumulate >> k & 1;
            if (a.input32[k]) {
                if (adds) add_rows(z, a.input32[k], own, at.t);
                store_rows(z, a.input32[k], at);
            } else {
                if (adds) add_rows(z, a.input, own, at.t);
                store_rows(z, a.input, at);
            }
        }
    }
}

// The block's sums for LayerNorm's scale and shift, with 256 numbers of shared memory for each warp.
__device__ void write_norm_sums(float* all, const Backward& a, const float (&sums)[4][2]) {
    if (!a.norm_sums) return;
    const u32 warps = blockDim.x / 32, warp = threadIdx.x / 32;
    const int lane = threadIdx.x % 32, first = 2 * (lane / 4 % 2 + 2 * (lane / 8 % 2));
    __syncthreads();
#pragma unroll
    for (int q = 0; q < 4; q++)
#pragma unroll
        for (int i = 0; i < 2; i++) {
            int column = 32 * q + 8 * (lane % 4) + first + i;
            all[(warp * 2 + lane / 16) * WIDTH + column] = sums[q][i];
        }
    __syncthreads();
    for (int k = threadIdx.x; k < 2 * WIDTH; k += blockDim.x) {
        float sum = 0.f;
        for (u32 w = 0; w < warps; w++) sum += all[w * 2 * WIDTH + k];
        a.norm_sums[blockIdx.x * 2 * WIDTH + k] = sum;
    }
}

__device__ void load_scale(float* to, const Backward& a) {
    for (int k = threadIdx.x; k < WIDTH; k += blockDim.x)
        to[k] = a.norm >= 0 && k < a.width ? read_early(a.parameters + a.norm + k) : 0.f;
}

// One of the two kernels, as each takes the compiler seconds.
#if !STREAMED
// MLPs side by side, whose weights fit into shared memory.
extern "C" __global__ void __launch_bounds__(THREADS, 1)
    mlp_backward(const __grid_constant__ BackwardBatch batch) {
    extern __shared__ uint4 shared[];
    const Backward& a = batch.item[blockIdx.y];
    float* scale = (float*)shared;
    Resident weights(a.weights, (uint4*)(scale + WIDTH), a.units);
    load_scale(scale, a);
    const u32 rows = read_early(a.count);
    wait_for_kernel_before();
    weights.wait();
    float sums[4][2] = {};
    backward(a, weights, scale, rows, sums);
    write_norm_sums((float*)shared, a, sums);
}
#else
__device__ Matrix16 matrix_of(const Backward& a, int n) {
    const int parts = a.part_weights ? 2 : 0, matrix = PARTS * UNIT;
    if (n < parts) return {a.part_weights + n * matrix, matrix};
    return {a.weights + (n - parts) * matrix, n - parts < a.units / matrix ? matrix : 0};
}

// The same for weights that pass through shared memory.
extern "C" __global__ void __launch_bounds__(STREAM_THREADS, 1)
    mlp_backward_streamed(const __grid_constant__ BackwardBatch batch) {
    extern __shared__ uint4 shared[];
    const Backward& a = batch.item[blockIdx.y];
    const u32 rows = read_early(a.count);
    Stream<Backward> weights(a, shared, Tiles<true>(rows).rounds());
    float* sums_of_warps = (float*)(shared + RING * weights.SLOT);
    float* scale = sums_of_warps + STREAM_THREADS / 32 * 2 * WIDTH;
    load_scale(scale, a);
    wait_for_kernel_before();
    __syncthreads();
    float sums[4][2] = {};
    backward(a, weights, scale, rows, sums);
    write_norm_sums(sums_of_warps, a, sums);
}
#endif
