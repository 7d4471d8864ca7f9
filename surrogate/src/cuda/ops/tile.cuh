// The tile of a warp: 16 rows of 128 columns in registers.
//
// The columns of a tile are numbered so that the product of one linear is the operand of the next
// without any exchange between lanes, and so that a lane's columns are contiguous in memory: with
// g = lane / 4 and t = lane % 4 a lane has rows g and g + 8, and element i of the pair of the
// tensor cores' matrix j (of 16) is column 32 (j / 4) + 8 t + 2 (j % 4) + i. Weights are packed
// accordingly (weights.cu).
//
// PARTS = 1: operands are bf16, and so is what is stored. PARTS = 2: operands are sums of two f16
// (22 bits of mantissa), of which all but the smallest products are taken, and float is stored. f16
// has a small range: rows are divided by a power of two that is about their largest number, and
// weights are packed 64 times too large. Sums are f32 in both.

constexpr int WIDTH = 128;
// Words of 16 bytes of a packed matrix of 128 x 128 two-byte numbers.
constexpr int UNIT = 2048;
// The same of 16 rows of it.
constexpr int STEP = UNIT / 8;
constexpr u32 ALL = 0xffffffffu;
// Index of a row that does not exist.
constexpr u32 NONE = 0xffffffffu;
// Warps that go through their tiles together, since `wgmma` multiplies those of four at once.
constexpr u32 TEAM = 4;

#if PARTS == 1
typedef unsigned short Stored;
#else
typedef float Stored;
#endif

// What a loss is relative to, made finite where nothing accelerates.
__device__ __forceinline__ float not_zero(float scale) { return fmaxf(scale, 1e-12f); }

typedef float Tile[16][4];

struct Operand {
    u32 part[PARTS][8][4];
#if PARTS == 2
    // Of the two rows.
    float scale[2];
#endif
};

constexpr float WEIGHT_SCALE = 64.f;

__device__ __forceinline__ float low(u32 both) { return __uint_as_float(both << 16); }
__device__ __forceinline__ float high(u32 both) { return __uint_as_float(both & 0xffff0000u); }

// Two numbers as the sum of two pairs of f16.
__device__ __forceinline__ void split_f16(float a, float b, u32 (&part)[2]) {
    float x, y;
    part[0] = pack_f16(a, b);
    unpack_f16(part[0], x, y);
    part[1] = pack_f16(a - x, b - y);
}

// Eight numbers, as they are stored.
__device__ __forceinline__ void unpack8(const uint4 (&u)[1], float (&v)[8]) {
    u32 word[4] = {u[0].x, u[0].y, u[0].z, u[0].w};
#pragma unroll
    for (int k = 0; k < 4; k++) {
        v[2 * k] = low(word[k]);
        v[2 * k + 1] = high(word[k]);
    }
}

__device__ __forceinline__ void unpack8(const uint4 (&u)[2], float (&v)[8]) {
    u32 word[8] = {u[0].x, u[0].y, u[0].z, u[0].w, u[1].x, u[1].y, u[1].z, u[1].w};
#pragma unroll
    for (int k = 0; k < 8; k++) v[k] = __uint_as_float(word[k]);
}

// Eight consecutive numbers.
template <class Number>
__device__ __forceinline__ void load8(const Number* from, float (&v)[8]) {
    uint4 u[sizeof(Number) / 2];
#pragma unroll
    for (int k = 0; k < sizeof(Number) / 2; k++) u[k] = ((const uint4*)from)[k];
    unpack8(u, v);
}

__device__ __forceinline__ void store8(unsigned short* to, const float (&v)[8]) {
    *(uint4*)to = make_uint4(pack(v[0], v[1]), pack(v[2], v[3]), pack(v[4], v[5]), pack(v[6], v[7]));
}

__device__ __forceinline__ void store8(float* to, const float (&v)[8]) {
    *(float4*)to = make_float4(v[0], v[1], v[2], v[3]);
    *(float4*)(to + 4) = make_float4(v[4], v[5], v[6], v[7]);
}

// The eight columns of chunk q of a lane in one of its two rows: columns 32 q + 8 t and following.
__device__ __forceinline__ void chunk(const Tile& z, int q, int half, float (&v)[8]) {
#pragma unroll
    for (int k = 0; k < 8; k++) v[k] = z[4 * q + k / 2][2 * half + k % 2];
}

__device__ __forceinline__ void add_chunk(Tile& z, int q, int half, const float (&v)[8]) {
#pragma unroll
    for (int k = 0; k < 8; k++) z[4 * q + k / 2][2 * half + k % 2] += v[k];
}

// The tiles of a warp: teams of warps take TEAM tiles at a time, the teams of all blocks in turn. Those
// beyond the last have no rows; a team that has only such goes on if TOGETHER, as long as the first of
// its block has rows.
template <bool TOGETHER>
struct Tiles {
    u32 index, first, end;

    __device__ explicit Tiles(u32 rows) : first(blockIdx.x), end((rows + 16 * TEAM - 1) / (16 * TEAM)) {}

    // Of all blocks.
    __device__ static u32 teams() { return blockDim.x / (32 * TEAM) * gridDim.x; }

    // How often the block goes on.
    __device__ u32 rounds() const { return first < end ? (end - first + teams() - 1) / teams() : 0; }

    // Goes on to the next tile, if there is one.
    __device__ bool next() {
        const u32 warp = threadIdx.x / 32, team = first + warp / TEAM * gridDim.x;
        index = TEAM * team + warp % TEAM;
        const bool more = (TOGETHER ? first : team) < end;
        first += teams();
        return more;
    }
};

// Position of a lane in a tile, and which of its two rows exist.
struct Place {
    int g, t;
    u32 row[2];
    bool live[2];

    Place() = default;

    __device__ Place(u32 tile, u32 rows) {
        int lane = threadIdx.x % 32;
        g = lane / 4, t = lane % 4;
        row[0] = 16 * tile + g, row[1] = row[0] + 8;
        live[0] = row[0] < rows, live[1] = row[1] < rows;
    }

    __device__ int column(int q) const { return 32 * q + 8 * t; }

    // The rows that exist.
    __device__ void rows(u32 (&own)[2]) const {
        own[0] = live[0] ? row[0] : NONE, own[1] = live[1] ? row[1] : NONE;
    }
};

// Every row the same 128 numbers of shared memory.
__device__ __forceinline__ void fill(Tile& z, const float* vector, int t) {
#pragma unroll
    for (int q = 0; q < 4; q++) {
        float v[8];
        load8(vector + 32 * q + 8 * t, v);
#pragma unroll
        for (int k = 0; k < 8; k++) z[4 * q + k / 2][k % 2] = z[4 * q + k / 2][2 + k % 2] = v[k];
    }
}

__device__ __forceinline__ void clear(Tile& z) {
#pragma unroll
    for (int j = 0; j < 16; j++)
#pragma unroll
        for (int k = 0; k < 4; k++) z[j][k] = 0.f;
}

// A lane's columns of two rows of a matrix, as they are stored; zeros for a row that is NONE. Without
// branches all loads are under way before the first value is needed.
template <class Number>
struct Rows {
    uint4 word[2][4][sizeof(Number) / 2];

    __device__ __forceinline__ Rows(const Number* from, const u32 (&row)[2], int t) {
#pragma unroll
        for (int half = 0; half < 2; half++) {
            const bool live = row[half] != NONE;
            const uint4* start = (const uint4*)(from + (size_t)(live ? row[half] : 0) * WIDTH + 8 * t);
#pragma unroll
            for (int q = 0; q < 4; q++)
#pragma unroll
                for (int k = 0; k < sizeof(Number) / 2; k++) {
                    uint4 u = start[q * 4 * (sizeof(Number) / 2) + k];
                    word[half][q][k] = live ? u : make_uint4(0, 0, 0, 0);
                }
        }
    }

    // Chunk q of a row.
    __device__ __forceinline__ void numbers(int half, int q, float (&v)[8]) const {
        unpack8(word[half][q], v);
    }
};

template <class Number>
__device__ __forceinline__ void add_rows(Tile& z, const Number* from, const u32 (&row)[2], int t) {
    const Rows<Number> rows(from, row, t);
#pragma unroll
    for (int half = 0; half < 2; half++)
#pragma unroll
        for (int q = 0; q < 4; q++) {
            float v[8];
            rows.numbers(half, q, v);
            add_chunk(z, q, half, v);
        }
}

template <class Number>
__device__ __forceinline__ void store_rows(const Tile& z, Number* to, const Place& at) {
#pragma unroll
    for (int half = 0; half < 2; half++) {
        if (!at.live[half]) continue;
        Number* start = to + (size_t)at.row[half] * WIDTH + 8 * at.t;
#pragma unroll
        for (int q = 0; q < 4; q++) {
            float v[8];
            chunk(z, q, half, v);
            store8(start + 32 * q, v);
        }
    }
}

// Register of the tensor cores' first operand for the pair r of chunk q.
__device__ __forceinline__ u32& element(Operand& x, int part, int q, int r, int half) {
    return x.part[part][2 * q + r / 2][2 * (r % 2) + half];
}

__device__ __forceinline__ void to_operand(const float (&v)[8], Operand& x, int q, int half) {
#pragma unroll
    for (int r = 0; r < 4; r++) {
#if PARTS == 1
        element(x, 0, q, r, half) = pack(v[2 * r], v[2 * r + 1]);
#else
        u32 part[2];
        const float inverse = 1.f / x.scale[half];
        split_f16(inverse * v[2 * r], inverse * v[2 * r + 1], part);
        element(x, 0, q, r, half) = part[0], element(x, 1, q, r, half) = part[1];
#endif
    }
}

// Power of two between half the largest number of a row and itself, given the largest of a lane.
__device__ __forceinline__ float power_of_two(float largest) {
    largest = fmaxf(largest, __shfl_xor_sync(ALL, largest, 1));
    largest = fmaxf(largest, __shfl_xor_sync(ALL, largest, 2));
    // For rows of tiny numbers any power will do.
    return largest > 1e-30f ? __uint_as_float(__float_as_uint(largest) & 0x7f800000u) : 1.f;
}

__device__ __forceinline__ void to_operand(const Tile& z, Operand& x) {
#if PARTS == 2
#pragma unroll
    for (int half = 0; half < 2; half++) {
        float largest = 0.f;
#pragma unroll
        for (int j = 0; j < 16; j++)
            largest = fmaxf(largest, fmaxf(fabsf(z[j][2 * half]), fabsf(z[j][2 * half + 1])));
        x.scale[half] = power_of_two(largest);
    }
#endif
#pragma unroll
    for (int q = 0; q < 4; q++)
#pragma unroll
        for (int half = 0; half < 2; half++) {
            float v[8];
            chunk(z, q, half, v);
            to_operand(v, x, q, half);
        }
}

// Rows of a matrix as an operand, scaled and shifted column by column if `scale` (and after it, 128
// numbers on, the shift) is not null.
__device__ __forceinline__ void load_operand(
    Operand& x, const Stored* from, const u32 (&row)[2], const float* scale, int t) {
    const Rows<Stored> rows(from, row, t);
#if PARTS == 1
    // As it is stored it can be multiplied.
    if (!scale) {
#pragma unroll
        for (int half = 0; half < 2; half++)
#pragma unroll
            for (int q = 0; q < 4; q++) {
                const uint4 u = rows.word[half][q][0];
                element(x, 0, q, 0, half) = u.x, element(x, 0, q, 1, half) = u.y;
                element(x, 0, q, 2, half) = u.z, element(x, 0, q, 3, half) = u.w;
            }
        return;
    }
#else
    Tile z;
#endif
#pragma unroll
    for (int half = 0; half < 2; half++)
#pragma unroll
        for (int q = 0; q < 4; q++) {
            float v[8];
            rows.numbers(half, q, v);
            if (scale) {
                float s[8], b[8];
                load8(scale + 32 * q + 8 * t, s);
                load8(scale + WIDTH + 32 * q + 8 * t, b);
#pragma unroll
                for (int k = 0; k < 8; k++) v[k] = s[k] * v[k] + b[k];
            }
#if PARTS == 1
            to_operand(v, x, q, half);
#else
#pragma unroll
            for (int k = 0; k < 8; k++) z[4 * q + k / 2][2 * half + k % 2] = v[k];
#endif
        }
#if PARTS == 2
    to_operand(z, x);
#endif
}

__device__ __forceinline__ void scale_rows(Tile& z, float first, float second) {
#pragma unroll
    for (int j = 0; j < 16; j++) z[j][0] *= first, z[j][1] *= first, z[j][2] *= second, z[j][3] *= second;
}

// z += x W with packed weights in shared memory.
__device__ __forceinline__ void multiply(Tile& z, const Operand& x, const uint4* weights) {
#if PARTS == 2
    scale_rows(z, WEIGHT_SCALE / x.scale[0], WEIGHT_SCALE / x.scale[1]);
#endif
    begin_products();
#pragma unroll
    for (int k = 0; k < 8; k++) {
        const uint4* w = weights + k * STEP;
#if PARTS == 1
        add_product<false>(z, x.part[0][k], w);
#else
        add_product<true>(z, x.part[0][k], w + UNIT);
        add_product<true>(z, x.part[1][k], w);
        add_product<true>(z, x.part[0][k], w);
#endif
    }
    end_products();
#if PARTS == 2
    scale_rows(z, x.scale[0] / WEIGHT_SCALE, x.scale[1] / WEIGHT_SCALE);
#endif
}

// LeakyReLU, with a slope of at most 1.
__device__ __forceinline__ float leaky(float x, float slope) { return fmaxf(x, slope * x); }

// Sum over the four lanes that share rows.
__device__ __forceinline__ float row_sum(float x) {
    x += __shfl_xor_sync(ALL, x, 1);
    return x + __shfl_xor_sync(ALL, x, 2);
}

// Packed weights in shared memory, all of an MLP.
struct Resident {
    static constexpr bool TOGETHER = false;
    const uint4* buffer;
    int cursor;

    // Begins to copy; `wait` before the first use.
    __device__ Resident(const uint4* source, uint4* buffer, int all) : buffer(buffer) {
        for (int k = threadIdx.x; k < all; k += blockDim.x) copy_async(&buffer[k], &source[k], true);
        end_copies();
    }

    __device__ void wait() {
        wait_for_copies<0>();
        show_to_products();
        __syncthreads();
    }

    __device__ void begin_tile() { cursor = 0; }

    // The next matrix, `size` words of 16 bytes long.
    __device__ const uint4* next(int size) { return buffer + (cursor += size) - size; }
};

// A matrix of an MLP's packed weights: `size` words of 16 bytes.
struct Matrix16 {
    const uint4* from;
    int size;
};

// Packed weights of an MLP, streamed through shared memory once for each tile. A ring of RING matrices
// is there; they are copied while those before them are used. `matrix_of(mlp, n)` is matrix n of an MLP, of
// size 0 after the last.
template <class Mlp>
struct Stream {
    static constexpr bool TOGETHER = true;
    static constexpr int SLOT = PARTS * UNIT;
    const Mlp& mlp;
    uint4* ring;
    // The next matrix to copy, and the tiles that still need matrices.
    int matrix = 0;
    u32 tiles;
    // Places in the ring of the next matrix to copy and of the next to use.
    int coming = 0, using_ = 0;

    // Begins to copy. All threads of the block have to ask for each matrix.
    __device__ Stream(const Mlp& mlp, uint4* ring, u32 tiles) : mlp(mlp), ring(ring), tiles(tiles) {
        for (int k = 1; k < RING; k++) fetch();
    }

    __device__ void fetch() {
        if (tiles > 0) {
            const Matrix16 part = matrix_of(mlp, matrix++);
            for (int k = threadIdx.x; k < part.size; k += blockDim.x)
                copy_async(&ring[coming * SLOT + k], &part.from[k], true);
            coming = coming + 1 < RING ? coming + 1 : 0;
            if (matrix_of(mlp, matrix).size == 0) matrix = 0, tiles--;
        }
        end_copies();
    }

    __device__ void begin_tile() {}

    // The next matrix.
    __device__ const uint4* next(int) {
        if (RING == 1) {
            __syncthreads();
            fetch();
        }
        wait_for_copies<(RING > 2 ? RING - 2 : 0)>();
        show_to_products();
        // All threads have copied their part of this matrix, and are done with the one before.
        __syncthreads();
        if (RING > 1) fetch();
        const uint4* place = ring + using_ * SLOT;
        using_ = using_ + 1 < RING ? using_ + 1 : 0;
        return place;
    }
};
