// From the state of the packings to stress and volume of the points.

__device__ inline void count(DeviceTally& tally, const State& state, double overlap_warning) {
    tally.searches += state.searches;
    if (state.free) {
        tally.free_steps += 1;
        return;
    }
    tally.thin_steps += state.thin != 0;
    tally.dense_steps += state.dense != 0;
    tally.overlap_steps += state.relative_overlap > overlap_warning;
    tally.max_overlap = fmax(tally.max_overlap, state.relative_overlap);
    tally.min_width = fmin(tally.min_width, state.min_width);
}

// `failed` holds the first packing that failed of every `chunk` packings, counted within them.
extern "C" __global__ void rve_response(const Mpm m, const State* states, const int* failed,
                                        int chunk, const double* volume_per_area, DeviceTally* tally,
                                        double overlap_warning) {
    const int p = point_of_thread(m);
    if (p == NOBODY) return;
    const State state = states[p];
    count(tally[p], state, overlap_warning);
    // Compression is positive in the RVE, tension in the MPM.
    const Tensor s = state.stress;
    m.stress[p] = {-s.xx, -s.xy, -s.yx, -s.yy};
    // The RVE's cell is the one source of truth for volume.
    m.volume[p] = volume_per_area[p] * state.area;
    if (failed[p / chunk] == p % chunk) {
        raise(m, m.stress_phase, p, MATERIAL);
    } else {
        check_response(m, p, m.stress[p], m.volume[p]);
    }
}
