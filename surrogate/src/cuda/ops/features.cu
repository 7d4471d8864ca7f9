// Features of the nodes and edges of frames: the CUDA twin of `window_input` in Rust, equal to it to
// the bit. Blocks (x, y) make those of frame y. DIMENSIONS is 2. Structs are defined in features.rs.

// A box in one frame: lower and upper corner (m), and how it moves (m/frame).
struct Placed {
    float low[DIMENSIONS], high[DIMENSIONS], velocity[DIMENSIONS];
};

// The box `back` frames before the newest of its window: the twin of `Obstacle::corners_at` and
// `velocity_at` in Rust.
__device__ Placed placed(const Obstacle& box, int back) {
    const double moved = fmax(box.elapsed - back, 0.0);
    Placed now;
    for (int k = 0; k < DIMENSIONS; ++k) {
        const double shift = __dmul_rn(box.velocity[k], moved);
        now.low[k] = float(__dadd_rn(box.corners[0][k], shift));
        now.high[k] = float(__dadd_rn(box.corners[1][k], shift));
        now.velocity[k] = moved > 0.0 ? float(box.velocity[k]) : 0.0f;
    }
    return now;
}

__device__ bool is_fixed(const Obstacle& box) {
    bool yes = true;
    for (int k = 0; k < DIMENSIONS; ++k) {
        yes = yes && box.velocity[k] == 0.0;
    }
    return yes;
}

// In radii. The paper's placeholder: a wall farther than the radius is at distance 0.
__device__ float wall_distance(float distance, const Scales& scales) {
    const float scaled = distance / scales.radius;
    if (scales.clamped) return fminf(fmaxf(scaled, -1.0f), 1.0f);
    return distance > scales.radius ? 0.0f : scaled;
}

// Whether an obstacle is in the way of a point that moves in direction k.
__device__ bool in_the_way(const Placed& box, const float* x, int k, float skin) {
    bool yes = true;
    for (int j = 0; j < DIMENSIONS; ++j) {
        yes = yes && (j == k || !(x[j] <= box.low[j] + skin || x[j] >= box.high[j] - skin));
    }
    return yes;
}

// Velocities, distances to the walls, further features.
extern "C" __global__ void node_features(
    unsigned points, Scales scales, const __grid_constant__ Frames frames, Obstacles obstacles) {
    const Frame& frame = frames.of[blockIdx.y];
    const unsigned point = blockIdx.x * blockDim.x + threadIdx.x;
    if (point >= points) {
        return;
    }
    const unsigned first = point * DIMENSIONS;
    float* out = frame.node + point * ((frame.known + 1) * DIMENSIONS + scales.further);
    for (int back = frame.known - 2; back >= 0; --back) {
        for (int k = 0; k < DIMENSIONS; ++k) {
            const float step = frame.past[back][first + k] - frame.past[back + 1][first + k];
            *out++ = (step - scales.velocity_mean[k]) / scales.velocity_std[k];
        }
    }
    const float* x = frame.past[0] + first;
    const unsigned window = obstacles.window[point];
    for (int k = 0; k < DIMENSIONS; ++k) {
        float below = x[k] - scales.bounds[k][0], above = scales.bounds[k][1] - x[k];
        const unsigned boxes = scales.walls_of_boxes ? obstacles.first[window + 1] : 0;
        for (unsigned o = obstacles.first[window]; o < boxes; ++o) {
            if (!is_fixed(obstacles.all[o])) continue;
            const Placed box = placed(obstacles.all[o], 0);
            if (in_the_way(box, x, k, scales.skin)) {
                const float over = x[k] - box.high[k], under = box.low[k] - x[k];
                if (over >= -scales.skin) below = fminf(below, fmaxf(over, 0.0f));
                if (under >= -scales.skin) above = fminf(above, fmaxf(under, 0.0f));
            }
        }
        *out++ = wall_distance(below, scales);
        *out++ = wall_distance(above, scales);
    }
    for (int k = 0; k < scales.further; ++k) {
        *out++ = frame.further[point * scales.further + k];
    }
}

// For each point, how many of its window are above it and no farther than half a radius to any side,
// standardised, into a column of the further features: the twin of `overburden` in
// Rust. A warp for each point.
extern "C" __global__ void overburden(
    unsigned points, Scales scales, const __grid_constant__ Frames frames, const unsigned* window,
    float mean, float std, int column) {
    const unsigned point = (blockIdx.x * blockDim.x + threadIdx.x) / 32, lane = threadIdx.x % 32;
    if (point >= points) {
        return;
    }
    const float half = scales.radius / 2.0f;
    const float* now = frames.of[blockIdx.y].past[0];
    const float* x = now + point * DIMENSIONS;
    unsigned above = 0;
    for (unsigned other = lane; other < points; other += 32) {
        const float* y = now + other * DIMENSIONS;
        bool counts = window[other] == window[point] && y[1] > x[1] && y[0] >= x[0] - half
            && y[0] <= x[0] + half;
        for (int k = 0; k < DIMENSIONS; ++k) {
            counts = counts && (k == 1 || fabsf(y[k] - x[k]) <= half);
        }
        above += counts;
    }
    for (int bit = 16; bit > 0; bit /= 2) {
        above += __shfl_xor_sync(0xffffffff, above, bit);
    }
    if (lane == 0) {
        frames.of[blockIdx.y].further[point * scales.further + column] = (float(above) - mean) / std;
    }
}

// Accelerations from the positions in a frame and the two before it, standardised, into columns of
// the further features: the twin of `moving_features` in Rust.
extern "C" __global__ void acceleration(
    unsigned points, Scales scales, const __grid_constant__ Frames frames, Standard standard,
    int column) {
    const unsigned k = blockIdx.x * blockDim.x + threadIdx.x;
    if (k >= points * DIMENSIONS) {
        return;
    }
    const unsigned point = k / DIMENSIONS, axis = k % DIMENSIONS;
    const Frame& frame = frames.of[blockIdx.y];
    const float *now = frame.past[0], *before = frame.past[1], *oldest = frame.past[2];
    const float a = (now[k] - before[k]) - (before[k] - oldest[k]);
    frame.further[point * scales.further + column + axis] =
        (a - standard.mean[axis]) / standard.std[axis];
}

// How a point lies to a box: distance to the surface (m; negative inside), outward normal and face, in the
// order of `Obstacle::friction`.
struct Contact {
    float distance, normal[DIMENSIONS];
    int face;
};

__device__ Contact contact_with(const Placed& box, const float* x) {
    Contact contact;
    float square = 0.0f;
    for (int k = 0; k < DIMENSIONS; ++k) {
        contact.normal[k] = x[k] - fminf(fmaxf(x[k], box.low[k]), box.high[k]);
        square = __fadd_rn(square, __fmul_rn(contact.normal[k], contact.normal[k]));
    }
    if (square > 0.0f) {
        contact.distance = sqrtf(square);
        const int axis = fabsf(contact.normal[1]) >= fabsf(contact.normal[0]);
        contact.face = 2 * axis + (contact.normal[axis] > 0.0f);
        for (int k = 0; k < DIMENSIONS; ++k) {
            contact.normal[k] /= contact.distance;
        }
        return contact;
    }
    contact.face = 0;
    float depth = x[0] - box.low[0];
    for (int face = 1; face < 4; ++face) {
        const int k = face / 2;
        const float other = face % 2 ? box.high[k] - x[k] : x[k] - box.low[k];
        if (other < depth) {
            depth = other;
            contact.face = face;
        }
    }
    contact.distance = -depth;
    for (int k = 0; k < DIMENSIONS; ++k) {
        contact.normal[k] = k != contact.face / 2 ? 0.0f : contact.face % 2 ? 1.0f : -1.0f;
    }
    return contact;
}

// The nearest surface of a fixed box and that of a moving one, standardised, into columns of the further
// features: the twin of `surfaces` in Rust.
extern "C" __global__ void surfaces(
    unsigned points, Scales scales, const __grid_constant__ Frames frames, Obstacles obstacles,
    SurfaceStandard standard, int column) {
    const unsigned point = blockIdx.x * blockDim.x + threadIdx.x;
    if (point >= points) {
        return;
    }
    const Frame& frame = frames.of[blockIdx.y];
    const float* x = frame.past[0] + point * DIMENSIONS;
    const unsigned window = obstacles.window[point];
    float values[SURFACE_COLUMNS] = {};
    const float infinity = __int_as_float(0x7f800000);
    float nearest[2] = {infinity, infinity};
    for (unsigned o = obstacles.first[window]; o < obstacles.first[window + 1]; ++o) {
        const Placed box = placed(obstacles.all[o], frame.back);
        const int moving = !is_fixed(obstacles.all[o]);
        const Contact contact = contact_with(box, x);
        if (!(contact.distance <= scales.radius) || !(contact.distance < nearest[moving])) {
            continue;
        }
        nearest[moving] = contact.distance;
        const float close = fminf(1.0f - contact.distance / scales.radius, 2.0f);
        float* out = values + (moving ? 4 : 0);
        *out++ = close;
        for (int k = 0; k < DIMENSIONS; ++k) {
            *out++ = __fmul_rn(close, contact.normal[k]);
        }
        for (int k = 0; moving && k < DIMENSIONS; ++k) {
            *out++ = __fmul_rn(close, box.velocity[k]);
        }
        *out = __fmul_rn(close, obstacles.all[o].friction[contact.face]);
    }
    float* out = frame.further + point * scales.further + column;
    for (int k = 0; k < SURFACE_COLUMNS; ++k) {
        out[k] = (values[k] - standard.mean[k]) / standard.std[k];
    }
}

// Makes the next frame the newest of all windows: the twin of `Obstacle::advance` in Rust.
extern "C" __global__ void advance_obstacles(unsigned count, Obstacle* obstacles) {
    const unsigned o = blockIdx.x * blockDim.x + threadIdx.x;
    if (o < count) {
        obstacles[o].elapsed += 1.0;
    }
}

// [velocity of the sender less that of the receiver,] direction from receiver to sender (GNS:
// displacement / radius), distance. Velocities are known of later frames of a TGNNS.
extern "C" __global__ void edge_features(Scales scales, const __grid_constant__ Frames frames) {
    const Frame& frame = frames.of[blockIdx.y];
    const unsigned edge = blockIdx.x * blockDim.x + threadIdx.x;
    if (edge >= frame.edges[0]) {
        return;
    }
    const bool moving = !scales.gns && frame.known > 1;
    const float *now = frame.past[0], *before = frame.past[1];
    const unsigned receiver = frame.receivers[edge] * DIMENSIONS;
    const unsigned sender = frame.senders[edge] * DIMENSIONS;
    float* out = frame.edge + edge * (moving ? 2 * DIMENSIONS + 1 : DIMENSIONS + 1);
    float displacement[DIMENSIONS];
    float square = 0.0f;
    for (int k = 0; k < DIMENSIONS; ++k) {
        displacement[k] = now[sender + k] - now[receiver + k];
        square = __fadd_rn(square, __fmul_rn(displacement[k], displacement[k]));
        if (moving) {
            const float of_sender = now[sender + k] - before[sender + k];
            const float of_receiver = now[receiver + k] - before[receiver + k];
            *out++ = (of_sender - of_receiver) / scales.velocity_std[k];
        }
    }
    const float distance = sqrtf(square);
    // Points at the same place have direction 0.
    const float unit = distance > 0.0f && !scales.gns ? distance : scales.radius;
    for (int k = 0; k < DIMENSIONS; ++k) {
        *out++ = displacement[k] / unit;
    }
    *out = distance / scales.radius;
}
