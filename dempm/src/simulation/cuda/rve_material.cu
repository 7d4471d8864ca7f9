// From the state of the packings to stress and volume of the points.

// `State` of dem's `rve.cu`.
struct State {
    double stress[4];
    double area, solid_fraction, coordination, relative_overlap, min_width;
    unsigned searches, free, thin, unused;
};
static_assert(sizeof(State) == STATE_BYTES, "laid out as on the host");

// What happened to one packing at the limits of the method, over all steps.
struct Tally {
    u64 free_steps, thin_steps, overlap_steps, searches;
    double max_overlap, min_width;
};
static_assert(sizeof(Tally) == TALLY_BYTES, "laid out as on the host");

__device__ inline void count(Tally& tally, const State& state, double overlap_warning) {
    tally.searches += state.searches;
    if (state.free) {
        tally.free_steps += 1;
        return;
    }
    tally.thin_steps += state.thin != 0;
    tally.overlap_steps += state.relative_overlap > overlap_warning;
    tally.max_overlap = fmax(tally.max_overlap, state.relative_overlap);
    tally.min_width = fmin(tally.min_width, state.min_width);
}

// `failed` holds the first packing that failed of every `chunk` packings, counted within them.
extern "C" __global__ void rve_response(const Mpm m, const State* states, const int* failed,
                                        int chunk, const double* volume_per_area, Tally* tally,
                                        double overlap_warning) {
    const int p = point_of_thread(m);
    if (p == NOBODY) return;
    const State state = states[p];
    count(tally[p], state, overlap_warning);
    // Compression is positive in the RVE, tension in the MPM.
    const double* s = state.stress;
    m.stress[p] = {-s[0], -s[1], -s[2], -s[3]};
    // The RVE's cell is the one source of truth for volume.
    m.volume[p] = volume_per_area[p] * state.area;
    if (failed[p / chunk] == p % chunk) {
        raise(m, m.stress_phase, p, MATERIAL);
    } else {
        check_response(m, p, m.stress[p], m.volume[p]);
    }
}
