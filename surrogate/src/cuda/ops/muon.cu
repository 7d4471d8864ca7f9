// A step of Muon (train/optimiser.rs). Each Newton-Schulz iteration multiplies the matrix X by the polynomial
// Q = a + b A + c A² of its Gram matrix A = X^T X, so that A becomes A Q², and X in the end X times the product P of
// all Q. A, P and Q, of 128 x 128, stay in shared memory. They are symmetric, so that the
// factors of all products are read row by row. `Matrix` is defined in muon.rs.

constexpr int MUON_THREADS = 256, ITERATIONS = 5, ELEMENTS = WIDTH * WIDTH;
// Coefficients a, b, c.
constexpr float FIRST = 3.4445f, SECOND = -4.775f, THIRD = 2.0315f;
constexpr float MUON_BETA = 0.95f, ADAM_STEP = 0.2f;

// The elements of a product that a thread computes: rows place(threadIdx.x / 16, i), columns
// place(threadIdx.x % 16, j).
typedef float Elements[8][8];

__device__ __forceinline__ int place(int thread, int k) { return 4 * thread + k % 4 + k / 4 * 64; }

// all += left^T right.
__device__ __forceinline__ void multiply(const float* left, const float* right, Elements& all) {
    const int row = 4 * (threadIdx.x / 16), column = 4 * (threadIdx.x % 16);
#pragma unroll 4
    for (int k = 0; k < WIDTH; k++) {
        float4 l[2], r[2];
        for (int half = 0; half < 2; half++) {
            l[half] = *(const float4*)(left + k * WIDTH + row + 64 * half);
            r[half] = *(const float4*)(right + k * WIDTH + column + 64 * half);
        }
        const float* a = (const float*)l;
        const float* b = (const float*)r;
#pragma unroll
        for (int i = 0; i < 8; i++)
#pragma unroll
            for (int j = 0; j < 8; j++) all[i][j] += a[i] * b[j];
    }
}

// Calls f(row, column, element) for all elements of the thread.
template <typename F> __device__ __forceinline__ void each(Elements& all, F f) {
#pragma unroll
    for (int i = 0; i < 8; i++)
#pragma unroll
        for (int j = 0; j < 8; j++) f(place(threadIdx.x / 16, i), place(threadIdx.x % 16, j), all[i][j]);
}

// to = left^T right; `to` may be one of them.
__device__ __forceinline__ void product(float* to, const float* left, const float* right) {
    Elements all = {};
    multiply(left, right, all);
    __syncthreads();
    each(all, [&](int row, int column, float& x) { to[row * WIDTH + column] = x; });
    __syncthreads();
}

// A block updates a matrix. Arguments are those of `adam`.
extern "C" __global__ void __launch_bounds__(MUON_THREADS)
    muon(const Matrix* matrices, float* weights, float* mean, float* average, const float* gradient,
         const float* rates, int count) {
    extern __shared__ float4 shared[];
    float *a = (float*)shared, *p = a + ELEMENTS, *q = p + ELEMENTS;
    const Matrix m = matrices[blockIdx.x];
    const float scale = not_zero(gradient[count + 1]);
    const auto average_of = [](float x, float g) { return MUON_BETA * x + (1.f - MUON_BETA) * g; };
    // Nesterov's momentum: as if the next gradient were this one.
    const auto direction = [&](int k) { return average_of(mean[k], gradient[k] / scale); };
    const auto exists = [&](int row, int column) { return row < m.rows && column < m.columns; };

    Elements gram = {};
    for (int first = 0; first < m.rows; first += WIDTH) {
        for (int n = threadIdx.x; n < ELEMENTS; n += MUON_THREADS) {
            const int row = first + n / WIDTH, column = n % WIDTH, k = m.start + row * m.columns + column;
            a[n] = 0.f;
            if (!exists(row, column)) continue;
            mean[k] = average_of(mean[k], gradient[k] / scale);
            a[n] = direction(k);
        }
        __syncthreads();
        multiply(a, a, gram);
        __syncthreads();
    }
    each(gram, [&](int row, int column, float& x) { a[row * WIDTH + column] = x; });
    __syncthreads();
    float square = 0.f;
    for (int k = 0; k < WIDTH; k++) square += a[k * WIDTH + k];
    const float norm = sqrtf(fmaxf(square, 1e-37f));
    __syncthreads();
    each(gram, [&](int row, int column, float& x) { a[row * WIDTH + column] = x / (norm * norm); });
    __syncthreads();

    for (int n = 0; n < ITERATIONS; n++) {
        Elements fourth = {};
        multiply(a, a, fourth);
        each(fourth, [&](int row, int column, float& x) {
            const int k = row * WIDTH + column;
            q[k] = (row == column ? FIRST : 0.f) + SECOND * a[k] + THIRD * x;
            if (n == 0) p[k] = q[k];
        });
        __syncthreads();
        if (n > 0) product(p, p, q);
        if (n + 1 == ITERATIONS) break;
        product(a, a, q);
        product(a, a, q);
    }

    const float step = rates[0] * ADAM_STEP * sqrtf(max(m.rows, m.columns)) / norm;
    for (int first = 0; first < m.rows; first += WIDTH) {
        // Transposed; eight rows of four columns at a time, so that neither side is far apart.
        for (int n = threadIdx.x; n < ELEMENTS; n += MUON_THREADS) {
            const int row = n % 8 + n / 256 % 16 * 8, column = n / 8 % 32 + n / 4096 * 32;
            const bool there = exists(first + row, column);
            a[column * WIDTH + row] = there ? direction(m.start + (first + row) * m.columns + column) : 0.f;
        }
        __syncthreads();
        Elements moved = {};
        multiply(a, p, moved);
        each(moved, [&](int row, int column, float& x) {
            if (!exists(first + row, column)) return;
            const int k = m.start + (first + row) * m.columns + column;
            const float w = weights[k] -= step * x;
            if (average) average[k] = rates[3] * average[k] + (1.f - rates[3]) * w;
        });
        __syncthreads();
    }
}
