// The gradient of a linear's weights, X^T dZ, and of its bias, the column sums of dZ. The rows are
// shared out among blocks, whose sums `reduce_gradient` adds up in a fixed order.

struct Product {
    // Number of rows.
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
    int feature_count, blocks;
};

// 128 columns as the tensor cores read them: of half the columns first, rows of 128 bytes, in which
// chunks of eight numbers are exchanged lest those of a column share memory banks.
template <int N>
struct alignas(1024) Matrix {
    uint4 chunks[2][N][8];

    __device__ uint4& at(int row, int chunk) { return chunks[chunk / 8][row][(chunk ^ row) & 7]; }
    __device__ const uint4& at(int row, int chunk) const {
        return chunks[chunk / 8][row][(chunk ^ row) & 7];
    }
};

// What the tensor cores need to know of a part of a `Matrix`: bytes from 64 columns to the next, if
// columns are contiguous for the product, and from eight rows to the next.
__device__ __forceinline__ unsigned long long describe(const void* part, int columns) {
    const unsigned long long address = (u32)__cvta_generic_to_shared(part), swizzle_128_bytes = 1;
    return address >> 4 | (unsigned long long)(columns >> 4) << 16 | 1024ull >> 4 << 32 |
           swizzle_128_bytes << 62;
}
