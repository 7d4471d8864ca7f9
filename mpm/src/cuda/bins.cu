// Points sorted by cells. Each cell's list ascends, so that sums over points have one order
// whatever the order in which threads run.

__device__ inline bool is_of_step(u64 entry, u64 step) { return entry >> 32 == step; }

__device__ inline void push(const Bins& bins, u64 step, int p, int cell) {
    const u64 before = atomicExch(&bins.head[cell], step << 32 | u64(p));
    bins.cell[p] = cell;
    bins.next[p] = is_of_step(before, step) ? int(before) : NOBODY;
}

// Finds who follows point p in the ascending list of its cell, once all points are pushed.
__device__ inline void link(const Bins& bins, u64 step, int p) {
    const int cell = bins.cell[p];
    int successor = NOBODY;
    bool first = true;
    for (int q = int(bins.head[cell]); q != NOBODY; q = bins.next[q]) {
        if (q < p) first = false;
        if (q > p && (successor == NOBODY || q < successor)) successor = q;
    }
    bins.successor[p] = successor;
    if (first) bins.first[cell] = step << 32 | u64(p);
}

__device__ inline int first_point(const Bins& bins, const Mpm& m, int cell) {
    const u64 entry = bins.first[cell];
    return is_of_step(entry, m.clock->step) ? int(entry) : NOBODY;
}

// The next two kernels end a step, for the next one. After a failure there is none: points may be
// anywhere.
__device__ inline int point_of_next_step(const Mpm& m) {
    const int p = point_of_thread(m);
    return p != NOBODY && m.clock->failure == NO_FAILURE ? p : NOBODY;
}

extern "C" __global__ void evaluate_basis(const Mpm m) {
    const int p = point_of_next_step(m);
    if (p == NOBODY) return;
    const Stencil s = stencil_at(m, m.position[p]);
    m.stencil[p] = s;
    push(m.bins, m.clock->step + 1, p, s.node);
}

extern "C" __global__ void sort_bins(const Mpm m) {
    const int p = point_of_next_step(m);
    if (p != NOBODY) link(m.bins, m.clock->step + 1, p);
}
