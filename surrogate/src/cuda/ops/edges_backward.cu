// MLPs of edges, backward, in bf16 on Hopper: gradients of the weights and of the inputs. With X the input of
// a linear,
//
//     dW += X^T dZ,   dX = dZ W^T,   dZ of the linear before = dX where X > 0, else slope dX.
//
// A block takes its share of the rows, 64 at a time, through the linears in passes from the last to the
// first. A pass has two linears with hidden states, so that the dZ between them stays on the chip; the last
// pass has the states that the MLP itself reads. Two warp groups add up dW of one linear each, in registers.
// Two others, the walkers, take tiles in turn: they fetch them and compute LayerNorm's derivative and dX.
// `Backward` is defined in backward.rs; the kernel is compiled for PARTS == 1 and sm_90a only
// (edges_backward.rs).

constexpr int GROUP_THREADS = 128;
constexpr int WALKERS = 2;
constexpr int EDGE_THREADS = (2 + WALKERS) * GROUP_THREADS;
constexpr int ROWS = 64;
// Registers of a thread that adds up and of a walker: 128 on average.
constexpr int SUM_REGISTERS = 160, WALKER_REGISTERS = 96;
// Rows of a tile of which a thread copies eight columns, and how many of them it works on at a time.
constexpr int SHARE = ROWS * 16 / GROUP_THREADS;
constexpr int TOGETHER = SHARE / 2;
// Features of an edge, at most 7 in three dimensions (difference of velocities, direction, distance), and 1.
constexpr int EDGE_FEATURES = 8;

// A part of shared memory for a tile.
struct Stage {
    static constexpr bool WHOLE = true;
    // dZ and X of the pass's first linear, X of its second.
    Matrix<ROWS> dz, x[2];
    // Gradient of the MLP's output, then dZ of the second linear. dZ of the features' linear is where
    // that of the linear before the last was.
    Matrix<ROWS> output;
    // Row of `gathered` that is added to the gradient of the output.
    u32 node[ROWS];
    // LayerNorm's reciprocal standard deviation.
    float inverse[ROWS];
    float features[ROWS * EDGE_FEATURES];
};

// The same in the pass of the states that the MLP reads.
struct SmallStage {
    static constexpr bool WHOLE = false;
    Matrix<ROWS> dz, x[1];
    u32 node[ROWS];
};

struct Shared {
    // W of both linears, with rows in the order of `place_of`.
    Matrix<WIDTH> weights[2];
    // Those of a walker: every other one.
    union {
        Stage stages[WALKERS];
        SmallStage small[2 * WALKERS];
    };
    // LayerNorm's scale, and 1 / width.
    float scale[WIDTH], share;
};

static_assert(sizeof(Shared) <= EDGES_SHARED, "shared memory of a block");

// What a pass computes.
struct Pass {
    // The first linear's dZ or, if it is that before LayerNorm, what LayerNorm made.
    const Stored* dz;
    // Products for the gradients of the weights: of one or two linears, and of one that reads features
    // and has the dZ that the pass ends with.
    const Product *product[2], *features;
    // Destination of the gradient that the pass ends with, or null; whether X are hidden states.
    Stored* to;
    const uint4* weights;
    bool hidden;
    // Sums of dZ over runs of rows of the same node, if they are wanted.
    float* sums;
};

// Named barriers, one for each walker: dZ of the first linear, of the second or of the one that reads
// features is ready; the first dZ has been read; the tile is done; the walker's own threads.
enum Meeting { BLOCK, FIRST, FIRST_DONE = 3, SECOND = 5, FEATURES = 7, TILE_DONE = 9, WALKER = 11 };

__device__ __forceinline__ void meet(int where, int threads = 2 * GROUP_THREADS) {
    asm volatile("bar.sync %0, %1;" : : "r"(where), "r"(threads) : "memory");
}

// Arrives at a barrier without waiting.
__device__ __forceinline__ void announce(int where, int threads = 2 * GROUP_THREADS) {
    asm volatile("bar.arrive %0, %1;" : : "r"(where), "r"(threads) : "memory");
}

#define FOUR(j) "+f"(z[j][0]), "+f"(z[j][1]), "+f"(z[j][2]), "+f"(z[j][3])

// z += x^T y with 16 rows each of x, 64 columns, and y, 128 columns.
__device__ __forceinline__ void add_rows_product(float (&z)[16][4], unsigned long long x,
                                                 unsigned long long y) {
    asm volatile("{ .reg .pred yes; setp.eq.u32 yes, 0, 0; "
                 "wgmma.mma_async.sync.aligned.m64n128k16.f32.bf16.bf16 {"
                 "%0, %1, %2, %3, %4, %5, %6, %7, %8, %9, %10, %11, %12, %13, %14, %15, "
                 "%16, %17, %18, %19, %20, %21, %22, %23, %24, %25, %26, %27, %28, %29, %30, %31, "
                 "%32, %33, %34, %35, %36, %37, %38, %39, %40, %41, %42, %43, %44, %45, %46, %47, "
                 "%48, %49, %50, %51, %52, %53, %54, %55, %56, %57, %58, %59, %60, %61, %62, %63}, "
                 "%64, %65, yes, 1, 1, 1, 1; }"
                 : FOUR(0), FOUR(1), FOUR(2), FOUR(3), FOUR(4), FOUR(5), FOUR(6), FOUR(7), FOUR(8),
                   FOUR(9), FOUR(10), FOUR(11), FOUR(12), FOUR(13), FOUR(14), FOUR(15)
                 : "l"(x), "l"(y));
}

// z += x y^T with 16 columns each of x and y, 64 rows.
__device__ __forceinline__ void add_columns_product(float (&z)[8][4], unsigned long long x,
                                                    unsigned long long y) {
    asm volatile("{ .reg .pred yes; setp.eq.u32 yes, 0, 0; "
                 "wgmma.mma_async.sync.aligned.m64n64k16.f32.bf16.bf16 {"
                 "%0, %1, %2, %3, %4, %5, %6, %7, %8, %9, %10, %11, %12, %13, %14, %15, "
                 "%16, %17, %18, %19, %20, %21, %22, %23, %24, %25, %26, %27, %28, %29, %30, %31}, "
                 "%32, %33, yes, 1, 1, 0, 0; }"
                 : FOUR(0), FOUR(1), FOUR(2), FOUR(3), FOUR(4), FOUR(5), FOUR(6), FOUR(7)
                 : "l"(x), "l"(y));
}
#undef FOUR

// Where a row of W is in shared memory, so that neighbours there are columns of dX that a lane has
// next to each other (tile_column of weights.cu).
__device__ int place_of(int row) {
    return (row & 96) | (row >> 1 & 3) << 3 | (row >> 3 & 3) << 1 | (row & 1);
}

// The rows of a tile of which this thread copies eight columns.
struct Mine {
    int chunk = threadIdx.x % 16;

    __device__ int local(int n) const {
        return threadIdx.x % GROUP_THREADS / 16 + GROUP_THREADS / 16 * n;
    }
};

// Begins to copy a tile of rows.
__device__ __forceinline__ void fetch(Matrix<ROWS>& to, const Stored* from, u32 tile, u32 rows) {
    const Mine mine;
    const u32 first = tile * ROWS + mine.local(0);
    const Stored* start = from + (size_t)first * WIDTH + 8 * mine.chunk;
    if ((tile + 1) * ROWS <= rows) {
#pragma unroll
        for (int n = 0; n < SHARE; n++)
            copy_async(&to.at(mine.local(0), mine.chunk) + n * (sizeof to.chunks[0] / SHARE / 16),
                       start + n * (ROWS / SHARE) * WIDTH, true);
    } else {
#pragma unroll 1
        for (int n = 0; n < SHARE; n++) {
            const bool there = first + n * (ROWS / SHARE) < rows;
            copy_async(&to.at(mine.local(n), mine.chunk),
                       there ? start + n * (ROWS / SHARE) * WIDTH : from, there);
        }
    }
}

// The same if row k of the tile is row `source(k)`, zeros if that is NONE.
template <class Source>
__device__ __forceinline__ void gather(Matrix<ROWS>& to, const Stored* from, u32 tile, Source source) {
    const Mine mine;
#pragma unroll 2
    for (int n = 0; n < SHARE; n++) {
        const u32 row = source(tile * ROWS + mine.local(n));
        const bool there = row != NONE;
        copy_async(&to.at(mine.local(n), mine.chunk),
                   from + (there ? (size_t)row * WIDTH + 8 * mine.chunk : 0), there);
    }
}

// dy -> dz = (dx - mean(dx) - x mean(dx x)) / deviation with dx = scale dy, for y = scale x + shift
// and x = (z - mean(z)) / deviation, of the parts of rows that this thread has copied; x is where dz
// shall be. Of the tile's rows as many as `rows` exist. Adds dy x and dy to `sums`.
__device__ __forceinline__ void normalise_backward(Stage& stage, const Backward& a,
                                                   const Shared& shared, u32 rows, float (&sums)[2][8]) {
    const Mine mine;
    float s[8];
    load8(shared.scale + 8 * mine.chunk, s);
#pragma unroll 1
    for (int first = 0; first < SHARE; first += TOGETHER) {
        float dy[TOGETHER][8] = {};
        if (a.gathered)
#pragma unroll
            for (u32 n = 0; n < TOGETHER; n++) {
                const u32 local = mine.local(first + n);
                load8(a.gathered + (size_t)stage.node[local] * WIDTH + 8 * mine.chunk, dy[n]);
#pragma unroll
                for (int k = 0; k < 8; k++) dy[n][k] = local < rows ? dy[n][k] : 0.f;
            }
#pragma unroll
        for (int n = 0; n < TOGETHER; n++) {
            const int local = mine.local(first + n);
            Stored* place = (Stored*)&stage.dz.at(local, mine.chunk);
            float x[8], mean = 0.f, product = 0.f;
            load8(place, x);
            if (a.output) {
                float more[8];
                load8((const Stored*)&stage.output.at(local, mine.chunk), more);
#pragma unroll
                for (int k = 0; k < 8; k++) dy[n][k] += more[k];
            }
#pragma unroll
            for (int k = 0; k < 8; k++) {
                sums[0][k] += dy[n][k] * x[k];
                sums[1][k] += dy[n][k];
                dy[n][k] *= s[k];
                mean += dy[n][k];
                product += dy[n][k] * x[k];
            }
            // A row is sixteen lanes'.
#pragma unroll
            for (int bit = 1; bit < 16; bit *= 2) {
                mean += __shfl_xor_sync(ALL, mean, bit);
                product += __shfl_xor_sync(ALL, product, bit);
            }
            mean *= shared.share, product *= shared.share;
#pragma unroll
            for (int k = 0; k < 8; k++)
                dy[n][k] = stage.inverse[local] * (dy[n][k] - mean - x[k] * product);
            store8(place, dy[n]);
        }
    }
}

// Destination of dX, which is multiplied by the derivative of LeakyReLU at X (`hidden`) or added to what
// is there (`accumulate`), then written to shared and to global memory, if not null.
struct Destination {
    Matrix<ROWS>* tile;
    Stored* memory;
    const Matrix<ROWS>& x;
    bool hidden, accumulate;
    float slope;
};

// dX = dZ W^T of a tile, half of the columns after the other.
__device__ __forceinline__ void input_gradient(const Matrix<ROWS>& dz, const Matrix<WIDTH>& weights,
                                               const Destination& to, u32 tile, u32 rows) {
    const int lane = threadIdx.x % 32, g = lane / 4, t = lane % 4;
#pragma unroll 1
    for (int side = 0; side < 2; side++) {
        float z[8][4] = {};
        begin_products();
#pragma unroll
        for (int k = 0; k < 8; k++)
            add_columns_product(z, describe((const char*)dz.chunks[k / 4] + k % 4 * 32, 0),
                                describe((const char*)weights.chunks[k / 4][64 * side] + k % 4 * 32, 0));
        end_products();
#pragma unroll
        for (int half = 0; half < 2; half++) {
            const int local = threadIdx.x % GROUP_THREADS / 32 * 16 + 8 * half + g;
            const u32 row = tile * ROWS + local;
#pragma unroll
            for (int q = 0; q < 2; q++) {
                const int chunk = 4 * (2 * side + q) + t;
                Stored* place = to.memory + (size_t)row * WIDTH + 8 * chunk;
                float v[8], other[8];
#pragma unroll
                for (int k = 0; k < 8; k++) v[k] = z[4 * q + k / 2][2 * half + k % 2];
                if (to.hidden) {
                    load8((const Stored*)&to.x.at(local, chunk), other);
#pragma unroll
                    for (int k = 0; k < 8; k++)
                        if (!(other[k] > 0.f)) v[k] *= to.slope;
                } else if (to.accumulate && row < rows) {
                    load8(place, other);
#pragma unroll
                    for (int k = 0; k < 8; k++) v[k] += other[k];
                }
                if (to.tile) store8((Stored*)&to.tile->at(local, chunk), v);
                if (to.memory && row < rows) store8(place, v);
            }
        }
    }
}

// The stages of a pass; the first half of them is used by the walkers in turn, then the second.
__device__ __forceinline__ auto& stages_of(Shared& shared, Stage*) { return shared.stages; }
__device__ __forceinline__ auto& stages_of(Shared& shared, SmallStage*) { return shared.small; }

// Takes every other tile of the block through a pass. LAST: its first linear is that before LayerNorm.
template <bool LAST, class Kind>
__device__ __forceinline__ void walk(Shared& shared, const Backward& a, const Pass& pass,
                                     float (&norm_sums)[2][8]) {
    auto& stages = stages_of(shared, (Kind*)nullptr);
    constexpr int STAGES = sizeof stages / sizeof(Kind);
    const u32 rows = *a.count, tiles = (rows + ROWS - 1) / ROWS, step = WALKERS * a.blocks;
    const int walker = threadIdx.x / GROUP_THREADS % WALKERS, local = threadIdx.x % GROUP_THREADS;
    const bool two = Kind::WHOLE && pass.product[1];
    // Whether the tile is read after its first dZ.
    const bool late = two || pass.features || pass.sums;
    const Stored* x[2] = {pass.product[0]->x, two ? pass.product[1]->x : nullptr};
    const u32* x_index = pass.product[0]->index;
    const float* features = pass.features ? pass.features->features : nullptr;
    const u32 feature_count = pass.features ? pass.features->feature_count : 0;

    auto fetch_x = [&](Kind& stage, u32 tile) {
        if (tile >= tiles) return;
        if (x_index)
            gather(stage.x[0], x[0], tile, [&](u32 row) { return row < rows ? x_index[row] : NONE; });
        else
            fetch(stage.x[0], x[0], tile, rows);
    };
    auto fetch_rest = [&](Kind& stage, u32 tile) {
        if (tile >= tiles) return;
        fetch(stage.dz, pass.dz, tile, rows);
        const u32 own = tile * ROWS + local;
        const bool there = own < rows;
        if ((LAST || pass.sums) && a.gathered && local < ROWS)
            copy_async((float*)&stage.node[local],
                       (const float*)a.gathered_index + (there ? own : 0), there);
        if constexpr (LAST) {
            if (local < ROWS)
                copy_async(&stage.inverse[local], a.deviation + (there ? own : 0), there);
            if (a.output && (a.selection || a.output_index))
                gather(stage.output, a.output, tile, [&](u32 row) {
                    if (row >= rows) return NONE;
                    if (a.selection && (a.selection[row] == NONE) != (a.select_none != 0)) return NONE;
                    return a.output_index ? a.output_index[row] : row;
                });
            else if (a.output)
                fetch(stage.output, a.output, tile, rows);
        }
        if constexpr (Kind::WHOLE) {
            if (features) {
                const u32 first = tile * ROWS * feature_count, end = rows * feature_count;
                for (u32 n = local; n < ROWS * feature_count; n += GROUP_THREADS) {
                    const bool there = first + n < end;
                    copy_async(&stage.features[n], features + (there ? first + n : 0), there);
                }
            }
            if (two) fetch(stage.x[1], x[1], tile, rows);
        }
    };
    u32 tile = blockIdx.x + walker * a.blocks;
#pragma unroll
    for (int s = 0; s < STAGES / WALKERS; s++) {
        Kind& stage = stages[walker + s * WALKERS];
        fetch_x(stage, tile + s * step);
        fetch_rest(stage, tile + s * step);
        end_copies();
    }
    // The weights have been copied.
    barrier();
    for (int current = walker; tile < tiles; tile += step, current = (current + WALKERS) % STAGES) {
        Kind& stage = stages[current];
        const u32 next = tile + step * (STAGES / WALKERS);
        wait_for_copies<STAGES / WALKERS - 1>();
        if constexpr (LAST) {
            // A thread reads what other threads have copied.
            meet(WALKER + walker, GROUP_THREADS);
            normalise_backward(stage, a, shared, rows - tile * ROWS, norm_sums);
        }
        show_to_products();
        announce(FIRST + walker);
        if (pass.sums) announce(SECOND + walker);
        meet(WALKER + walker, GROUP_THREADS);
        const Matrix<ROWS>* dz = &stage.dz;
        if constexpr (Kind::WHOLE)
            if (two) {
                input_gradient(stage.dz, shared.weights[0],
                               {&stage.output, nullptr, stage.x[0], true, false, a.slope}, tile, rows);
                show_to_products();
                announce(SECOND + walker);
                dz = &stage.output;
            }
        // Also for the threads of the walker.
        meet(FIRST_DONE + walker);
        if (two) fetch_x(stage, next);
        Matrix<ROWS>* features_dz = nullptr;
        if constexpr (Kind::WHOLE)
            if (features) features_dz = two ? &stage.dz : &stage.output;
        input_gradient(*dz, shared.weights[two],
                       {features_dz, pass.to, stage.x[two], pass.hidden, bool(a.accumulate & 1), a.slope},
                       tile, rows);
        if (features) announce(FEATURES + walker);
        // The stage is free once all are done with it.
        if (late) meet(TILE_DONE + walker);
        else meet(WALKER + walker, GROUP_THREADS);
        if (!two) fetch_x(stage, next);
        fetch_rest(stage, next);
        end_copies();
    }
}

// dZ^T Y of a tile after the other, for Y with eight columns; a warp has 32 columns of dZ.
struct ThinSums {
    // Of each 16 of them columns g and g + 8, each with columns 2t and 2t + 1 of Y.
    float sum[2][4] = {};

    // `y(k, b)` gives rows 16 k + 2t, 16 k + 2t + 8 and those below of column g of Y.
    template <class Y>
    __device__ __forceinline__ void add(const Matrix<ROWS>& dz, Y y) {
        const int lane = threadIdx.x % 32, row = lane / 16 * 8 + lane % 8;
        const int chunk = threadIdx.x % GROUP_THREADS / 32 * 4 + lane / 8 % 2;
        // Sixteen rows on, the place in a row is the same.
        const uint4* const left[2] = {&dz.at(row, chunk), &dz.at(row, chunk + 2)};
        constexpr int ROW = sizeof dz.chunks[0][0] / sizeof(uint4);
#pragma unroll
        for (int k = 0; k < ROWS / 16; k++) {
            u32 b[2];
            y(k, b);
#pragma unroll
            for (int m = 0; m < 2; m++) {
                u32 a[4];
                load_transposed(a, left[m] + 16 * ROW * k);
                multiply_add(sum[m], a, b[0], b[1]);
            }
        }
    }

    // Sums of the columns of dZ: Y is 1.
    __device__ __forceinline__ void add_columns(const Matrix<ROWS>& dz) {
        const u32 one = pack(1.f, 1.f);
        add(dz, [&](int, u32(&b)[2]) { b[0] = b[1] = one; });
    }

    // With features for Y, and 1 for its last column.
    __device__ __forceinline__ void add_features(const Matrix<ROWS>& dz, const float* features,
                                                 int count) {
        const int lane = threadIdx.x % 32, g = lane / 4, t = lane % 4;
        const float other = g == EDGE_FEATURES - 1 ? 1.f : 0.f;
        const float* from = features + 2 * t * count + g;
        add(dz, [&](int, u32(&b)[2]) {
#pragma unroll
            for (int half = 0; half < 2; half++, from += 8 * count)
                b[half] = pack(g < count ? from[0] : other, g < count ? from[count] : other);
        });
    }

    // Calls `to(column of dZ, column of Y)` for the place of each of the lane's sums.
    template <class To>
    __device__ __forceinline__ void write(To to) const {
        const int lane = threadIdx.x % 32, g = lane / 4, t = lane % 4;
        const int first = threadIdx.x % GROUP_THREADS / 32 * 32 + g;
#pragma unroll
        for (int m = 0; m < 2; m++)
#pragma unroll
            for (int k = 0; k < 4; k++)
                if (float* place = to(first + 16 * m + k / 2 * 8, 2 * t + k % 2)) *place = sum[m][k];
    }
};

// Adds up the rows of dZ that have the same node, in a warp's part of a tile: the sum of node v in part
// k is row k + v (as in forward.cu).
__device__ __forceinline__ void sum_runs(Shared& shared, const Backward& a, float* sums) {
    constexpr int PART = 16, STAGES = sizeof shared.small / sizeof(SmallStage);
    const u32 rows = *a.count, tiles = (rows + ROWS - 1) / ROWS;
    const int lane = threadIdx.x % 32, first = threadIdx.x % GROUP_THREADS / 32 * PART;
    int current = 0;
    for (u32 tile = blockIdx.x; tile < tiles; tile += a.blocks, current = (current + 1) % STAGES) {
        const SmallStage& stage = shared.small[current];
        meet(SECOND + current % WALKERS);
        const u32 part = (tile * ROWS + first) / PART;
        const int end = min(rows - min(rows, part * PART), PART);
        float sum[4] = {};
        for (int k = 0; k < end; k++) {
            const int row = first + k;
            const uint2 both = ((const uint2*)&stage.dz.at(row, lane / 2))[lane % 2];
            sum[0] += low(both.x), sum[1] += high(both.x);
            sum[2] += low(both.y), sum[3] += high(both.y);
            const u32 node = stage.node[row];
            if (k + 1 == end || stage.node[row + 1] != node) {
                float4* to = (float4*)(sums + (size_t)(part + node) * WIDTH + 4 * lane);
                *to = make_float4(sum[0], sum[1], sum[2], sum[3]);
                sum[0] = sum[1] = sum[2] = sum[3] = 0.f;
            }
        }
        announce(TILE_DONE + current % WALKERS);
    }
}

// dW of linear number SUMMED of a pass, of a block's rows; that of the last one's group has the
// features' too.
template <int SUMMED, class Kind>
__device__ __forceinline__ void add_up(Shared& shared, const Backward& a, const Pass& pass) {
    // W, for the walkers.
    for (int k = 0; k < 2; k++)
        if (pass.product[k])
            for (int n = threadIdx.x; n < UNIT; n += 2 * GROUP_THREADS)
                copy_async(&shared.weights[k].at(place_of(n / 16), n % 16),
                           &pass.weights[k * UNIT + n], true);
    end_copies();
    wait_for_copies<0>();
    show_to_products();
    barrier();

    if constexpr (SUMMED == 1 && !Kind::WHOLE) {
        if (pass.sums) sum_runs(shared, a, pass.sums);
        return;
    }
    const Product* product = pass.product[SUMMED];
    const Product* features = pass.product[1 - SUMMED] && SUMMED == 0 ? nullptr : pass.features;
    if (!product) return;
    auto& stages = stages_of(shared, (Kind*)nullptr);
    constexpr int STAGES = sizeof stages / sizeof(Kind);
    const u32 rows = *a.count, tiles = (rows + ROWS - 1) / ROWS;
    float weight[2][16][4] = {};
    ThinSums bias, feature_sums;
    int current = 0;
    for (u32 tile = blockIdx.x; tile < tiles; tile += a.blocks, current = (current + 1) % STAGES) {
        const Kind& stage = stages[current];
        const int walker = current % WALKERS;
        const Matrix<ROWS>* dz = &stage.dz;
        if constexpr (SUMMED == 1 && Kind::WHOLE) dz = &stage.output;
        meet((SUMMED == 0 ? FIRST : SECOND) + walker);
        begin_products();
#pragma unroll
        for (int side = 0; side < 2; side++)
#pragma unroll
            for (int k = 0; k < ROWS; k += 16)
                add_rows_product(
                    weight[side],
                    describe(stage.x[SUMMED].chunks[side][k], sizeof stage.x[0].chunks[0]),
                    describe(dz->chunks[0][k], sizeof dz->chunks[0]));
        commit_products();
        if (product->bias) bias.add_columns(*dz);
        wait_for_products();
        if (SUMMED == 0) announce(FIRST_DONE + walker);
        if constexpr (Kind::WHOLE)
            if (features) {
                meet(FEATURES + walker);
                feature_sums.add_features(SUMMED == 1 ? stage.dz : stage.output, stage.features,
                                          features->feature_count);
            }
        if (SUMMED == 1 || features) announce(TILE_DONE + walker);
    }
    const int g = threadIdx.x % 32 / 4, t = threadIdx.x % 4;
    float* to = product->weight + (size_t)blockIdx.x * WIDTH * WIDTH +
                (threadIdx.x % GROUP_THREADS / 32 * 16 + g) * WIDTH + 2 * t;
#pragma unroll
    for (int side = 0; side < 2; side++)
#pragma unroll
        for (int j = 0; j < 16; j++) {
            const float(&w)[4] = weight[side][j];
            float* place = to + 64 * side * WIDTH + 8 * j;
            *(float2*)place = make_float2(w[0], w[1]);
            *(float2*)(place + 8 * WIDTH) = make_float2(w[2], w[3]);
        }
    if (product->bias)
        bias.write([&](int column, int y) {
            return y == 0 ? product->bias + blockIdx.x * WIDTH + column : nullptr;
        });
    if (features)
        feature_sums.write([&](int column, int y) {
            return y == EDGE_FEATURES - 1 && features->bias
                       ? features->bias + blockIdx.x * WIDTH + column
                       : features->weight + ((size_t)blockIdx.x * WIDTH + y) * WIDTH + column;
        });
}

// The block's sums for LayerNorm's scale and shift, of the walkers. For all threads.
__device__ void write_norm_sums(Shared& shared, float* to, const float (&sums)[2][8], bool walks) {
    constexpr int WARPS = WALKERS * GROUP_THREADS / 32;
    float(*all)[2 * WIDTH] = (float(*)[2 * WIDTH])shared.stages;
    barrier();
    if (walks)
#pragma unroll
        for (int i = 0; i < 2; i++)
#pragma unroll
            for (int k = 0; k < 8; k++) {
                const float sum = sums[i][k] + __shfl_xor_sync(ALL, sums[i][k], 16);
                if (threadIdx.x % 32 < 16)
                    all[threadIdx.x / 32 % WARPS][i * WIDTH + 8 * Mine().chunk + k] = sum;
            }
    barrier();
    if (threadIdx.x < 2 * WIDTH) {
        float sum = 0.f;
        for (int warp = 0; warp < WARPS; warp++) sum += all[warp][threadIdx.x];
        to[blockIdx.x * 2 * WIDTH + threadIdx.x] = sum;
    }
}

// All passes of a role: 0 and 1 add up, 2 walks.
template <int ROLE>
__device__ __forceinline__ void backward(Shared& shared, const Backward& a) {
    const Product* states = a.products + a.layers;
    const Product* features = a.products + a.product_count - 1;
    if (!states->x) states = nullptr;
    if (features->x) features = nullptr;
    float norm_sums[2][8] = {};
    for (int n = 0; n < a.layers; n += 2) {
        const bool two = n + 1 < a.layers, end = n + 2 >= a.layers;
        const Product* product = a.products + n;
        const Pass pass = {n == 0 ? a.normal : product->dz,
                           {product, two ? product + 1 : nullptr},
                           end ? features : nullptr,
                           !end || states ? (Stored*)product[two ? 2 : 1].dz : nullptr,
                           a.weights + n * UNIT,
                           true,
                           nullptr};
        if constexpr (ROLE < 2) add_up<ROLE, Stage>(shared, a, pass);
        else if (n == 0) walk<true, Stage>(shared, a, pass, norm_sums);
        else walk<false, Stage>(shared, a, pass, norm_sums);
        // Makes what was written visible to all threads.
        barrier();
    }
    if (states) {
        const Pass pass = {states->dz, {states, nullptr}, nullptr,
                           a.input,    a.weights + a.layers * UNIT, false, a.sums};
        if constexpr (ROLE < 2) add_up<ROLE, SmallStage>(shared, a, pass);
        else walk<false, SmallStage>(shared, a, pass, norm_sums);
    }
    write_norm_sums(shared, a.norm_sums, norm_sums, ROLE == 2);
}

extern "C" __global__ void __launch_bounds__(EDGE_THREADS, 1)
    edges_backward(const __grid_constant__ BackwardBatch batch) {
    extern __shared__ __align__(1024) uint4 memory[];
    Shared& shared = *(Shared*)memory;
    const Backward& a = batch.item[blockIdx.y];
    if (threadIdx.x < WIDTH)
        shared.scale[threadIdx.x] =
            threadIdx.x < a.width ? read_early(a.parameters + a.norm + threadIdx.x) : 0.f;
    if (threadIdx.x == 0) shared.share = 1.f / a.width;
    wait_for_kernel_before();
    const int role = __shfl_sync(ALL, threadIdx.x / GROUP_THREADS, 0);
    if (role < 2) {
        asm volatile("setmaxnreg.inc.sync.aligned.u32 %0;" : : "n"(SUM_REGISTERS));
        if (role == 0) backward<0>(shared, a);
        else backward<1>(shared, a);
    } else {
        asm volatile("setmaxnreg.dec.sync.aligned.u32 %0;" : : "n"(WALKER_REGISTERS));
        backward<2>(shared, a);
    }
}
