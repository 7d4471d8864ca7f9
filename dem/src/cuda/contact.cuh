// The contact law: twin of dem/src/contact.rs.

// Length and its inverse.
template <class Vector2>
__device__ inline Vector2 length_and_inverse(Real length2) {
#if REAL_BITS == 32
    // One Newton step takes the length to within half a unit in the last place or so.
    const Real inverse = rsqrtf(length2);
    const Real guess = length2 * inverse;
    return {fmaf(fmaf(-guess, guess, length2), Real(0.5) * inverse, guess), inverse};
#else
    const Real length = sqrt(length2);
    return {length, Real(1) / length};
#endif
}

// To a unit in the last place or two.
__device__ inline Real ratio(Real a, Real b) {
#if REAL_BITS == 32
    return __fdividef(a, b);
#else
    return a / b;
#endif
}

// Spring and dashpot of a contact (N). Their sum must not pull: the normal force is its positive part. Not
// clamped here, since a clamp inside makes the kernel of packings spill registers.
__device__ inline Real spring_and_dashpot(Real stiffness, Real overlap, Real dashpot, Real vn) {
    return stiffness * overlap - dashpot * vn;
}

// Overlap (m) that a spring pushes with in a step in which its contact may close or open, and whether it opens.
struct MeanOverlap {
    Real overlap;
    bool opens;
};

__device__ inline MeanOverlap mean_overlap(Real stiffness, Real step, Real overlap, Real vn,
                                           Real dashpot, Real inv_mass) {
    overlap = max(overlap, Real(0));
    const Real push = max(spring_and_dashpot(stiffness, overlap, dashpot, vn), Real(0));
    const Real opening = step * (vn + step * inv_mass * push);
    const Real travel = max(-(step * vn), opening);
    return {overlap < travel ? Real(0.5) * overlap * (Real(1) + ratio(overlap, travel)) : overlap,
            overlap < opening};
}

// Tangential force (N) after one step: a spring, kt dt = `spring`, that slides at the Coulomb limit.
__device__ inline Real tangential_force(Real before, Real spring, Real vt, Real limit) {
    return min(max(before - spring * vt, -limit), limit);
}

#if ROLLING
// Resistance against rolling (N): of the spring, and of spring and dashpot together.
struct RollingForces {
    Real spring, total;
};

// After one step at a rolling velocity `vr`: a spring, kr dt = `stiffness`, and a dashpot; each slides at the
// limit, as their sum does.
__device__ inline RollingForces rolling_forces(Real before, Real stiffness, Real dashpot, Real vr,
                                               Real limit) {
    const Real spring = tangential_force(before, stiffness, vr, limit);
    return {spring, tangential_force(spring, dashpot, vr, limit)};
}
#endif

// Cundall local damping: `resisting` is minus the force.
__device__ inline Real damped(Real resisting, Real velocity, Real alpha) {
    const Real power = resisting * velocity;
    return resisting - (power < Real(0) ? alpha : power > Real(0) ? -alpha : Real(0)) * resisting;
}
