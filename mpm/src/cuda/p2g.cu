// Points to grid: mass, momentum and internal force of the nodes. What then happens to a node alone
// (momentum balance, contacts) follows in the same kernel.

// Threads of a node: one for each bin that can hold points it sees, at most 4 x 4.
constexpr int LANES = 16;
static_assert(WIDTH * WIDTH <= LANES, "a lane for each bin");

// The first point of the bin of this lane, or NOBODY.
__device__ inline int first_of_lane(const Mpm& m, int node) {
    const int lane = int(threadIdx.x) % LANES, a = lane % WIDTH, b = lane / WIDTH;
    if (node >= m.columns * m.rows || b >= WIDTH || node % m.columns < a || node / m.columns < b) {
        return NOBODY;
    }
    return first_point(m.bins, m, node - b * m.columns - a);
}

// Sums K numbers over the points that a node sees. `term(p, a, b, sum)` adds those of point p, for
// which the node is a columns and b rows from its lowest, leftmost one. Each lane goes through one
// bin, then lanes are added up as a tree: a fixed order. False if there is no point.
template <int K, class Term>
__device__ inline bool sum_over_points(const Mpm& m, int node, double (&sum)[K], const Term& term) {
    const int lane = int(threadIdx.x) % LANES, a = lane % WIDTH, b = lane / WIDTH;
    for (int k = 0; k < K; ++k) sum[k] = 0.0;
    int p = first_of_lane(m, node);
    const unsigned lanes_of_node = 0xffffu << (threadIdx.x & LANES);
    const unsigned seen = __ballot_sync(~0u, p != NOBODY);
    if (seen == 0) return false;
    for (; p != NOBODY; p = m.bins.successor[p]) term(p, a, b, sum);
    for (int distance = LANES / 2; distance > 0; distance /= 2) {
        for (int k = 0; k < K; ++k) sum[k] += __shfl_xor_sync(~0u, sum[k], distance, LANES);
    }
    return (seen & lanes_of_node) != 0 && lane == 0;
}

// Sets how fast a node on a wall may approach it: so that the nearest point that it sees comes to touch
// the wall (boundary.rs). For all lanes of a warp.
__device__ inline void set_approach(const Mpm& m, int node) {
    const int i = node % m.columns - GHOSTS, j = node / m.columns - GHOSTS;
    // Threads beyond the last row see no wall: it lies two ghosts below.
    const bool left = i == 0, bottom = j == 0;
    const bool across = left || i == m.cells_x, along = bottom || j == m.cells_y;
    if (!__any_sync(~0u, across || along)) return;
    double x_gap = infinity(), y_gap = infinity();
    for (int p = first_of_lane(m, node); p != NOBODY; p = m.bins.successor[p]) {
        const double half = 0.5 * sqrt(m.volume[p]);
        const Vec x = m.position[p];
        x_gap = fmin(x_gap, (left ? x.x : m.width - x.x) - half);
        y_gap = fmin(y_gap, (bottom ? x.y : m.height - x.y) - half);
    }
    for (int distance = LANES / 2; distance > 0; distance /= 2) {
        x_gap = fmin(x_gap, __shfl_xor_sync(~0u, x_gap, distance, LANES));
        y_gap = fmin(y_gap, __shfl_xor_sync(~0u, y_gap, distance, LANES));
    }
    if ((across || along) && threadIdx.x % LANES == 0) {
        m.node_approach[node] = {across ? fmax(x_gap, 0.0) / m.dt : 0.0,
                                 along ? fmax(y_gap, 0.0) / m.dt : 0.0};
    }
}

// (m v)_i = sum S_ip m_p (v_p + C_p (x_i - x_p)), the affine part when the transfer has one.
__device__ inline Vec momentum_term(const Mpm& m, const Stencil& s, int p, int a, int b) {
    const double mass = m.mass[p];
    Vec momentum = m.velocity[p] * mass;
    if (m.affine) momentum = momentum + m.affine_velocity[p] * mass * offset(s, a, b, m.cell);
    return momentum * value(s, a, b);
}

// f_i = - sum V_p sigma_p grad S_ip.
__device__ inline Vec force_term(const Mpm& m, const Stencil& s, int p, int a, int b) {
    return m.stress[p] * -m.volume[p] * gradient(s, a, b);
}

__device__ inline int node_of_thread() { return thread_index() / LANES; }

// MUSL and USL: all sums at once, then the momentum balance.
extern "C" __global__ void p2g(const Mpm m) {
    if (!may_run(m)) return;
    const int node = node_of_thread();
    double sum[5];
    const bool writes = sum_over_points(m, node, sum, [&](int p, int a, int b, double(&sum)[5]) {
        const Stencil& s = m.stencil[p];
        const Vec momentum = momentum_term(m, s, p, a, b), force = force_term(m, s, p, a, b);
        sum[0] += m.mass[p] * value(s, a, b);
        sum[1] += momentum.x;
        sum[2] += momentum.y;
        sum[3] += force.x;
        sum[4] += force.y;
    });
    if constexpr (POINTS_MEET_WALLS) set_approach(m, node);
    if (!writes) return;
    m.node_mass[node] = sum[0];
    accelerate(m, m.placed, node, sum[0], {sum[1], sum[2]}, {sum[3], sum[4]});
}

// USF, before stresses are updated: mass, momentum and the velocity before the step.
extern "C" __global__ void p2g_mass_and_momentum(const Mpm m) {
    if (!may_run(m)) return;
    const int node = node_of_thread();
    double sum[3];
    const bool writes = sum_over_points(m, node, sum, [&](int p, int a, int b, double(&sum)[3]) {
        const Stencil& s = m.stencil[p];
        const Vec momentum = momentum_term(m, s, p, a, b);
        sum[0] += m.mass[p] * value(s, a, b);
        sum[1] += momentum.x;
        sum[2] += momentum.y;
    });
    if constexpr (POINTS_MEET_WALLS) set_approach(m, node);
    if (!writes) return;
    m.node_mass[node] = sum[0];
    m.node_momentum[node] = {sum[1], sum[2]};
    set_velocity(m, m.placed, node, sum[0], {sum[1], sum[2]});
}

// USF, after stresses are updated: internal force and the momentum balance.
extern "C" __global__ void p2g_internal_force(const Mpm m) {
    if (!may_run(m)) return;
    const int node = node_of_thread();
    double sum[2];
    const bool writes = sum_over_points(m, node, sum, [&](int p, int a, int b, double(&sum)[2]) {
        const Vec force = force_term(m, m.stencil[p], p, a, b);
        sum[0] += force.x;
        sum[1] += force.y;
    });
    if (!writes) return;
    accelerate(m, m.placed, node, m.node_mass[node], m.node_momentum[node], {sum[0], sum[1]});
}

// The second mapping of MUSL: velocity of the new point velocities, still at the old positions.
extern "C" __global__ void p2g_velocity(const Mpm m) {
    if (!may_run(m)) return;
    const int node = node_of_thread();
    double sum[2];
    const bool writes = sum_over_points(m, node, sum, [&](int p, int a, int b, double(&sum)[2]) {
        const Vec momentum = momentum_term(m, m.stencil[p], p, a, b);
        sum[0] += momentum.x;
        sum[1] += momentum.y;
    });
    if (!writes) return;
    set_velocity(m, m.placed + m.obstacles, node, m.node_mass[node], {sum[0], sum[1]});
}
