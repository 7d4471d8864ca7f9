// What constitutive laws share.

// D = sym L.
__device__ inline Matrix strain_rate(const Matrix& l) {
    const double shear = 0.5 * (l.xy + l.yx);
    return {l.xx, shear, shear, l.yy};
}

__device__ inline Matrix product(const Matrix& a, const Matrix& b) {
    return {a.xx * b.xx + a.xy * b.yx, a.xx * b.xy + a.xy * b.yy,
            a.yx * b.xx + a.yy * b.yx, a.yx * b.xy + a.yy * b.yy};
}

// Stress turned by the spin of a step: R s R^T, R = exp(W dt), W = skew L.
__device__ inline Matrix rotated(const Matrix& stress, const Matrix& l, double dt) {
    double sine, cosine;
    sincos(0.5 * (l.yx - l.xy) * dt, &sine, &cosine);
    const Matrix r = {cosine, -sine, sine, cosine}, transposed = {cosine, sine, -sine, cosine};
    return product(product(r, stress), transposed);
}

// Volume after a step at constant L: V exp(dt tr L).
__device__ inline double stretched(double volume, const Matrix& l, double dt) {
    return volume * exp(dt * trace(l));
}

__device__ inline void respond(const Mpm& m, int p, const Matrix& stress, double volume) {
    m.stress[p] = stress;
    m.volume[p] = volume;
    check_response(m, p, stress, volume);
}
