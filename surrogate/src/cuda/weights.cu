// Weights as the tensor cores want them: bf16, or sums of two f16 (tile.cuh), in the order in which
// lanes read them.

struct Pack {
    // Offset in the list of all weights of element (0, 0) of a row-major matrix, and its columns.
    int from, stride;
    // The part that is not padding.
    int rows, columns;
    // Packs the transposed matrix.
    int transposed;
    // Steps of 16 rows; 8 for a matrix of 128 x 128, fewer for features, whose rows are in their
    // natural order.
    int steps, features;
    // 1: bf16; 2: two f16 whose sum is the weight times WEIGHT_SCALE.
    int parts;
    // bf16, row after row as they are.
    int plain;
    // Place among the packed weights, in words of 16 bytes.
    int to;
};

// Column of a tile that is element i of the pair of lane t in matrix j (tile.cuh).
__device__ int tile_column(int j, int t, int i) { return 32 * (j / 4) + 8 * t + 2 * (j % 4) + i; }

__device__ float element_of(const float* all, const Pack& p, int row, int column) {
    int r = p.transposed ? column : row, c = p.transposed ? row : column;
    return r < p.rows && c < p.columns ? all[p.from + r * p.stride + c] : 0.f;
}

// The two registers that a lane gives the tensor cores for step k and matrix j.
__device__ void registers(const float* all, const Pack& p, int part, int k, int j, int lane,
                          u32 (&b)[2]) {
    int g = lane / 4, t = lane % 4, column = tile_column(j, g / 2, g % 2);
    for (int half = 0; half < 2; half++) {
        float v[2];
        for (int i = 0; i < 2; i++) {
            int row = p.features ? 16 * k + 8 * half + 2 * t + i : tile_column(2 * k + half, t, i);
            v[i] = element_of(all, p, row, column);
        }
        u32 both[2];
        if (p.parts == 1) both[0] = pack(v[0], v[1]);
        else split_f16(WEIGHT_SCALE * v[0], WEIGHT_SCALE * v[1], both);
        b[half] = both[part];
    }
}

// Eight columns of a row.
__device__ uint4 plain_columns(const float* all, const Pack& p, int row, int column) {
    u32 word[4];
    for (int k = 0; k < 4; k++)
        word[k] = pack(element_of(all, p, row, column + 2 * k), element_of(all, p, row, column + 2 * k + 1));
    return make_uint4(word[0], word[1], word[2], word[3]);
}

extern "C" __global__ void pack_weights(const Pack* packs, const float* all, uint4* packed) {
    const Pack p = packs[blockIdx.x];
    const int size = p.steps * 256;
    for (int n = threadIdx.x; n < p.parts * size; n += blockDim.x) {
        if (p.plain) {
            packed[p.to + n] = plain_columns(all, p, n / 16, n % 16 * 8);
            continue;
        }
        int part = n / size, k = n % size / 256, j = n % 256 / 32, lane = n % 32;
        u32 b[2], c[2];
        registers(all, p, part, k, 2 * j, lane, b);
        registers(all, p, part, k, 2 * j + 1, lane, c);
        packed[p.to + n] = make_uint4(b[0], b[1], c[0], c[1]);
    }
}
