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

// Sets how fast a node on or behind a wall or in a box may approach it: so that the nearest point that it
// sees comes to touch (boundary.rs). For all lanes of a warp.
__device__ inline void set_approach(const Mpm& m, int node) {
    const bool exists = node < m.columns * m.rows;
    const int i = node % m.columns - GHOSTS, j = node / m.columns - GHOSTS;
    const bool left = i <= 0, bottom = j <= 0;
    const bool across = left || i >= m.cells_x, along = bottom || j >= m.cells_y;
    const Placed* box = nullptr;
    for (int k = m.obstacles - 1; k >= 0; --k) {
        if (holds(m.placed[k], Vec{i * m.cell, j * m.cell}, m.cell)) box = &m.placed[k];
    }
    const bool waits = exists && (across || along || box != nullptr);
    if (!__any_sync(~0u, waits)) return;
    double gap[3] = {infinity(), infinity(), infinity()};
    for (int p = first_of_lane(m, node); p != NOBODY; p = m.bins.successor[p]) {
        const double half = 0.5 * sqrt(m.volume[p]);
        const Vec x = m.position[p];
        gap[0] = fmin(gap[0], (left ? x.x : m.width - x.x) - half);
        gap[1] = fmin(gap[1], (bottom ? x.y : m.height - x.y) - half);
        if (box != nullptr) gap[2] = fmin(gap[2], distance(*box, x) - half);
    }
    for (int distance = LANES / 2; distance > 0; distance /= 2) {
        for (double& g : gap) g = fmin(g, __shfl_xor_sync(~0u, g, distance, LANES));
    }
    if (waits && threadIdx.x % LANES == 0) {
        for (double& g : gap) g = fmax(g, 0.0) / m.dt;
        m.node_approach[node] = {across ? gap[0] : 0.0, along ? gap[1] : 0.0,
                                 box != nullptr ? gap[2] : 0.0};
    }
}

// (m v)_i = sum S_ip m_p (v_p + C_p (x_i - x_p)), the affine part when the transfer has one.
__device__ inline Vec momentum_term(const Mpm& m, const Stencil& s, int p, int a, int b) {
    const double mass = m.mass[p];
    Vec momentum = m.velocity[p] * mass;
    if (m.affine) momentum = momentum + m.affine_velocity[p] * mass * offset(s, a, b, m.cell);
    return momentum * value(s, a, b);
}

// f_i = - sum V_p (sigma_p - rho_p (w tr L_p)² I) grad S_ip, the second term under compression only.
__device__ inline Vec force_term(const Mpm& m, const Stencil& s, int p, int a, int b) {
    const double jump = m.shock_width * fmin(trace(m.velocity_gradient[p]), 0.0);
    const Vec g = gradient(s, a, b);
    return g * (m.mass[p] * jump * jump) - m.stress[p] * m.volume[p] * g;
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
    if constexpr (WALLS_WAIT) set_approach(m, node);
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
    if constexpr (WALLS_WAIT) set_approach(m, node);
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
