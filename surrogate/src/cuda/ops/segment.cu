// Sums over the edges of each node, and edges that two graphs share. `Receive` is defined in
// segment.rs.

// Adds the sums of both halves of a warp. Each half adds up rows of its own: 16 lanes with 8 columns
// each.
__device__ __forceinline__ void combine(float (&v)[8]) {
#pragma unroll
    for (int k = 0; k < 8; k++) v[k] += __shfl_xor_sync(ALL, v[k], 16);
}

// Adds a half warp's share of the sums of a node's runs of edges: one in each tile of 16 (forward.cu).
__device__ __forceinline__ void add_runs(float (&total)[8], const float* sums, int node, u32 first,
                                         u32 end, int column) {
#pragma unroll 2
    for (u32 tile = first / 16 + threadIdx.x % 32 / 16; 16 * tile < end && first < end; tile += 2) {
        float v[8];
        load8(sums + (size_t)(tile + node) * WIDTH + column, v);
#pragma unroll
        for (int k = 0; k < 8; k++) total[k] += v[k];
    }
}

// Adds a half warp's share of up to 32 rows, whose numbers the lanes have: every other row, several
// loads at a time.
__device__ __forceinline__ void add_rows(float (&total)[8], const Stored* x, u32 row, u32 count,
                                         int column) {
    constexpr int WORDS = sizeof(Stored) / 2, TOGETHER = 8 / WORDS;
    const u32 half = threadIdx.x % 32 / 16;
    for (u32 first = 0; first < count; first += 2 * TOGETHER) {
        uint4 words[TOGETHER][WORDS];
#pragma unroll
        for (int n = 0; n < TOGETHER; n++) {
            const u32 from = __shfl_sync(ALL, row, first + 2 * n + half);
#pragma unroll
            for (int k = 0; k < WORDS; k++)
                words[n][k] = ((const uint4*)(x + (size_t)from * WIDTH + column))[k];
        }
#pragma unroll
        for (int n = 0; n < TOGETHER; n++) {
            float v[8];
            unpack8(words[n], v);
#pragma unroll
            for (int k = 0; k < 8; k++) total[k] += first + 2 * n + half < count ? v[k] : 0.f;
        }
    }
}

// For each node the sum of its edges' messages scale x + shift.
extern "C" __global__ void receive(const __grid_constant__ ReceiveBatch batch) {
    const Receive& a = batch.item[blockIdx.y];
    const int nodes = read_early(a.nodes);
    wait_for_kernel_before();
    const int node = blockIdx.x * (blockDim.x / 32) + threadIdx.x / 32, lane = threadIdx.x % 32;
    if (node >= nodes) return;
    const int column = lane % 16 * 8;
    const u32 first = a.start[node], end = a.start[node + 1];
    float total[8] = {};
    add_runs(total, a.sums, node, first, end, column);
    combine(total);
    const float degree = end - first;
#pragma unroll
    for (int k = 0; k < 8; k++) {
        bool real = column + k < a.width;
        float scale = real ? a.parameters[a.norm + column + k] : 0.f;
        float shift = real ? a.parameters[a.norm + a.width + column + k] : 0.f;
        total[k] = scale * total[k] + degree * shift;
    }
    if (lane < 16) store8(a.received + (size_t)node * WIDTH + column, total);
}

// For each node the sum of an edge quantity over the edges that it receives, and over those that it
// sends: nodes x 128 each. The graph is symmetric, so the latter are the reverses of the former. If
// `sums` is not null, the former are added up already as far as runs go.
extern "C" __global__ void __launch_bounds__(128, 9)
    collect(const u32* start, const u32* reverse, const u32* count, const Stored* x,
            const float* sums, Stored* sent, Stored* received) {
    const int nodes = read_early(count);
    wait_for_kernel_before();
    const int node = blockIdx.x * (blockDim.x / 32) + threadIdx.x / 32, lane = threadIdx.x % 32;
    if (node >= nodes) return;
    const int column = lane % 16 * 8;
    const u32 first = start[node], end = start[node + 1];
    // One sum after the other: both at once need so many registers that not all blocks fit.
    for (int which = 0; which < 2; which++) {
        float total[8] = {};
        if (which == 0 && sums) add_runs(total, sums, node, first, end, column);
        else
            for (u32 some = first; some < end; some += 32) {
                const u32 count = min(end - some, 32u), edge = some + min((u32)lane, count - 1);
                add_rows(total, x, which == 0 ? edge : reverse[edge], count, column);
            }
        combine(total);
        if (lane < 16) store8((which == 0 ? received : sent) + (size_t)node * WIDTH + column, total);
    }
}

// For each edge of a graph the same edge of another one, or NONE.
extern "C" __global__ void same_edges(const u32* edges, const u32* sender, const u32* receiver,
                                      const u32* other_start, const u32* other_sender, u32* same) {
    wait_for_kernel_before();
    for (u32 edge = blockIdx.x * blockDim.x + threadIdx.x; edge < *edges;
         edge += gridDim.x * blockDim.x) {
        const u32 from = sender[edge];
        u32 low = other_start[receiver[edge]], end = other_start[receiver[edge] + 1], high = end;
        while (low < high) {
            u32 middle = (low + high) / 2;
            if (other_sender[middle] < from) low = middle + 1;
            else high = middle;
        }
        same[edge] = low < end && other_sender[low] == from ? low : NONE;
    }
}
