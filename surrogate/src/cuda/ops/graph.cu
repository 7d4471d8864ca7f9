// Radius graphs of frames, of one window or of several side by side: the CUDA twin of `radius_graph`
// in Rust, equal to it edge by edge. Blocks (x, y) make that of frame y.
//
// A cell list finds candidates: cells are at least as wide as the radius, so neighbours lie in
// adjacent cells. Cells whose coordinates differ by a multiple of the grid's side share a bucket,
// so that points may fly anywhere and no bounding box is needed; a candidate's distance decides in
// any case, and a window has buckets of its own. A warp serves a receiver, whose neighbours it finds and
// counts, then puts in order into its row of the graph. No sum depends on the order of atomics.
//
// DIMENSIONS is 2 or 3, ROWS the number of receivers of a thread block, KEPT the neighbours of a receiver
// that are kept from the count to the row. These and the structs are defined in graph.rs.

constexpr int LANES = 32;
constexpr unsigned ALL = 0xffffffffu;
// Bucket of a point whose position is not finite.
constexpr unsigned NOWHERE = 0xffffffffu;
// A cell and those around it.
constexpr int AROUND = DIMENSIONS == 2 ? 9 : 27;

// The cell list of one of all frames.
__device__ Cells cells_of(const Cells& all, unsigned frame) {
    return {all.count + frame * (all.buckets + 1), all.first + frame * all.buckets,
            all.bucket + frame * all.points,       all.rank + frame * all.points,
            all.sorted + frame * all.points,       all.neighbours + frame * all.points,
            all.block_neighbours + frame * all.blocks, all.kept + (size_t)frame * all.points * KEPT,
            all.buckets, all.points, all.blocks};
}

struct Point {
    float x[DIMENSIONS];

    __device__ explicit Point(const float* position) {
        for (int k = 0; k < DIMENSIONS; ++k) {
            x[k] = position[k];
        }
    }

    __device__ bool is_finite() const {
        bool finite = true;
        for (int k = 0; k < DIMENSIONS; ++k) {
            finite = finite && isfinite(x[k]);
        }
        return finite;
    }

    // Row-major number of the point's cell, without the wrap-around. In double precision, where
    // rounding cannot part neighbours by two cells.
    __device__ unsigned cell(const Grid& grid) const {
        unsigned number = 0;
        for (int k = DIMENSIONS - 1; k >= 0; --k) {
            const double cell = floor(double(x[k]) * grid.inverse_width);
            number = number * grid.side + unsigned(int(fmin(fmax(cell, -1e9), 1e9)));
        }
        return number;
    }
};

// As on the CPU, to the bit: each product rounded, summed from the first.
__device__ float distance_squared(const Point& point, float4 other) {
    const float y[3] = {other.x, other.y, other.z};
    float sum = 0.0f;
    for (int k = 0; k < DIMENSIONS; ++k) {
        const float difference = point.x[k] - y[k];
        sum = __fadd_rn(sum, __fmul_rn(difference, difference));
    }
    return sum;
}

extern "C" __global__ void count_buckets(
    Grid grid, const __grid_constant__ Frames frames, const unsigned* window, Cells all) {
    const Cells cells = cells_of(all, blockIdx.y);
    const unsigned i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= grid.points) {
        return;
    }
    const Point point(frames.of[blockIdx.y].position + i * DIMENSIONS);
    unsigned bucket = NOWHERE;
    if (point.is_finite()) {
        bucket = window[i] * grid.buckets + (point.cell(grid) & (grid.buckets - 1));
        cells.rank[i] = atomicAdd(&cells.count[bucket], 1u);
    }
    cells.bucket[i] = bucket;
}

// Gives each bucket a stretch of places; which one does not matter.
extern "C" __global__ void place_buckets(Cells all) {
    const Cells cells = cells_of(all, blockIdx.y);
    const unsigned bucket = blockIdx.x * blockDim.x + threadIdx.x;
    const unsigned lane = threadIdx.x % LANES;
    const unsigned count = bucket < cells.buckets ? cells.count[bucket] : 0;
    unsigned end = count;
    for (unsigned step = 1; step < LANES; step *= 2) {
        const unsigned other = __shfl_up_sync(ALL, end, step);
        end += lane >= step ? other : 0;
    }
    unsigned base = 0;
    if (lane == LANES - 1 && end > 0) {
        base = atomicAdd(&cells.count[cells.buckets], end);
    }
    base = __shfl_sync(ALL, base, LANES - 1);
    if (bucket < cells.buckets) {
        cells.first[bucket] = base + end - count;
    }
}

extern "C" __global__ void sort_points(
    Grid grid, const __grid_constant__ Frames frames, Cells all) {
    const Cells cells = cells_of(all, blockIdx.y);
    const unsigned i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= grid.points || cells.bucket[i] == NOWHERE) {
        return;
    }
    const float* x = frames.of[blockIdx.y].position + i * DIMENSIONS;
    const float z = DIMENSIONS == 3 ? x[DIMENSIONS - 1] : 0.0f;
    const unsigned place = cells.first[cells.bucket[i]] + cells.rank[i];
    cells.sorted[place] = make_float4(x[0], x[1], z, __uint_as_float(i));
}

// Finds the neighbours of a receiver, in the order of the cells: the first `room` of them go to a list.
// Gives their number; for a warp.
__device__ unsigned find_neighbours(
    const Grid& grid, const float* position, const unsigned* window, const Cells& cells,
    unsigned receiver, unsigned* list, unsigned room) {
    const unsigned lane = threadIdx.x % LANES;
    const Point point(position + receiver * DIMENSIONS);
    if (!point.is_finite()) {
        return 0;
    }
    // Each lane looks up one bucket.
    unsigned first = 0, count = 0;
    if (lane < AROUND) {
        int shift = int(lane) % 3 - 1 + (int(lane) / 3 % 3 - 1) * int(grid.side);
        if (DIMENSIONS == 3) {
            shift += (int(lane) / 9 - 1) * int(grid.side * grid.side);
        }
        const unsigned bucket = (point.cell(grid) + unsigned(shift)) & (grid.buckets - 1);
        const unsigned place = window[receiver] * grid.buckets + bucket;
        first = cells.first[place];
        count = cells.count[place];
    }
    unsigned number = 0;
    for (int bucket = 0; bucket < AROUND; ++bucket) {
        const unsigned begin = __shfl_sync(ALL, first, bucket);
        const unsigned candidates = __shfl_sync(ALL, count, bucket);
        for (unsigned batch = 0; batch < candidates; batch += LANES) {
            const unsigned k = batch + lane;
            unsigned index = receiver;
            bool near = false;
            if (k < candidates) {
                const float4 other = cells.sorted[begin + k];
                index = __float_as_uint(other.w);
                near = index != receiver && distance_squared(point, other) <= grid.radius_squared;
            }
            const unsigned found = __ballot_sync(ALL, near);
            const unsigned place = number + __popc(found & ((1u << lane) - 1));
            if (near && place < room) {
                list[place] = index;
            }
            number += __popc(found);
        }
    }
    return number;
}

extern "C" __global__ void __launch_bounds__(ROWS * LANES) count_edges(
    Grid grid, const __grid_constant__ Frames frames, const unsigned* window, Cells all) {
    const Cells cells = cells_of(all, blockIdx.y);
    const float* position = frames.of[blockIdx.y].position;
    const unsigned receiver = blockIdx.x * ROWS + threadIdx.x / LANES;
    __shared__ unsigned sum;
    if (threadIdx.x == 0) {
        sum = 0;
    }
    __syncthreads();
    if (receiver < grid.points) {
        unsigned* kept = cells.kept + (size_t)receiver * KEPT;
        const unsigned number = find_neighbours(grid, position, window, cells, receiver, kept, KEPT);
        if (threadIdx.x % LANES == 0) {
            cells.neighbours[receiver] = number;
            atomicAdd(&sum, number);
        }
    }
    __syncthreads();
    if (threadIdx.x == 0) {
        cells.block_neighbours[blockIdx.x] = sum;
    }
}

// Sum of a value over the threads of a block, in all of them.
__device__ unsigned long long block_sum(unsigned long long value) {
    __shared__ unsigned long long sum;
    if (threadIdx.x == 0) {
        sum = 0;
    }
    __syncthreads();
    for (int step = LANES / 2; step > 0; step /= 2) {
        value += __shfl_xor_sync(ALL, value, step);
    }
    if (threadIdx.x % LANES == 0) {
        atomicAdd(&sum, value);
    }
    __syncthreads();
    value = sum;
    __syncthreads();
    return value;
}

// Rows of the graph: start, receivers, and senders in ascending order. If there is not enough room,
// the graph is left without edges, and `needed` tells how many there would be.
extern "C" __global__ void __launch_bounds__(ROWS * LANES) fill_edges(
    Grid grid, const __grid_constant__ Frames frames, const unsigned* window, Cells all_cells,
    unsigned long long* needed) {
    const Cells cells = cells_of(all_cells, blockIdx.y);
    const float* position = frames.of[blockIdx.y].position;
    const Graph& graph = frames.of[blockIdx.y].graph;
    unsigned long long earlier = 0, all = 0;
    for (unsigned block = threadIdx.x; block < gridDim.x; block += blockDim.x) {
        const unsigned number = cells.block_neighbours[block];
        all += number;
        earlier += block < blockIdx.x ? number : 0;
    }
    earlier = block_sum(earlier);
    all = block_sum(all);
    const bool fits = all <= graph.capacity;
    if (blockIdx.x == 0 && threadIdx.x == 0) {
        graph.nodes[0] = grid.points;
        graph.edges[0] = fits ? unsigned(all) : 0;
        atomicMax(needed, all);
    }

    const unsigned row = threadIdx.x / LANES;
    const unsigned lane = threadIdx.x % LANES;
    const unsigned receiver = blockIdx.x * ROWS + row;
    if (receiver >= grid.points) {
        return;
    }
    unsigned start = lane < row ? cells.neighbours[blockIdx.x * ROWS + lane] : 0;
    start = fits ? unsigned(earlier) + __reduce_add_sync(ALL, start) : 0;
    const unsigned number = fits ? cells.neighbours[receiver] : 0;
    if (lane == 0) {
        graph.start[receiver] = start;
        if (receiver == grid.points - 1) {
            graph.start[grid.points] = start + number;
        }
    }
    if (number == 0) {
        return;
    }
    const unsigned* unordered = cells.kept + (size_t)receiver * KEPT;
    if (number > KEPT) {
        // Searches again, into the memory for the reverse edges.
        find_neighbours(grid, position, window, cells, receiver, graph.reverse + start, number);
        __syncwarp();
        unordered = graph.reverse + start;
    }
    for (unsigned k = lane; k < number; k += LANES) {
        const unsigned sender = unordered[k];
        unsigned smaller = 0;
        for (unsigned other = 0; other < number; ++other) {
            smaller += unordered[other] < sender;
        }
        graph.sender[start + smaller] = sender;
        graph.receiver[start + smaller] = receiver;
    }
}

// The most edges that each window has had; none of a graph that was left without. `first` are the windows' first
// points, and the number of all points.
extern "C" __global__ void window_edges(
    const unsigned* start, const unsigned* first, unsigned windows, unsigned long long* most) {
    const unsigned window = blockIdx.x * blockDim.x + threadIdx.x;
    if (window < windows) {
        atomicMax(most + window, (unsigned long long)(start[first[window + 1]] - start[first[window]]));
    }
}

// The reverse of an edge, found by bisection in the sender's row.
extern "C" __global__ void reverse_edges(const __grid_constant__ Frames frames) {
    const Graph& graph = frames.of[blockIdx.y].graph;
    const unsigned edge = blockIdx.x * blockDim.x + threadIdx.x;
    if (edge >= graph.edges[0]) {
        return;
    }
    const unsigned sender = graph.sender[edge], receiver = graph.receiver[edge];
    unsigned low = graph.start[sender], high = graph.start[sender + 1];
    while (low < high) {
        const unsigned middle = (low + high) / 2;
        if (graph.sender[middle] < receiver) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    graph.reverse[edge] = low;
}
