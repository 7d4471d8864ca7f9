// Features of one frame's nodes and edges: the CUDA twin of surrogate/src/features.rs (TGNNS), equal
// to it to the bit.
//
// DIMENSIONS is 2 or 3 (defined by features.rs).

struct Scales {
    float radius;
    float velocity_mean[3], velocity_std[3];
    // Lower and upper wall of each direction (m).
    float bounds[3][2];
};

// The paper's placeholder: a wall farther than the radius is at distance 0.
__device__ float wall_distance(float distance, float radius) {
    return distance > radius ? 0.0f : distance / radius;
}

// [velocity,] distances to the walls. `before` is null in the first frame of a window, whose points
// have no velocity yet.
extern "C" __global__ void node_features(
    unsigned points, Scales scales, const float* now, const float* before, float* features) {
    const unsigned point = blockIdx.x * blockDim.x + threadIdx.x;
    if (point >= points) {
        return;
    }
    const float* x = now + point * DIMENSIONS;
    float* out = features + point * (before ? 3 : 2) * DIMENSIONS;
    if (before) {
        for (int k = 0; k < DIMENSIONS; ++k) {
            const float step = x[k] - before[point * DIMENSIONS + k];
            *out++ = (step - scales.velocity_mean[k]) / scales.velocity_std[k];
        }
    }
    for (int k = 0; k < DIMENSIONS; ++k) {
        *out++ = wall_distance(x[k] - scales.bounds[k][0], scales.radius);
        *out++ = wall_distance(scales.bounds[k][1] - x[k], scales.radius);
    }
}

// [velocity of the sender less that of the receiver,] direction from receiver to sender, distance.
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
    const float unit = distance > 0.0f ? distance : scales.radius;
    for (int k = 0; k < DIMENSIONS; ++k) {
        *out++ = displacement[k] / unit;
    }
    *out = distance / scales.radius;
}
