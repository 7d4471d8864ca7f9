// The loss, and from all blocks' sums the gradient of the weights and Adam's step. Gradients are
// those of the sum of squared errors until Adam divides them by the sum of squared targets: both
// stand behind the gradient, and several GPUs add up all of it in between. `Target` is defined in
// optimiser.rs.

// A block adds up REDUCE_ROWS rows of a target. Warps that share a row: each adds up every fourth
// slice, four columns a lane. Slices that a warp loads at a time.
constexpr int REDUCE_WARPS = WIDTH / 32, REDUCE_TOGETHER = 8;

__device__ __forceinline__ float4 sum_slices(const float* from, int count, int size) {
    float4 sum = {};
    for (int first = threadIdx.x % WIDTH / 32; first < count; first += REDUCE_TOGETHER * REDUCE_WARPS) {
        float4 slices[REDUCE_TOGETHER];
#pragma unroll
        for (int n = 0; n < REDUCE_TOGETHER; n++) {
            const int slice = min(first + n * REDUCE_WARPS, count - 1);
            slices[n] = *(const float4*)(from + (size_t)slice * size + threadIdx.x % 32 * 4);
        }
#pragma unroll
        for (int n = 0; n < REDUCE_TOGETHER; n++) {
            const bool there = first + n * REDUCE_WARPS < count;
            sum.x += there ? slices[n].x : 0.f, sum.y += there ? slices[n].y : 0.f;
            sum.z += there ? slices[n].z : 0.f, sum.w += there ? slices[n].w : 0.f;
        }
    }
    return sum;
}

// Block (x, y) adds up the rows number x of target y.
extern "C" __global__ void __launch_bounds__(REDUCE_ROWS * WIDTH, 2)
    reduce_gradient(const Target* targets, const float* parameters, float* gradient) {
    wait_for_kernel_before();
    const Target a = targets[blockIdx.y];
    const int row = blockIdx.x * REDUCE_ROWS + threadIdx.x / WIDTH, column = threadIdx.x % WIDTH;
    if (blockIdx.x * REDUCE_ROWS >= a.rows) return;
    __shared__ __align__(16) float all[REDUCE_WARPS][REDUCE_ROWS * WIDTH];
    if (row < a.rows) {
        float4 sum = sum_slices(a.sums + a.first + row * WIDTH, a.count, a.size);
        if (a.norm >= 0) {
            const float4 more = sum_slices(a.shift_sums, a.shift_count, WIDTH);
            const float scale = parameters[a.norm + row];
            const float shift = parameters[a.norm + a.width + row];
            sum.x = scale * sum.x + shift * more.x, sum.y = scale * sum.y + shift * more.y;
            sum.z = scale * sum.z + shift * more.z, sum.w = scale * sum.w + shift * more.w;
        }
        *(float4*)&all[column / 32][threadIdx.x / WIDTH * WIDTH + column % 32 * 4] = sum;
    }
    __syncthreads();
    if (row >= a.rows || column >= a.columns) return;
    float total = 0.f;
    for (int k = 0; k < REDUCE_WARPS; k++) total += all[k][threadIdx.x];
    gradient[a.to + row * a.columns + column] = total;
}

constexpr int LOSS_THREADS = 1024;

__device__ float block_sum(float x) {
    __shared__ float all[LOSS_THREADS / 32];
    for (int bit = 16; bit > 0; bit /= 2) x += __shfl_xor_sync(ALL, x, bit);
    __syncthreads();
    if (threadIdx.x % 32 == 0) all[threadIdx.x / 32] = x;
    __syncthreads();
    float sum = 0.f;
    for (int k = 0; k < LOSS_THREADS / 32; k++) sum += all[k];
    return sum;
}

// sums = { sum (a - a*)^2, sum (a*^2 + floor^2) } over nodes x columns, and the gradient of the first
// in rows of 128. `relative`: those of each group of nodes are divided by the group's second sum, so that
// losses and ones are added up.
extern "C" __global__ void __launch_bounds__(LOSS_THREADS)
    loss_gradient(const float* output, const float* target, const u32* ends, int groups, int columns,
                  float* gradient, float* sums, float floor, int relative) {
    wait_for_kernel_before();
    float errors = 0.f, scales = 0.f;
    for (int group = 0, first = 0; group < groups; group++) {
        const int end = ends[group] * columns;
        float error = 0.f, scale = 0.f;
#pragma unroll 4
        for (int n = first + threadIdx.x; n < end; n += LOSS_THREADS) {
            float e = output[n] - target[n];
            error += e * e;
            scale += target[n] * target[n] + floor * floor;
        }
        error = block_sum(error);
        scale = block_sum(scale);
        const float unit = relative ? not_zero(scale) : 1.f;
        for (int n = first + threadIdx.x; n < end; n += LOSS_THREADS)
            gradient[n / columns * WIDTH + n % columns] = 2.f * (output[n] - target[n]) / unit;
        errors += error / unit;
        scales += relative ? 1.f : scale;
        first = end;
    }
    if (threadIdx.x == 0) sums[0] = errors, sums[1] = scales;
}

// One step of Adam (Kingma, Ba, 2015), and of the moving average of the weights if `average` is not
// null, for all weights but those that `muon` marks, if that is not null. `rates`: rate, 1 - beta_1^n, 1 - beta_2^n, decay of the average. `gradient` ends with the
// sums of the loss, which goes to its place in the ring of losses.
extern "C" __global__ void adam(float* weights, float* mean, float* square, float* average,
                                const float* gradient, const float* rates, const unsigned char* muon, int count,
                                float* losses, u32* counter, u32 ring) {
    const int k = blockIdx.x * blockDim.x + threadIdx.x;
    const float scale = not_zero(gradient[count + 1]);
    if (k == 0) losses[atomicAdd(counter, 1) % ring] = gradient[count] / scale;
    if (k >= count || (muon && muon[k])) return;
    const float beta_1 = 0.9f, beta_2 = 0.999f, g = gradient[k] / scale;
    const float m = mean[k] = beta_1 * mean[k] + (1.f - beta_1) * g;
    const float s = square[k] = beta_2 * square[k] + (1.f - beta_2) * g * g;
    const float w = weights[k] -= rates[0] * (m / rates[1]) / (sqrtf(s / rates[2]) + 1e-8f);
    if (average) average[k] = rates[3] * average[k] + (1.f - rates[3]) * w;
}
