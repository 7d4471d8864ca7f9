// Training windows: mirror images, noise and targets. The CPU twin is in noise.rs.

constexpr double TAU = 6.283185307179586;

struct Walk {
    unsigned long long seed;
    // Standard deviation of the change of the velocity's error in a frame (m/frame²).
    double step;
    // Width of the domain (m), for mirror images.
    double width;
    double acceleration_mean[3], acceleration_std[3];
    unsigned values, frames;
};

struct Member {
    // Number of the window in the training: the noise depends on it and the seed alone.
    unsigned long long place;
    // Acceleration (m/frame²) that targets are relative to.
    double gravity[3];
    // First number of its points in a frame.
    unsigned first;
    unsigned mirror;
};

// Philox4x32-10 (Salmon et al., SC 2011): random bits that depend on counter and key alone.
__device__ uint4 philox(uint4 counter, uint2 key) {
    for (int round = 0; round < 10; ++round) {
        const unsigned low0 = 0xD2511F53u * counter.x, high0 = __umulhi(0xD2511F53u, counter.x);
        const unsigned low1 = 0xCD9E8D57u * counter.z, high1 = __umulhi(0xCD9E8D57u, counter.z);
        counter = make_uint4(high1 ^ counter.y ^ key.x, low1, high0 ^ counter.w ^ key.y, low0);
        key.x += 0x9E3779B9u;
        key.y += 0xBB67AE85u;
    }
    return counter;
}

// 53 random bits, in [0, 1).
__device__ double uniform(unsigned high, unsigned low) {
    const unsigned long long bits = (unsigned long long)high << 32 | low;
    return double(bits >> 11) * 0x1p-53;
}

// Standard normal deviate number `value` of a frame of a window (Box and Muller).
__device__ double normal(unsigned long long seed, unsigned long long place, unsigned frame,
                         unsigned value) {
    const uint4 bits = philox(
        make_uint4(value, frame, unsigned(place), unsigned(place >> 32)),
        make_uint2(unsigned(seed), unsigned(seed >> 32)));
    const double radius = sqrt(-2.0 * log(1.0 - uniform(bits.x, bits.y)));
    return radius * cos(TAU * uniform(bits.z, bits.w));
}

// `truth` holds frames + 1 frames of all windows. The frames but the last go to `positions`, with the
// errors of a random walk; the last is what should follow. See `Example::add_noise` in
// surrogate/src/data/noise.rs.
extern "C" __global__ void make_windows(
    Walk walk, const Member* members, const unsigned* window, const double* truth,
    float* positions, float* targets) {
    const unsigned value = blockIdx.x * blockDim.x + threadIdx.x;
    if (value >= walk.values) {
        return;
    }
    const unsigned axis = value % DIMENSIONS;
    const Member member = members[window[value / DIMENSIONS]];
    const bool mirror = member.mirror && axis == 0;
    double drift = 0.0, error = 0.0, before = 0.0, last = 0.0;
    for (unsigned frame = 0; frame <= walk.frames; ++frame) {
        double x = truth[frame * (unsigned long long)walk.values + value];
        x = mirror ? walk.width - x : x;
        // The first frame has no velocity before it and stays as it is; the target moves along.
        if (frame > 0 && frame < walk.frames && walk.step > 0.0) {
            const double deviate = normal(walk.seed, member.place, frame, value - member.first);
            drift += __dmul_rn(walk.step, deviate);
            error += drift;
        }
        x += error;
        if (frame < walk.frames) {
            positions[frame * (unsigned long long)walk.values + value] = float(x);
            before = last;
            last = x;
        } else {
            const double gravity = mirror ? -member.gravity[axis] : member.gravity[axis];
            const double acceleration = (x - last) - (last - before) - gravity;
            targets[value] =
                float((acceleration - walk.acceleration_mean[axis]) / walk.acceleration_std[axis]);
        }
    }
}
