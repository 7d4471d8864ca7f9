// Contact with walls and obstacles, as conditions on the grid velocity.

// Adds an impulse to the entry of a slot (node or point) of a ledger. Body 0 is the walls.
__device__ inline void book(double* ledger, int slots, int slot, int body, Vec impulse) {
    // Most slots have none.
    if (impulse.x != 0.0) ledger[size_t(2 * body) * slots + slot] += impulse.x;
    if (impulse.y != 0.0) ledger[size_t(2 * body + 1) * slots + slot] += impulse.y;
}

__device__ inline void book_obstacle(double* ledger, int slots, int slot, const Mpm& m, int obstacle,
                                     Vec impulse, Vec velocity) {
    book(ledger, slots, slot, 1 + obstacle, impulse);
    const double work = dot(impulse, velocity);
    if (work != 0.0) ledger[size_t(2 + 2 * m.obstacles) * slots + slot] += work;
}

__device__ inline void book_projection(double* ledger, int slots, int slot, const Mpm& m) {
    ledger[size_t(3 + 2 * m.obstacles) * slots + slot] += 1.0;
}

// All nodes on or behind a wall are clipped, to the speed at which they may approach it. In a corner
// both walls act, one after the other.
__device__ inline Vec wall_contact(const Mpm& m, int i, int j, Vec v, Approach approach) {
    if (i <= 0) v = contact(v, normal(RIGHT), normal(LEFT) * approach.x, m.friction[LEFT]);
    if (i >= m.cells_x) v = contact(v, normal(LEFT), normal(RIGHT) * approach.x, m.friction[RIGHT]);
    if (j <= 0) v = contact(v, normal(TOP), normal(BOTTOM) * approach.y, m.friction[BOTTOM]);
    if (j >= m.cells_y) v = contact(v, normal(BOTTOM), normal(TOP) * approach.y, m.friction[TOP]);
    return v;
}

// Velocity of a node after all contacts: obstacles first, walls last, so that a node in a corner
// between both never enters the wall. Impulses go to the ledger if they are to be booked.
__device__ inline Vec constrain(const Mpm& m, const Placed* placed, int node, double mass, Vec velocity,
                                bool booked) {
    const int i = node % m.columns - GHOSTS, j = node / m.columns - GHOSTS;
    const int nodes = m.columns * m.rows;
    const Vec x = {i * m.cell, j * m.cell};
    const Approach approach = WALLS_WAIT ? m.node_approach[node] : Approach{};
    for (int k = 0; k < m.obstacles; ++k) {
        const Vec after = obstacle_contact(placed[k], x, velocity, m.cell, approach.obstacle);
        const Vec impulse = (after - velocity) * mass;
        if (booked) book_obstacle(m.node_ledger, nodes, node, m, k, impulse, placed[k].velocity);
        velocity = after;
    }
    const Vec after = wall_contact(m, i, j, velocity, approach);
    if (booked) book(m.node_ledger, nodes, node, 0, (after - velocity) * mass);
    return after;
}
