// States of the grains for output: twin of dem/src/assembly/output.rs.

__device__ inline void add(const Parameters& p, const Contact& c, const Memory& memory, Real share,
                           Output& out) {
    const Real tangential = sliding_of(memory).spring;
    const Real normal =
        max(spring_and_dashpot(p.normal_stiffness, c.overlap, c.dashpot, c.vn), Real(0));
    const Real fx = normal * c.nx - tangential * c.ny;
    const Real fy = normal * c.ny + tangential * c.nx;
    out.virial[0] += fx * c.arm * c.nx;
    out.virial[1] += fx * c.arm * c.ny;
    out.virial[2] += fy * c.arm * c.nx;
    out.virial[3] += fy * c.arm * c.ny;
    // 1 / (2 kt) is compliance times the step.
    out.elastic += share * (Real(0.5) * p.normal_stiffness * c.overlap * c.overlap +
                            p.compliance * p.step * tangential * tangential);
#if ROLLING
    const Real spring = memory.rolling.spring;
    out.elastic += share * (p.rolling_compliance * p.step * spring * spring);
#endif
    out.contacts += 1;
}

// States in the order of identities.
extern "C" __global__ void assembly_output(Arrays a, Parameters p, Output* output) {
    const unsigned i = blockIdx.x * blockDim.x + threadIdx.x;
    if (i >= p.discs) return;
    const Control& control = *a.control;
    const Disc* now = discs_after(a, p, control.steps);
    const Disc disc = now[i];
    if (disc.place.inv_mass == Real(0)) return;
    Output out = {};
    out.x = disc.place.x;
    out.y = disc.place.y;
    out.r = disc.place.r;
    out.inv_mass = disc.place.inv_mass;
    out.vx = disc.motion.x;
    out.vy = disc.motion.y;
    out.w = disc.motion.w;
    const unsigned info = unsigned(disc.motion.info);
    for (unsigned row = 0; row < (info & ROWS_MASK); ++row) {
        const size_t at = size_t(row) * p.row + i;
        const Disc other = now[a.list[at]];
        const Vec l = separation(p, disc.place, other.place);
        const Real distance2 = l.x * l.x + l.y * l.y;
        const Real reach = disc.place.r + other.place.r;
        if (distance2 >= reach * reach) continue;
        const bool touched = info >> (FIRST_ROW + row) & 1u;
        const Memory memory = touched ? memory_at(p, a.history[at], ROWS) : Memory{};
        // A pair counts once: half for each disc, all of it for one beside a fixed disc.
        const Real share = other.place.inv_mass == Real(0) ? Real(1) : Real(0.5);
        add(p, contact_of(p, disc, other, l, distance2), memory, share, out);
    }
    if ((info & BODIES_NEAR) != 0) {
        const unsigned near = a.near_bodies[i];
        for (unsigned k = 0; k < 4; ++k) {
            const unsigned index = near >> (8 * k) & 255u;
            if (index == NO_BODY) break;
            const PlacedBody& body = bodies_after(a, p, control.steps)[index];
            const Vec l = branch_to(p, body, disc.place);
            const Real distance2 = l.x * l.x + l.y * l.y;
            if (distance2 == Real(0) || distance2 >= disc.place.r * disc.place.r) continue;
            const Memory memory = 
                memory_at(p, a.body_history[size_t(k) * p.row + i], NEAR_BODIES);
            add(p, contact_with(p, disc, body, l, distance2), memory, Real(1), out);
        }
    }
    output[a.id[i]] = out;
}
