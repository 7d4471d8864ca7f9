// The gradient of a linear's weights, X^T dZ, and of its bias, the column sums of dZ. The rows are
// shared out among blocks, whose sums `reduce_gradient` adds up in a fixed order. Numbers are bf16
// or, with their range of sizes, sums of two bf16: 16 bits of mantissa are enough here, where errors
// do not pass through further layers.

struct Product {
    const u32* count;
    // X, rows x 128; row k is row `index[k]` if there is an index.
    const Stored* x;
    const u32* index;
    // X, rows x feature_count, if `x` is null.
    const float* features;
    // dZ, rows x 128.
    const Stored* dz;
    // Sums of each block: 128 x 128 and 128 numbers.
    float* weight;
    float* bias;
    u32 rows;
    int feature_count, blocks;
};

constexpr int ROWS = 64;
// Words of 16 bytes of a row in shared memory: one more than its own against bank conflicts.
constexpr int STRIDE = 17;

struct Rows64 {
    uint4 part[PARTS][ROWS][STRIDE];
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
        to.part[p][row][chunk] = make_uint4(word[0][p], word[1][p], word[2][p], word[3][p]);
}

__device__ __forceinline__ const void* at8(const Rows64& from, int part, int row, int column) {
    return &from.part[part][row][column / 8];
}

// Threads that add up a product, and how many of them share a pair of columns of dZ.
constexpr int SUM_THREADS = 256;
constexpr int SHARERS = SUM_THREADS / (WIDTH / 2);

// X^T dZ of a block's rows in the registers of eight warps, each of which has 32 x 64 of it.
struct Sums {
    float weight[2][8][4] = {};
    float bias[2] = {};
    int row0 = 32 * (threadIdx.x / 32 % 4), column0 = 64 * (threadIdx.x / 128);

    // Adds ROWS rows. Rows of the product from `rows` on are not wanted.
    __device__ void add(const Rows64& x, const Rows64& dz, int rows, bool with_bias) {
        const int lane = threadIdx.x % 32;
        if (row0 < rows)
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
                                        at8(x, s, left, row0 + 16 * m + 8 * (lane / 8 % 2)));
#pragma unroll
                for (int j = 0; j < 8; j += 2)
#pragma unroll
                    for (int s = 0; s < PARTS; s++) {
                        u32 b[4];
                        load_transposed(b, at8(dz, s, right, column0 + 8 * j + 8 * (lane / 16)));
#pragma unroll
                        for (int m = 0; m < 2; m++)
#pragma unroll
                            for (int r = 0; r < PARTS; r++) {
                                multiply_add(weight[m][j], p[r][m], b[0], b[1]);
                                multiply_add(weight[m][j + 1], p[r][m], b[2], b[3]);
                            }
                    }
            }
        if (!with_bias) return;
        const u32* pairs = (const u32*)&dz;
#pragma unroll
        for (int s = 0; s < PARTS; s++)
#pragma unroll
            for (int k = 0; k < ROWS / SHARERS; k++) {
                int row = s * ROWS + threadIdx.x / (WIDTH / 2) * (ROWS / SHARERS) + k;
                u32 both = pairs[row * STRIDE * 4 + threadIdx.x % (WIDTH / 2)];
                bias[0] += low(both);
                bias[1] += high(both);
            }
    }

    // The block's share of the gradient; of the bias, what is left to be added up.
    __device__ void write(const Product& a, float (*partial)[WIDTH]) const {
        const int g = threadIdx.x % 32 / 4, t = threadIdx.x % 4;
        float* block = a.weight + (size_t)blockIdx.x * WIDTH * WIDTH;
#pragma unroll
        for (int m = 0; m < 2; m++)
#pragma unroll
            for (int j = 0; j < 8; j++) {
                float* to = block + (row0 + 16 * m + g) * WIDTH + column0 + 8 * j + 2 * t;
                *(float2*)to = make_float2(weight[m][j][0], weight[m][j][1]);
                *(float2*)(to + 8 * WIDTH) = make_float2(weight[m][j][2], weight[m][j][3]);
            }
        for (int i = 0; i < 2; i++)
            partial[threadIdx.x / (WIDTH / 2)][2 * (threadIdx.x % (WIDTH / 2)) + i] = bias[i];
    }
};

// The block's share of the gradient of the bias, once all partial sums are there.
__device__ __forceinline__ void write_bias(const Product& a, const float (*partial)[WIDTH]) {
    if (!a.bias || threadIdx.x >= WIDTH) return;
    float total = 0.f;
    for (int k = 0; k < SHARERS; k++) total += partial[k][threadIdx.x];
    a.bias[blockIdx.x * WIDTH + threadIdx.x] = total;
}
