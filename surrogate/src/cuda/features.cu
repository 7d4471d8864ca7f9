// Features of one frame's nodes and edges: the CUDA twin of surrogate/src/features.rs, equal to it to
// the bit.
//
// DIMENSIONS is 2 or 3, FRAMES the most frames of a History (defined by features.rs).

struct Scales {
    float radius;
    float velocity_mean[3], velocity_std[3];
    // Lower and upper wall of each direction (m).
    float bounds[3][2];
    // Features of the GNS in place of those of the TGNNS.
    int gns;
    // Distances to walls are clamped to one radius.
    int clamped;
    // How far points may be inside an obstacle and still see its face (m).
    float skin;
};

// A fixed box: lower and upper corner (m).
struct Obstacle {
    float low[DIMENSIONS], high[DIMENSIONS];
};

// The obstacles of each window: those from `first[window]` to `first[window + 1]`.
struct Obstacles {
    const Obstacle* all;
    const unsigned* first;
    const unsigned* window;
};

// Positions in the frames whose velocities a node knows, oldest first: the frame itself is the last.
struct History {
    const float* at[FRAMES];
    int count;
};

// Features beyond velocity and walls, points x columns.
struct Further {
    float* values;
    int columns;
};

// In radii. The paper's placeholder: a wall farther than the radius is at distance 0.
__device__ float wall_distance(float distance, const Scales& scales) {
    const float scaled = distance / scales.radius;
    if (scales.clamped) return fminf(fmaxf(scaled, -1.0f), 1.0f);
    return distance > scales.radius ? 0.0f : scaled;
}

// Whether an obstacle is in the way of a point that moves in direction k.
__device__ bool in_the_way(const Obstacle& box, const float* x, int k, float skin) {
    bool yes = true;
    for (int j = 0; j < DIMENSIONS; ++j) {
        yes = yes && (j == k || !(x[j] <= box.low[j] + skin || x[j] >= box.high[j] - skin));
    }
    return yes;
}

// Velocities, distances to the walls, further features.
extern "C" __global__ void node_features(
    unsigned points, Scales scales, History history, Obstacles obstacles, Further further,
    float* features) {
    const unsigned point = blockIdx.x * blockDim.x + threadIdx.x;
    if (point >= points) {
        return;
    }
    const unsigned first = point * DIMENSIONS;
    float* out = features + point * ((history.count + 1) * DIMENSIONS + further.columns);
    for (int frame = 1; frame < history.count; ++frame) {
        for (int k = 0; k < DIMENSIONS; ++k) {
            const float step = history.at[frame][first + k] - history.at[frame - 1][first + k];
            *out++ = (step - scales.velocity_mean[k]) / scales.velocity_std[k];
        }
    }
    const float* x = history.at[history.count - 1] + first;
    const unsigned window = obstacles.window[point];
    for (int k = 0; k < DIMENSIONS; ++k) {
        float below = x[k] - scales.bounds[k][0], above = scales.bounds[k][1] - x[k];
        for (unsigned o = obstacles.first[window]; o < obstacles.first[window + 1]; ++o) {
            const Obstacle box = obstacles.all[o];
            if (in_the_way(box, x, k, scales.skin)) {
                const float over = x[k] - box.high[k], under = box.low[k] - x[k];
                if (over >= -scales.skin) below = fminf(below, fmaxf(over, 0.0f));
                if (under >= -scales.skin) above = fminf(above, fmaxf(under, 0.0f));
            }
        }
        *out++ = wall_distance(below, scales);
        *out++ = wall_distance(above, scales);
    }
    for (int k = 0; k < further.columns; ++k) {
        *out++ = further.values[point * further.columns + k];
    }
}

// For each point, how many of its window are above it and no farther than half a radius to any side,
// standardised, into a column of the further features: the twin of `overburden` in
// surrogate/src/node_features.rs. A warp for each point.
extern "C" __global__ void overburden(
    unsigned points, const unsigned* window, float radius, const float* now, float mean, float std,
    Further further, int column) {
    const unsigned point = (blockIdx.x * blockDim.x + threadIdx.x) / 32, lane = threadIdx.x % 32;
    if (point >= points) {
        return;
    }
    const float half = radius / 2.0f;
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
        further.values[point * further.columns + column] = (float(above) - mean) / std;
    }
}

// What makes a vector standard.
struct Standard {
    float mean[3], std[3];
};

// Accelerations from the positions in a frame and the two before it, standardised, into columns of
// the further features: the twin of `moving_features` in surrogate/src/node_features.rs.
extern "C" __global__ void acceleration(
    unsigned points, const float* oldest, const float* before, const float* now,
    Standard standard, Further further, int column) {
    const unsigned k = blockIdx.x * blockDim.x + threadIdx.x;
    if (k >= points * DIMENSIONS) {
        return;
    }
    const unsigned point = k / DIMENSIONS, axis = k % DIMENSIONS;
    const float a = (now[k] - before[k]) - (before[k] - oldest[k]);
    further.values[point * further.columns + column + axis] =
        (a - standard.mean[axis]) / standard.std[axis];
}

// [velocity of the sender less that of the receiver,] direction from receiver to sender (GNS:
// displacement / radius), distance. `before` are the positions in the frame before, or null.
extern "C" __global__ void edge_features(
    const unsigned* edges, const unsigned* receivers, const unsigned* senders, Scales scales,
    const float* now, const float* before, float* features) {
    const unsigned edge = blockIdx.x * blockDim.x + threadIdx.x;
    if (edge >= edges[0]) {
        return;
    }
    const unsigned receiver = receivers[edge] * DIMENSIONS, sender = senders[edge] * DIMENSIONS;
    float* out = features + edge * (before ? 2 * DIMENSIONS + 1 : DIMENSIONS + 1);
    float displacement[DIMENSIONS];
    float square = 0.0f;
    for (int k = 0; k < DIMENSIONS; ++k) {
        displacement[k] = now[sender + k] - now[receiver + k];
        square = __fadd_rn(square, __fmul_rn(displacement[k], displacement[k]));
        if (before) {
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
