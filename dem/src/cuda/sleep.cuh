// Sleep: twin of dem/src/sleep.rs, where formulas are explained. All for one thread.

// What one thread decides for a whole RVE is not inlined with sleep: registers are few in the loop over contacts.
#if SLEEP
#define OUTLINED __noinline__
#else
#define OUTLINED
#endif

#if SLEEP

__device__ inline Matrix sum(const Matrix& a, const Matrix& b) {
    return {a.xx + b.xx, a.xy + b.xy, a.yx + b.yx, a.yy + b.yy};
}

__device__ inline Matrix transposed(const Matrix& a) { return {a.xx, a.yx, a.xy, a.yy}; }

// Frobenius norm.
__device__ inline double norm(const Matrix& a) {
    return sqrt(a.xx * a.xx + a.xy * a.xy + a.yx * a.yx + a.yy * a.yy);
}

// The inverse of `exponential` for rotations below a right angle.
__device__ Matrix logarithm(const Matrix& f) {
    const double det = determinant(f);
    const double half = 0.5 * (f.xx + f.yy);
    const double k = 1.0 / sqrt(det);
    const Matrix s = {k * (f.xx - half), k * f.xy, k * f.yx, k * (f.yy - half)};
    const double y = -determinant(s);
    const double root = sqrt(fabs(y));
    const double ratio = fabs(y) < 1e-8 ? 1.0 - y / 6.0 : (y > 0.0 ? asinh(root) : asin(root)) / root;
    const double trace = 0.5 * log(det);
    return {ratio * s.xx + trace, ratio * s.xy, ratio * s.yx, ratio * s.yy + trace};
}

// Nothing known yet.
__device__ Sleep awake(unsigned audited) {
    Sleep s = {};
    s.deformation = {1.0, 0.0, 0.0, 1.0};
    s.audited = audited;
    return s;
}

// Rotation and strain U - I of F = R U.
struct Polar {
    Matrix rotation;
    Matrix strain;
};

__device__ Polar polar(const Matrix& f) {
    const double c = f.xx + f.yy, s = f.yx - f.xy;
    const double r = hypot(c, s);
    const Matrix rotation = {c / r, -s / r, s / r, c / r};
    Matrix strain = product(transposed(rotation), f);
    strain.xx -= 1.0;
    strain.yy -= 1.0;
    return {rotation, strain};
}

// Stress (Pa) of contacts with bulk and shear stiffness under a strain, or of dashpots under its rate.
__device__ Matrix answer(const Sleep& s, const Matrix& strain, double bulk, double shear) {
    const double half = 0.5 * (strain.xx + strain.yy);
    const double k = 2.0 * bulk * half, g = 2.0 * shear, c = -s.fabric;
    return {c * (k + g * (strain.xx - half)), c * g * strain.xy,
            c * g * strain.yx, c * (k + g * (strain.yy - half))};
}

__device__ Matrix elastic_answer(const Sleep& s, const Parameters& p, const Matrix& strain) {
    return answer(s, strain, p.bulk_stiffness, p.shear_stiffness);
}

__device__ Matrix dashpots(const Sleep& s, const Parameters& p, const Matrix& l) {
    const double shear = 0.5 * (l.xy + l.yx);
    return answer(s, {l.xx, shear, shear, l.yy}, p.bulk_dashpot, p.shear_dashpot);
}

__device__ Matrix stress_asleep(const Sleep& s, const Parameters& p, const Matrix& l) {
    const Polar f = polar(s.deformation);
    const Matrix elastic = sum(s.base, elastic_answer(s, p, f.strain));
    const Matrix turned = product(product(f.rotation, elastic), transposed(f.rotation));
    return sum(turned, dashpots(s, p, l));
}

__device__ bool is_quiet(const Sleep& s, const Parameters& p) {
    const Polar f = polar(s.deformation);
    if (fabs(f.rotation.yx) > p.largest_turn) return false;
    if (s.coordination == 0.0) {
        const double half = 0.5 * (f.strain.xx + f.strain.yy);
        const double deviator = sqrt(fmax(half * half - determinant(f.strain), 0.0));
        return half - deviator >= -p.largest_closing && half + deviator <= p.largest_opening;
    }
    return norm(elastic_answer(s, p, f.strain)) <= p.sleep_stress * norm(s.base);
}

// Takes the deformation of a macro step and tells whether to sleep in it.
__device__ bool follow(Sleep& s, const Parameters& p, const Matrix& increment) {
    s.deformation = product(exponential(increment), s.deformation);
    const bool asleep = s.settled && is_quiet(s, p);
    s.slept |= unsigned(asleep);
    return asleep;
}

// Compares the answer of sleep with the state after a DEM step under a velocity gradient. An audited
// RVE that was to be asleep stays so; gives the error of its stress (Pa), else 0.
__device__ double compare(Sleep& s, bool asleep, const Parameters& p, const Matrix& l,
                          const State& state) {
    const double difference = norm(sum(state.stress, scaled(stress_asleep(s, p, l), -1.0)));
    if (asleep) return difference;
    const bool right = difference <= p.right_stress * norm(state.stress);
    const bool apart = state.coordination == 0.0 && state.relative_overlap == 0.0;
    s.settled = (right || apart) && !state.thin && !state.dense;
    s.slept = 0;
    s.coordination = state.coordination;
    s.fabric = state.coordination * state.solid_fraction * p.fabric_per_contact;
    s.base = sum(state.stress, scaled(dashpots(s, p, l), -1.0));
    s.deformation = {1.0, 0.0, 0.0, 1.0};
    return 0.0;
}
#endif
