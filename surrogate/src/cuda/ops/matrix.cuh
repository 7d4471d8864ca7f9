// Tiles and matrices in shared memory, laid out for the tensor cores.

// N rows of 128 columns as the tensor cores read them: half of the columns, then the other, each in
// rows of 128 bytes, whose chunks of eight numbers are swizzled so that those of a column lie in
// different memory banks.
template <int N>
struct alignas(1024) Matrix {
    uint4 chunks[2][N][8];

    __device__ uint4& at(int row, int chunk) { return chunks[chunk / 8][row][(chunk ^ row) & 7]; }
    __device__ const uint4& at(int row, int chunk) const {
        return chunks[chunk / 8][row][(chunk ^ row) & 7];
    }
};

// Descriptor of a part of a `Matrix` for the tensor cores, with the bytes from 64 columns to the next,
// if columns are contiguous for the product, and from eight rows to the next.
__device__ __forceinline__ unsigned long long describe(const void* part, int columns) {
    const unsigned long long address = (u32)__cvta_generic_to_shared(part), swizzle_128_bytes = 1;
    return address >> 4 | (unsigned long long)(columns >> 4) << 16 | 1024ull >> 4 << 32 |
           swizzle_128_bytes << 62;
}
