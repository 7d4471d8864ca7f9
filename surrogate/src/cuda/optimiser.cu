// The loss, and from all blocks' sums the gradient of the weights and Adam's step. Gradients are
// those of the sum of squared errors until Adam divides them by the sum of squared targets: both
// stand behind the gradient, and several GPUs add up all of it in between.

// A part of the list of all weights, and the sums of which its gradient consists.
struct Target {
    // `count` slices of `size` numbers; of each, rows x columns from `first` in rows of 128.
    const float* sums;
    // If the product was one with x in place of scale x + shift, the sums of dZ, `shift_count`
    // slices, and the offset of the scale and, `width` on, the shift in the list of weights.
    const float* shift_sums;
    int count, size, first, rows, columns, shift_count, norm, width;
    // Offset in the list of weights.
    int to;
};

constexpr int REDUCE_GROUPS = 4;

// Every fourth slice from `from` on.
__device__ float sum_slices(const float* from, int count, int size) {
    float sum = 0.f;
#pragma unroll 8
    for (int k = threadIdx.x / WIDTH; k < count; k += REDUCE_GROUPS) sum += from[(size_t)k * size];
    return sum;
}

// Block (x, y) adds up row x of target y: four groups of 128 threads a quarter of the slices each.
extern "C" __global__ void reduce_gradient(const Target* targets, const float* parameters,
                                           float* gradient) {
    wait_for_kernel_before();
    const Target a = targets[blockIdx.y];
    const int row = blockIdx.x, column = threadIdx.x % WIDTH, group = threadIdx.x / WIDTH;
    if (row >= a.rows) return;
    float sum = sum_slices(a.sums + a.first + row * WIDTH + column, a.count, a.size);
    if (a.norm >= 0) {
        float shift = sum_slices(a.shift_sums + column, a.shift_count, WIDTH);
        sum = parameters[a.norm + row] * sum + parameters[a.norm + a.width + row] * shift;
    }
    __shared__ float all[REDUCE_GROUPS][WIDTH];
    all[group][column] = sum;
    __syncthreads();
    if (group != 0 || column >= a.columns) return;
    for (int k = 1; k < REDUCE_GROUPS; k++) sum += all[k][column];
    gradient[a.to + row * a.columns + column] = sum;
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

// Finite when nothing accelerates.
__device__ float not_zero(float scale) { return fmaxf(scale, 1e-12f); }

// sums = { sum (a - a*)^2, sum (a*^2 + floor^2) } over nodes x columns, and the gradient of the first
// in rows of 128. `relative`: both divided by the second, so that GPUs add up losses and ones.
extern "C" __global__ void __launch_bounds__(LOSS_THREADS)
    loss_gradient(const float* output, const float* target, const u32* nodes, int columns,
                  float* gradient, float* sums, float floor, int relative) {
    const int count = read_early(nodes) * columns;
    wait_for_kernel_before();
    float error = 0.f, scale = 0.f;
    for (int n = threadIdx.x; n < count; n += LOSS_THREADS) {
        float e = output[n] - target[n];
        error += e * e;
        scale += target[n] * target[n] + floor * floor;
    }
    error = block_sum(error);
    scale = block_sum(scale);
    const float unit = relative ? not_zero(scale) : 1.f;
    for (int n = threadIdx.x; n < count; n += LOSS_THREADS)
        gradient[n / columns * WIDTH + n % columns] = 2.f * (output[n] - target[n]) / unit;
    if (threadIdx.x == 0) {
        sums[0] = error / unit;
        sums[1] = relative ? 1.f : scale;
    }
}

// One step of Adam (Kingma, Ba, 2015), and of the moving average of the weights if `average` is not
// null. `rates`: rate, 1 - beta_1^n, 1 - beta_2^n, decay of the average. `gradient` ends with the
// sums of the loss, which goes where the counter of losses says.
extern "C" __global__ void adam(float* weights, float* mean, float* square, float* average,
                                const float* gradient, const float* rates, int count,
                                float* losses, u32* counter, u32 room) {
    const int k = blockIdx.x * blockDim.x + threadIdx.x;
    const float scale = not_zero(gradient[count + 1]);
    if (k == 0) losses[atomicAdd(counter, 1) % room] = gradient[count] / scale;
    if (k >= count) return;
    const float beta_1 = 0.9f, beta_2 = 0.999f, g = gradient[k] / scale;
    const float m = mean[k] = beta_1 * mean[k] + (1.f - beta_1) * g;
    const float s = square[k] = beta_2 * square[k] + (1.f - beta_2) * g * g;
    const float w = weights[k] -= rates[0] * (m / rates[1]) / (sqrtf(s / rates[2]) + 1e-8f);
    if (average) average[k] = rates[3] * average[k] + (1.f - rates[3]) * w;
}
