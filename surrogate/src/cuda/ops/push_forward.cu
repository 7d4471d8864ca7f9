// Pushforward: moves windows on with the network's predictions. The CUDA twin of
// `Examples::push_forward` in Rust, equal to it to the bit. Arguments are described in push_forward.rs.

// A thread for each value. After the last step `targets` is not null and gets the accelerations to learn:
// those that lead to the velocity between the two frames of `truth`, standardised.
extern "C" __global__ void push_forward(
    unsigned values, unsigned frames, const unsigned* window, const double* mean, double std_x,
    double std_y, const float* predicted, double* last, float* positions, const double* truth,
    float* targets) {
    const unsigned i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= values) {
        return;
    }
    const double mine = mean[2 * window[i / 2] + i % 2], std = i % 2 ? std_y : std_x;
    const double acceleration = __dadd_rn(__dmul_rn(double(predicted[i]), std), mine);
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
