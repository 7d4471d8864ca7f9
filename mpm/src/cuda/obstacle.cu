// Rigid boxes in the domain: fixed barriers and moving plates.

enum Side { LEFT, RIGHT, BOTTOM, TOP };

// Outward normal.
__device__ inline Vec normal(int side) {
    switch (side) {
        case LEFT: return {-1.0, 0.0};
        case RIGHT: return {1.0, 0.0};
        case BOTTOM: return {0.0, -1.0};
        default: return {0.0, 1.0};
    }
}

// Round-off allowed in "on a face" (m).
__device__ inline double tolerance(double cell) { return 1.0e-9 * cell; }

// Velocity after contact with a surface of outward `normal` that moves at `surface`: the approaching
// normal part is removed, and the tangential part loses at most `friction` times as much.
__device__ inline Vec contact(Vec velocity, Vec normal, Vec surface, double friction) {
    const Vec relative = velocity - surface;
    const double approach = -dot(relative, normal);
    if (approach < 0.0) return velocity;
    const Vec tangential = relative + normal * approach;
    if (friction == 0.0) return surface + tangential;
    if (isinf(friction)) return surface;
    const double speed = norm(tangential), loss = friction * approach;
    return speed <= loss ? surface : surface + tangential * (1.0 - loss / speed);
}

// The box at time t, with its mean velocity from there to t + dt.
__device__ inline Placed place(const Obstacle& o, const Mpm& m, double t) {
    Placed placed;
    const double size[2] = {m.width, m.height};
    const double now = fmax(t - o.start, 0.0), then = fmax(t + m.dt - o.start, 0.0);
    double velocity[2];
    for (int axis = 0; axis < 2; ++axis) {
        const double shift = o.velocity[axis] * now;
        double min = o.min[axis] + shift, max = o.max[axis] + shift;
        if (min <= tolerance(m.cell)) min = -infinity();
        if (max >= size[axis] - tolerance(m.cell)) max = infinity();
        placed.min[axis] = min;
        placed.max[axis] = max;
        velocity[axis] = (o.velocity[axis] * then - shift) / m.dt;
    }
    for (int side = 0; side < 4; ++side) placed.friction[side] = o.friction[side];
    placed.velocity = {velocity[0], velocity[1]};
    return placed;
}

// Depth of x below the face of a side (m).
__device__ inline double depth(const Placed& o, Vec x, int side) {
    switch (side) {
        case LEFT: return x.x - o.min[0];
        case RIGHT: return o.max[0] - x.x;
        case BOTTOM: return x.y - o.min[1];
        default: return o.max[1] - x.y;
    }
}

// Whether the node at x lies on or in the box.
__device__ inline bool holds(const Placed& o, Vec x, double cell) {
    for (int side = 0; side < 4; ++side) {
        if (depth(o, x, side) < -tolerance(cell)) return false;
    }
    return true;
}

// The distance (m) of a point outside.
__device__ inline double distance(const Placed& o, Vec x) {
    const double across = fmin(fmin(depth(o, x, LEFT), depth(o, x, RIGHT)), 0.0);
    const double along = fmin(fmin(depth(o, x, BOTTOM), depth(o, x, TOP)), 0.0);
    return norm({across, along});
}

__device__ inline Vec side_contact(const Placed& o, Vec velocity, int side, double approach) {
    const Vec surface = o.velocity - normal(side) * approach;
    return contact(velocity, normal(side), surface, o.friction[side]);
}

__device__ inline Vec corner_contact(const Placed& o, Vec velocity, int a, int b, double approach) {
    const Vec relative = velocity - o.velocity;
    const double approach_a = -dot(relative, normal(a)), approach_b = -dot(relative, normal(b));
    if (approach_a < approach || approach_b < approach) return velocity;
    return side_contact(o, velocity, approach_a < approach_b ? a : b, approach);
}

// Velocity of the node at x after contact with the box, which it may approach: of the nearest face, or of
// a corner.
__device__ inline Vec obstacle_contact(const Placed& o, Vec x, Vec velocity, double cell,
                                       double approach) {
    if (!holds(o, x, cell)) return velocity;
    double nearest = infinity();
    for (int side = 0; side < 4; ++side) nearest = fmin(nearest, depth(o, x, side));
    bool acts[4];
    for (int side = 0; side < 4; ++side) {
        acts[side] = depth(o, x, side) <= nearest + tolerance(cell);
    }
    const bool across = acts[LEFT] != acts[RIGHT], along = acts[BOTTOM] != acts[TOP];
    if (across && along) {
        return corner_contact(o, velocity, acts[LEFT] ? LEFT : RIGHT, acts[BOTTOM] ? BOTTOM : TOP,
                              approach);
    }
    for (int side = 0; side < 4; ++side) {
        if (acts[side]) velocity = side_contact(o, velocity, side, approach);
    }
    return velocity;
}

// The nearest face of a point strictly inside the box, or -1.
__device__ inline int nearest_face(const Placed& o, Vec x) {
    int nearest = LEFT;
    for (int side = 0; side < 4; ++side) {
        if (!(depth(o, x, side) > 0.0)) return -1;
        if (depth(o, x, side) < depth(o, x, nearest)) nearest = side;
    }
    return nearest;
}

// The point moved onto a face.
__device__ inline Vec project(const Placed& o, Vec x, int side) {
    switch (side) {
        case LEFT: return {o.min[0], x.y};
        case RIGHT: return {o.max[0], x.y};
        case BOTTOM: return {x.x, o.min[1]};
        default: return {x.x, o.max[1]};
    }
}

// The first kernel of a step: counts it and places the boxes, at its beginning and at its end.
extern "C" __global__ void begin_step(const Mpm m) {
    await_turn();
    Clock& clock = *m.clock;
    if (threadIdx.x == 0) {
        clock.running = clock.failure == NO_FAILURE;
        clock.step += clock.running;
    }
    __syncthreads();
    const double time = double(m.first_step + clock.step - 1) * m.dt;
    for (int k = int(threadIdx.x); k < m.obstacles; k += int(blockDim.x)) {
        m.placed[k] = place(m.obstacle[k], m, time);
        m.placed[m.obstacles + k] = place(m.obstacle[k], m, time + m.dt);
    }
}
