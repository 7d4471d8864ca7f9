// Packs weights for the tensor cores: bf16, or sums of two f16 (tile.cuh), in the order in which lanes
// read them. `Pack` is defined in weights.rs.

// Column of a tile that is element i of the pair of lane t in matrix j (tile.cuh).
__device__ int tile_column(int j, int t, int i) { return 32 * (j / 4) + 8 * t + 2 * (j % 4) + i; }

__device__ float element_of(const float* all, const Pack& p, int row, int column) {
    int r = p.transposed ? column : row, c = p.transposed ? row : column;
    return r < p.rows && c < p.columns ? all[p.from + r * p.stride + c] : 0.f;
}

// Word `n` of 16 bytes of a packed matrix: eight rows of a column. Of each step of 16 rows there are
// 16 x 2 matrices of 8 columns and 8 rows, one after the other (ptx.cuh, `describe`).
__device__ uint4 word(const float* all, const Pack& p, int part, int n) {
    const int step = n / STEP, j = n % STEP / 16, half = n % 16 / 8, c = n % 8;
    const int column = tile_column(j, c / 2, c % 2);
    u32 pairs[4];
    for (int t = 0; t < 4; t++) {
        float v[2];
        for (int i = 0; i < 2; i++) {
            int row = p.features ? 16 * step + 8 * half + 2 * t + i
                                 : tile_column(2 * step + half, t, i);
            v[i] = element_of(all, p, row, column);
        }
        u32 both[2];
        if (p.parts == 1) both[0] = pack(v[0], v[1]);
        else split_f16(WEIGHT_SCALE * v[0], WEIGHT_SCALE * v[1], both);
        pairs[t] = both[part];
    }
    return make_uint4(pairs[0], pairs[1], pairs[2], pairs[3]);
}

// Eight columns of a row.
__device__ uint4 plain_columns(const float* all, const Pack& p, int row, int column) {
    u32 word[4];
    for (int k = 0; k < 4; k++)
        word[k] = pack(element_of(all, p, row, column + 2 * k), element_of(all, p, row, column + 2 * k + 1));
    return make_uint4(word[0], word[1], word[2], word[3]);
}

// Blocks (x, y) share matrix x.
extern "C" __global__ void pack_weights(const Pack* packs, const float* all, uint4* packed) {
    const Pack p = packs[blockIdx.x];
    const int size = p.steps * STEP;
    const int step = gridDim.y * blockDim.x;
    for (int n = blockIdx.y * blockDim.x + threadIdx.x; n < p.parts * size; n += step)
        packed[p.to + n] = p.plain ? plain_columns(all, p, n / 16, n % 16 * 8)
                                   : word(all, p, n / size, n % size);
}
