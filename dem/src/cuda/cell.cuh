// Cell geometry: twin of dem/src/cell.rs.

__device__ inline Matrix product(const Matrix& a, const Matrix& b) {
    return {a.xx * b.xx + a.xy * b.yx, a.xx * b.xy + a.xy * b.yy,
            a.yx * b.xx + a.yy * b.yx, a.yx * b.xy + a.yy * b.yy};
}

__device__ inline Matrix scaled(const Matrix& a, double k) {
    return {a.xx * k, a.xy * k, a.yx * k, a.yy * k};
}

__device__ inline double determinant(const Matrix& a) { return a.xx * a.yy - a.xy * a.yx; }

__device__ inline bool finite(const Matrix& a) {
    return isfinite(a.xx) && isfinite(a.xy) && isfinite(a.yx) && isfinite(a.yy);
}

// Perpendicular widths between the edges crossed by the first and by the second cell vector.
__device__ inline double2 widths(const Matrix& h) {
    const double area = fabs(determinant(h));
    return {area / sqrt(h.xy * h.xy + h.yy * h.yy), area / sqrt(h.xx * h.xx + h.yx * h.yx)};
}

// Square of the longer cell vector: the least width is the area over its length.
__device__ inline double longest2(const Matrix& h) {
    return fmax(h.xx * h.xx + h.yx * h.yx, h.xy * h.xy + h.yy * h.yy);
}

__device__ inline double min_width(const Matrix& h) {
    return fabs(determinant(h)) / sqrt(longest2(h));
}

// Smallest singular value of a b^-1: half the difference of the roots of
// (xx + yy)² + (xy - yx)² and (xx - yy)² + (xy + yx)².
__device__ inline Real min_stretch(const Matrix& a, const Matrix& b) {
    const Matrix adjugate = {b.yy, -b.xy, -b.yx, b.xx};
    const Matrix f = product(a, adjugate);
    const Real sum = Real(f.xx + f.yy), turn = Real(f.xy - f.yx);
    const Real difference = Real(f.xx - f.yy), shear = Real(f.xy + f.yx);
    return (sqrt(sum * sum + turn * turn) - sqrt(difference * difference + shear * shear)) /
           Real(2.0 * determinant(b));
}

// exp(A) = e^(tr A / 2) (C I + S B), B traceless, C = cosh(sqrt d), S = sinh(sqrt d) / sqrt d with
// d = -det B of either sign: their power series in d, after halving A until |d| <= 1.
__device__ Matrix exponential(const Matrix& a) {
    const double half_trace = 0.5 * (a.xx + a.yy);
    const double bxx = 0.5 * (a.xx - a.yy);
    double d = bxx * bxx + a.xy * a.yx;
    int halvings = 0;
#pragma unroll 1
    while (fabs(d) > 1.0 && halvings < 64) {
        d *= 0.25;
        ++halvings;
    }
    double c = 1.0;
    double s = 1.0;
#pragma unroll
    for (int n = 9; n > 0; --n) {
        c = 1.0 + d * (1.0 / ((2 * n) * (2 * n - 1))) * c;
        s = 1.0 + d * (1.0 / ((2 * n + 1) * (2 * n))) * s;
    }
    // cosh 2q = 2 cosh² q - 1 and sinh 2q / 2q = (sinh q / q) cosh q.
#pragma unroll 1
    for (; halvings > 0; --halvings) {
        s *= c;
        c = 2.0 * c * c - 1.0;
    }
    const double e = exp(half_trace);
    return {e * (c + s * bxx), e * s * a.xy, e * s * a.yx, e * (c - s * bxx)};
}

// Whether a lattice reduction is due.
__device__ inline bool oblique(const Matrix& h) {
    const double dot = h.xx * h.xy + h.yx * h.yy;
    const double aa = h.xx * h.xx + h.yx * h.yx;
    const double bb = h.xy * h.xy + h.yy * h.yy;
    return !(fabs(dot) <= 0.5 * fmin(aa, bb) * (1.0 + 1e-9));
}

__device__ inline void to_real(const Matrix& a, Real* out) {
    out[0] = Real(a.xx);
    out[1] = Real(a.xy);
    out[2] = Real(a.yx);
    out[3] = Real(a.yy);
}
