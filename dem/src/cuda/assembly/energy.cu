// Energy of the grains: twin of Assembly::energy_of, and the elastic energy of their contacts.

constexpr unsigned SUM_THREADS = 256;
constexpr unsigned ENERGIES = 3;

// Kinetic, potential and elastic energy (J) of each block's grains. Blocks have SUM_THREADS threads.
extern "C" __global__ void __launch_bounds__(SUM_THREADS) assembly_energy(Parameters p, Surroundings around, const Output* grain, unsigned grains, double* energy) {
    __shared__ double sum[ENERGIES][SUM_THREADS / LANES];
    const unsigned i = blockIdx.x * SUM_THREADS + threadIdx.x;
    double own[ENERGIES] = {};
    if (i < grains) {
        const Output& g = grain[i];
        const double mass = 1.0 / double(g.inv_mass);
        const double vx = g.vx, vy = g.vy, spin = double(g.r) * double(g.w);
        own[0] = 0.5 * mass * (vx * vx + vy * vy + 0.5 * spin * spin);
        own[1] = -mass * (around.gravity[0] * position_of(p, g.x, 0) +
                          around.gravity[1] * position_of(p, g.y, 1));
        own[2] = g.elastic;
    }
    for (unsigned n = 0; n < ENERGIES; ++n) {
        const double warp = warp_sum(own[n]);
        if (threadIdx.x % LANES == 0) sum[n][threadIdx.x / LANES] = warp;
    }
    __syncthreads();
    if (threadIdx.x >= ENERGIES) return;
    double block = 0;
    for (unsigned warp = 0; warp < SUM_THREADS / LANES; ++warp) block += sum[threadIdx.x][warp];
    energy[ENERGIES * blockIdx.x + threadIdx.x] = block;
}
