// Means over the grains of points: twin of dem/src/assembly/point_mean.rs, in double precision. Grains are those of
// the output, in the order of identities; their bins are those of the search, which are free between two sequences.

// Where the Gaussian ends, in widths.
constexpr double REACH = 3.0;
constexpr double PI = 3.141592653589793;

// Puts every grain into its bin, and writes how far it extends. A full bin leaves grains out: the next search reports
// it.
extern "C" __global__ void assembly_mean_bins(Arrays a, Parameters p, const Output* grain, unsigned grains,
                                              unsigned* count, Extent* extent) {
    const unsigned i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= grains) return;
    extent[i] = {grain[i].x, grain[i].r};
    const unsigned bin = bin_index(p, bin_x(p, grain[i].x), bin_y(p, grain[i].y));
    const unsigned slot = atomicAdd(&count[bin], 1u);
    if (slot < p.capacity) {
        a.binned[size_t(bin) * p.capacity + slot] = {grain[i].x, grain[i].y, grain[i].r, i};
    }
}

// Sorts the grains of every bin by identity, so that sums have the same bits from run to run.
extern "C" __global__ void assembly_mean_order(Arrays a, Parameters p, const unsigned* count) {
    const unsigned bin = blockIdx.x * blockDim.x + threadIdx.x;
    if (bin >= bins_in_all(p)) return;
    Binned* grain = a.binned + size_t(bin) * p.capacity;
    const unsigned grains = min(count[bin], p.capacity);
    for (unsigned n = 1; n < grains; ++n) {
        const Binned moving = grain[n];
        unsigned k = n;
        for (; k > 0 && grain[k - 1].disc > moving.disc; --k) grain[k] = grain[k - 1];
        grain[k] = moving;
    }
}

// Lanes of a warp that share the surroundings of one sample.
constexpr unsigned SHARE = LANES / SAMPLES;
static_assert(SHARE * SAMPLES == LANES, "every sample has as many lanes");

// The sum over the lanes of a share, in a fixed order.
__device__ inline double share_sum(double x) {
    for (unsigned d = SHARE / 2; d > 0; d /= 2) x += __shfl_xor_sync(ALL, x, int(d));
    return x;
}

// Solid fraction and velocity gradient around a place, for all lanes of a share: CoarseGraining::flow_at.
struct Flow {
    double solid_fraction;
    double gradient[4];
};

__device__ inline Flow flow_at(const Arrays& a, const Parameters& p, const Surroundings& around,
                               const Output* grain, const unsigned* count, Fraction x, Fraction y) {
    const double unit = p.side / PERIOD;
    const double bins = double(p.bins) / PERIOD;
    const double reach = REACH * around.width;
    const double reach_in_bins = reach * p.bins / p.side;
    const double width2 = around.width * around.width;
    // Normalises the Gaussian within its reach.
    const double peak = 1.0 / (2.0 * PI * width2 * (1.0 - exp(-0.5 * REACH * REACH)));
    const auto first = [&](Fraction s) { return unsigned(max(s * bins - reach_in_bins, 0.0)); };
    const auto last = [&](Fraction s, unsigned tiles) {
        return min(unsigned(s * bins + reach_in_bins), tiles * TILE - 1);
    };
    const unsigned left = first(x), bottom = first(y);
    const unsigned columns = last(x, p.tiles[0]) - left + 1;
    const unsigned rows = last(y, p.tiles[1]) - bottom + 1;
    double mass = 0, area = 0, momentum[2] = {}, mass_moment[2] = {}, momentum_moment[4] = {};
    for (unsigned k = threadIdx.x % SHARE; k < columns * rows; k += SHARE) {
        const unsigned bin = bin_index(p, left + k % columns, bottom + k / columns);
        const unsigned grains = min(count[bin], p.capacity);
        for (unsigned n = 0; n < grains; ++n) {
            const Binned other = a.binned[size_t(bin) * p.capacity + n];
            const double lx = unit * double(Signed(x - other.x));
            const double ly = unit * double(Signed(y - other.y));
            const double square = lx * lx + ly * ly;
            if (square >= reach * reach) continue;
            const Output& moving = grain[unsigned(other.disc)];
            const double weight = peak * exp(-0.5 * square / width2);
            const double r = double(other.r);
            const double m = weight / double(moving.inv_mass);
            mass += m;
            area += weight * PI * r * r;
            momentum[0] += m * moving.vx;
            momentum[1] += m * moving.vy;
            mass_moment[0] += m * lx;
            mass_moment[1] += m * ly;
            momentum_moment[0] += m * moving.vx * lx;
            momentum_moment[1] += m * moving.vx * ly;
            momentum_moment[2] += m * moving.vy * lx;
            momentum_moment[3] += m * moving.vy * ly;
        }
    }
    mass = share_sum(mass);
    area = share_sum(area);
    for (int k = 0; k < 2; ++k) momentum[k] = share_sum(momentum[k]);
    for (int k = 0; k < 2; ++k) mass_moment[k] = share_sum(mass_moment[k]);
    for (int k = 0; k < 4; ++k) momentum_moment[k] = share_sum(momentum_moment[k]);
    Flow flow = {area, {}};
    for (int k = 0; k < 4; ++k) {
        const double difference = momentum[k / 2] / mass * mass_moment[k % 2] - momentum_moment[k];
        flow.gradient[k] = difference / (mass * width2);
    }
    return flow;
}

// Part of a Gaussian between two edges.
__device__ inline double between(double x, double width, double from, double to) {
    const double scale = 1.0 / (width * sqrt(2.0));
    return 0.5 * (erf((to - x) * scale) - erf((from - x) * scale));
}

// Part of a Gaussian that lies inside the domain and outside of boxes: free_share of the CPU.
__device__ inline double free_share(const Surroundings& around, const Box* box, double x, double y) {
    const double w = around.width;
    double share = between(x, w, 0.0, around.size[0]) * between(y, w, 0.0, around.size[1]);
    for (unsigned b = 0; b < around.boxes; ++b) {
        const Box& of = box[b];
        if (x <= of.min[0] - REACH * w || x >= of.max[0] + REACH * w) continue;
        if (y <= of.min[1] - REACH * w || y >= of.max[1] + REACH * w) continue;
        // Parts of a box outside of the domain count once.
        const double left = max(of.min[0], 0.0), right = min(of.max[0], around.size[0]);
        const double low = max(of.min[1], 0.0), high = min(of.max[1], around.size[1]);
        if (left < right && low < high) {
            share -= between(x, w, left, right) * between(y, w, low, high);
        }
    }
    return share;
}

// One warp for each point.
extern "C" __global__ void assembly_means(Arrays a, Parameters p, Surroundings around, const Box* box, const Output* grain,
                                          const unsigned* count, const unsigned* start, const unsigned* member,
                                          unsigned points, PointMean* mean) {
    const unsigned point = (blockIdx.x * blockDim.x + threadIdx.x) / LANES;
    const unsigned lane = threadIdx.x % LANES;
    if (point >= points) return;
    const unsigned* own = member + start[point];
    const unsigned members = start[point + 1] - start[point];

    double mass = 0, area = 0, contacts = 0, moment[2] = {}, momentum[2] = {}, pressure[4] = {};
    for (unsigned n = lane; n < members; n += LANES) {
        const Output& g = grain[own[n]];
        const double m = 1.0 / (double(g.inv_mass) * around.mass_scale);
        const double v[2] = {double(g.vx), double(g.vy)};
        mass += m;
        area += PI * double(g.r) * double(g.r);
        contacts += g.contacts;
        moment[0] += m * position_of(p, g.x, 0);
        moment[1] += m * position_of(p, g.y, 1);
        for (int k = 0; k < 2; ++k) momentum[k] += m * v[k];
        for (int k = 0; k < 4; ++k) pressure[k] += double(g.virial[k]) + m * v[k / 2] * v[k % 2];
    }
    const unsigned step = (members + SAMPLES - 1) / SAMPLES;
    double sampled = 0, occupied = 0, gradient[4] = {};
    // All lanes take part in the sums: those without a sample of their own repeat the first one.
    const unsigned sample = lane / SHARE * step;
    const Output& g = grain[own[sample < members ? sample : 0]];
    const Flow flow = flow_at(a, p, around, grain, count, g.x, g.y);
    if (lane % SHARE == 0 && sample < members) {
        const double free = free_share(around, box, position_of(p, g.x, 0), position_of(p, g.y, 1));
        sampled = PI * double(g.r) * double(g.r);
        occupied = sampled * free / flow.solid_fraction;
        for (int k = 0; k < 4; ++k) gradient[k] = sampled * flow.gradient[k];
    }

    mass = warp_sum(mass);
    area = warp_sum(area);
    contacts = warp_sum(contacts);
    sampled = warp_sum(sampled);
    occupied = warp_sum(occupied);
    for (int k = 0; k < 2; ++k) moment[k] = warp_sum(moment[k]);
    for (int k = 0; k < 2; ++k) momentum[k] = warp_sum(momentum[k]);
    for (int k = 0; k < 4; ++k) pressure[k] = warp_sum(pressure[k]);
    for (int k = 0; k < 4; ++k) gradient[k] = warp_sum(gradient[k]);
    if (lane != 0) return;
    PointMean out;
    const double volume = area * occupied / sampled;
    for (int k = 0; k < 2; ++k) out.position[k] = moment[k] / mass;
    for (int k = 0; k < 2; ++k) out.velocity[k] = momentum[k] / mass;
    for (int k = 0; k < 4; ++k) out.velocity_gradient[k] = gradient[k] / sampled;
    for (int k = 0; k < 4; ++k) pressure[k] -= momentum[k / 2] * out.velocity[k % 2];
    const double shear = 0.5 * (pressure[1] + pressure[2]);
    const double per_volume = -1.0 / (volume * around.thickness);
    // Compression is positive in the DEM, tension at points.
    out.stress[0] = per_volume * pressure[0];
    out.stress[1] = per_volume * shear;
    out.stress[2] = per_volume * shear;
    out.stress[3] = per_volume * pressure[3];
    out.mass = mass / around.thickness;
    out.volume = volume;
    out.solid_fraction = area / volume;
    out.coordination = contacts / members;
    mean[point] = out;
}
