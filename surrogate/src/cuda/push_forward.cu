// Pushforward: moves windows on with what the network says of them. The CUDA twin of
// `Draft::push_forward` in surrogate/src/data/draft.rs, equal to it to the bit.

// A thread for each of `values` coordinates, x and y of the points in turn. `window` is that of each
// point, `mean` and `std` make accelerations (m/frame^2) of what is said; `last` are the last two frames
// of the windows in double precision, `positions` all of their `frames` frames. After the last step
// `targets` is not null and gets the accelerations to learn: those that lead to the velocity between the
// two frames of `truth`, standardised.
extern "C" __global__ void push_forward(
    unsigned values, unsigned frames, const unsigned* window, const double* mean, double std_x,
    double std_y, const float* said, double* last, float* positions, const double* truth,
    float* targets) {
    const unsigned i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= values) {
        return;
    }
    const double mine = mean[2 * window[i / 2] + i % 2], std = i % 2 ? std_y : std_x;
    const double acceleration = __dadd_rn(__dmul_rn(double(said[i]), std), mine);
    const double before = last[values + i];
    const double now = before + (before - last[i]) + acceleration;
    last[i] = before;
    last[values + i] = now;
    for (unsigned frame = 1; frame < frames; ++frame) {
        positions[(frame - 1) * values + i] = positions[frame * values + i];
    }
    positions[(frames - 1) * values + i] = float(now);
    if (targets) {
        const double next = now + (truth[values + i] - truth[i]);
        targets[i] = float((next - now - (now - before) - mine) / std);
    }
}
