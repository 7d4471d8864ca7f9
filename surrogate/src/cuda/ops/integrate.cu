// One step of a rollout: network output -> acceleration -> semi-implicit Euler -> constraints. The
// CUDA twin of `Rollout::advance` in Rust, equal to it to the bit.
// Follows constraints.cu in one source. `Setup` and `Clock` are defined in integrate.rs.

// Acceleration that the network predicts for a row, in m/frame².
__device__ double acceleration(const Setup& setup, const float* output, unsigned row, int k,
                               double fall) {
    return product(double(output[2 * row + k]), setup.scale[k]) + setup.mean[k] + fall;
}

// `failed` is the lowest frame << 32 | point of a position that makes no sense; it is left in the
// history as it was predicted. `position` gets the frame in single precision, for the network, and
// behind it the images, if there are any.
extern "C" __global__ void integrate(
    Setup setup, const RigidBox* boxes, const float* output, double* history, float* position,
    Clock* clock, unsigned long long* failed) {
    const unsigned frame = clock->frame, made = clock->made;
    const unsigned point = blockIdx.x * blockDim.x + threadIdx.x;
    if (point < setup.points) {
        const unsigned values = 2 * setup.points;
        const unsigned long long rows = setup.rows;
        double* next = history + made % rows * values + 2 * point;
        const double* last = history + (made + rows - 1) % rows * values + 2 * point;
        const double* before = history + (made + rows - 2) % rows * values + 2 * point;
        Pair old, free;
        double beyond = 0.0;
        bool finite = true;
        for (int k = 0; k < 2; ++k) {
            double a = acceleration(setup, output, point, k, setup.fall[k]);
            if (setup.mirror) {
                const double sign = k == 0 ? -1.0 : 1.0;
                const unsigned image = setup.points + point;
                a = (a + sign * acceleration(setup, output, image, k, sign * setup.fall[k])) / 2.0;
            }
            old.x[k] = last[k];
            free.x[k] = last[k] + (last[k] - before[k] + a);
            finite = finite && isfinite(free.x[k]);
            beyond = fmax(beyond, fmax(-free.x[k], free.x[k] - setup.domain[k]));
        }
        if (!finite || beyond > setup.reach) {
            atomicMin(failed, (unsigned long long)frame << 32 | point);
        } else {
            const double times[2] = {
                setup.start + product(double(frame - 1), setup.interval),
                setup.start + product(double(frame), setup.interval)};
            free = confine(boxes, setup.boxes, setup.domain, old, free, times);
        }
        for (int k = 0; k < 2; ++k) {
            next[k] = free.x[k];
            position[2 * point + k] = float(free.x[k]);
        }
        if (setup.mirror) {
            float* image = position + 2 * (setup.points + point);
            image[0] = float(setup.domain[0]) - float(free.x[0]);
            image[1] = float(free.x[1]);
        }
    }
    // The last block to come here sets the clock.
    __syncthreads();
    if (threadIdx.x == 0 && atomicAdd(&clock->blocks, 1u) == gridDim.x - 1) {
        *clock = Clock{frame + 1, made + 1, 0, 0};
    }
}
