// Contact forces and motion: twin of dem/src/contact.rs and dem/src/integrate.rs.

// What a thread adds up for the whole RVE.
struct Totals {
    Virial virial;
    // Largest overlap over the smaller radius, of pairs owned in this seat.
    Real relative_overlap;
    // Touching pairs that the disc owns, in the last substep.
    int contacts;
#if UNEQUAL
    // Their overlaps (m), and the resultant of all contact forces on the disc (N).
    Real overlap, resultant;
#endif
};

// Minus the force (N) and minus the torque (N m) on a disc.
struct Resistance {
    Real x, y, torque;
};

template <class T>
__device__ inline const T& at(const T* array, unsigned offset) {
    return *reinterpret_cast<const T*>(reinterpret_cast<const unsigned char*>(array) + offset);
}

// What a thread keeps of its disc while substeps last.
struct Seated {
    Body body;
    Real half_w;
    Real r;
    // Step over mass (s/kg), and half of step over inertia.
    Real kick, half_twist;
};

// Evaluates the pairs that a disc owns. Pairs that do not touch go along with those that do: hardly
// ever does none of a warp.
template <bool IMAGED, bool SAMPLED>
__device__ inline Resistance contact_forces(const Parameters& p, const Real* cell,
                                            const Real* drive, const Seated& disc, int slot,
                                            int end, Totals& total) {
    Shared& sh = shared();
    Resistance sum = {};
    const Real r = disc.r;
    const Real h0 = cell[0], h1 = cell[1], h2 = cell[2], h3 = cell[3];
#pragma unroll 1
    for (; slot < end; slot += LANES) {
        const unsigned word = sh.slot.neighbour[slot];
        const Vec pair = sh.slot.pair[slot];
        const unsigned offset = IMAGED ? word & 0xffffu : word;
        const Body other = at(sh.body, 2 * offset);
        const Real other_half_w = at(sh.half_w, offset / 2);
        const Vec d = separation<IMAGED>(disc.body.s, other.s, word);
        const Real lx = h0 * d.x + h1 * d.y;
        const Real ly = h2 * d.x + h3 * d.y;
        const Real distance2 = lx * lx + ly * ly;
        const Real touch = pair.x;
        const bool touching = distance2 < touch * touch;
        const Vec length = length_and_inverse<Vec>(distance2);
        const Real nx = lx * length.y;
        const Real ny = ly * length.y;
        const Real overlap = touch - length.x;

        // v = u_j - u_i + L l, normal and along tau = (-n_y, n_x), where both discs turn about arms
        // r - overlap / 2.
        const Real vx = other.u.x - disc.body.u.x + drive[0] * lx + drive[1] * ly;
        const Real vy = other.u.y - disc.body.u.y + drive[2] * lx + drive[3] * ly;
        const Real other_r = touch - r;
        const Real arm = r - Real(0.5) * overlap;
        const Real other_arm = other_r - Real(0.5) * overlap;
        const Real vn = vx * nx + vy * ny;
        const Real vt =
            (vy * nx - vx * ny) - Real(2) * (arm * disc.half_w + other_arm * other_half_w);

        // Without a normal force there is no tangential one.
        const Real elastic = spring_and_dashpot(p.normal_stiffness, overlap, pair.y, vn);
        const Real normal = touching ? max(elastic, Real(0)) : Real(0);
        const Real tangential = tangential_force(sh.slot.tangential[slot], p.spring, vt,
                                                 p.friction * normal);

        const Vec force = {normal * nx - tangential * ny, normal * ny + tangential * nx};
        sum.x += force.x;
        sum.y += force.y;
        sum.torque += tangential * arm;
#if ROLLING
        const Real radius = ratio(r * other_r, touch);
        const Real vr = Real(2) * radius * (other_half_w - disc.half_w);
        const RollingForces rolling =
            rolling_forces(sh.slot.rolling[slot], p.rolling_spring, p.rolling_dashpot * pair.y, vr,
                           p.rolling_friction * normal);
        const Real resisting = radius * rolling.total;
        sum.torque += resisting;
        sh.slot.rolling[slot] = rolling.spring;
#endif
        total.relative_overlap = max(total.relative_overlap, ratio(overlap, min(r, other_r)));
        if (SAMPLED) {
            total.virial.xx += force.x * lx;
            total.virial.yy += force.y * ly;
            total.virial.shear += force.x * ly;
            total.virial.shear += force.y * lx;
            total.contacts += touching;
#if UNEQUAL
            total.overlap += touching ? overlap : Real(0);
#endif
        }
        sh.slot.tangential[slot] = tangential;
        sh.reaction.force[slot] = force;
#if ROLLING
        sh.reaction.torque[slot] = tangential * other_arm - resisting;
#else
        sh.reaction.torque[slot] = tangential * other_arm;
#endif
    }
    return sum;
}

// Adds the reactions of the pairs that the disc does not own.
__device__ inline void add_reactions(Resistance& sum, int slot, int end) {
    const Shared& sh = shared();
#pragma unroll 1
    for (; slot < end; slot += LANES) {
        const unsigned at_owner = sh.slot.incoming[slot];
        const Vec force = sh.reaction.force[at_owner];
        sum.x -= force.x;
        sum.y -= force.y;
        sum.torque += sh.reaction.torque[at_owner];
    }
}

// The thread, read anew: kept, it would be spilled, and shared memory and spills share a path.
__device__ inline int seat() {
    int t;
    asm volatile("mov.u32 %0, %%tid.x;" : "=r"(t));
    return t;
}

// One DEM step: forces at the present positions, then motion.
template <bool IMAGED, bool SAMPLED>
__device__ inline void substep(const Parameters& p, const Substep& now, const Real* drive,
                               Seated& disc, Totals& total) {
    Shared& sh = shared();
    const Control& c = sh.control;
    Vec& u = disc.body.u;
    Position& x = disc.body.s;
    if (SAMPLED) {
        total.virial.xx *= c.growth;
        total.virial.yy *= c.growth;
        total.virial.shear *= c.growth;
        total.contacts = 0;
#if UNEQUAL
        total.overlap = 0;
#endif
    }
    const Range owned = sh.owned[seat()];
    Resistance f =
        contact_forces<IMAGED, SAMPLED>(p, now.cell, drive, disc, owned.first, owned.end, total);
    const Range incoming = sh.incoming[seat()];
    // The barrier publishes the reactions, and every thread has read its neighbours.
    __syncthreads();
    add_reactions(f, incoming.first, incoming.end);
#if UNEQUAL
    if (SAMPLED) total.resultant = length_and_inverse<Vec>(f.x * f.x + f.y * f.y).x;
#endif
    if (p.local_damping != Real(0)) {
        f.x = damped(f.x, u.x, p.local_damping);
        f.y = damped(f.y, u.y, p.local_damping);
        f.torque = damped(f.torque, disc.half_w - c.half_spin, p.local_damping);
    }
    u = {u.x - f.x * disc.kick - p.step * (drive[0] * u.x + drive[1] * u.y),
         u.y - f.y * disc.kick - p.step * (drive[2] * u.x + drive[3] * u.y)};
    disc.half_w -= f.torque * disc.half_twist;
    x = {moved(x.x, now.to_units[0] * u.x + now.to_units[1] * u.y),
         moved(x.y, now.to_units[2] * u.x + now.to_units[3] * u.y)};
    if (SAMPLED && p.kinetic) {
        // m u (x) u with the velocities after the move.
        const Real mass = ratio(p.step, disc.kick);
        total.virial.xx += mass * u.x * u.x;
        total.virial.yy += mass * u.y * u.y;
        total.virial.shear += Real(2) * (mass * u.x * u.y);
    }
    const int t = seat();
    sh.body[t] = disc.body;
    sh.half_w[t] = disc.half_w;
}

struct Progress {
    int substeps;
    bool stale;
};

// Substeps as planned, until the list is stale. Discs are by seat.
template <bool IMAGED>
__device__ Progress advance_substeps(const Parameters& p, const Disc& constants, Position reference,
                                     Totals& total, int t) {
    Shared& sh = shared();
    const Control& c = sh.control;
    const Real drive[4] = {c.drive[0], c.drive[1], c.drive[2], c.drive[3]};
    Seated disc = {sh.body[t], sh.half_w[t], constants.r, p.step * constants.inv_mass,
                   Real(0.5) * p.step * constants.inv_inertia};
    for (int k = 0;; ++k) {
        const Substep& now = sh.substep[k];
        if (now.sampled) {
            substep<IMAGED, true>(p, now, drive, disc, total);
        } else {
            substep<IMAGED, false>(p, now, drive, disc, total);
        }
        // The barrier also publishes the new positions.
        const Substep& next = sh.substep[k + 1];
        const bool stale = __syncthreads_or(moved_far(reference, disc.body.s, next.allowed2));
        if (stale || next.last) {
            if (t == 0) sh.control.header.cell = next.exact;
            return {k + 1, stale};
        }
    }
}
