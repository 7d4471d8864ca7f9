// MLPs, backward: from the gradient of the output to those of all linears' outputs (which
// gradient.cu turns into the weights') and of the inputs. A warp takes 16 rows through all
// of it.

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

// The derivative of LeakyReLU, whose values tell the sign of its arguments.
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
__device__ void output_gradient(Tile& z, const Backward& a, const Place& at) {
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
    if (a.gathered) {
        u32 from[2];
#pragma unroll
        for (int half = 0; half < 2; half++)
            from[half] = row[half] == NONE ? NONE : a.gathered_index[row[half]];
        add_rows(z, a.gathered, from, at.t);
    }
}

__device__ __forceinline__ void backward(const Backward& a) {
    extern __shared__ uint4 shared[];
    float* scale = (float*)shared;
    const int matrix = PARTS * UNIT;
    Weights weights(a.weights, (uint4*)(scale + WIDTH), a.units, a.resident);
    for (int k = threadIdx.x; k < WIDTH; k += blockDim.x)
        scale[k] = a.norm >= 0 && k < a.width ? read_early(a.parameters + a.norm + k) : 0.f;
    const u32 rows = read_early(a.count);
    wait_for_kernel_before();
    weights.wait();

    float sums[4][2] = {};
    const u32 warps = blockDim.x / 32, warp = threadIdx.x / 32;
    for (Tiles tile(rows, a.resident); tile.next();) {
        weights.cursor = 0;
        const Place at(tile.index, rows);
        Tile z;
        Operand x;
        output_gradient(z, a, at);
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

    if (!a.norm_sums) return;
    __syncthreads();
    float* all = (float*)shared;
    const int lane = threadIdx.x % 32, first = 2 * (lane / 4 % 2 + 2 * (lane / 8 % 2));
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

extern "C" __global__ void __launch_bounds__(THREADS, 1)
    mlp_backward(const __grid_constant__ BackwardBatch batch) {
    backward(batch.item[blockIdx.y]);
}
