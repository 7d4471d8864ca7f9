// Basis functions and their values at the points. WIDTH is what a point sees along one axis.

enum Basis { LINEAR, GIMP, QUADRATIC, CUBIC };

struct ShapeFunctions {
    double first;
    double value[WIDTH], gradient[WIDTH], affine[WIDTH];
};

// uGIMP function and derivative at distance d (cells) from the node.
__device__ inline void gimp(double d, double& value, double& gradient) {
    constexpr double L = GIMP_HALF_SIZE;
    const double a = fabs(d), sign = copysign(1.0, d);
    if (a < L) {
        value = 1.0 - (d * d + L * L) / (2.0 * L);
        gradient = -d / L;
    } else if (a < 1.0 - L) {
        value = 1.0 - a;
        gradient = -sign;
    } else if (a < 1.0 + L) {
        const double r = 1.0 + L - a;
        value = r * r / (4.0 * L);
        gradient = -sign * r / (2.0 * L);
    } else {
        value = 0.0;
        gradient = 0.0;
    }
}

// At x in cells, nodes at the integers.
__device__ inline ShapeFunctions shape_functions(double x) {
    ShapeFunctions s;
    if constexpr (BASIS == LINEAR) s.first = floor(x);
    if constexpr (BASIS == GIMP) s.first = floor(x - GIMP_HALF_SIZE);
    if constexpr (BASIS == QUADRATIC) s.first = floor(x - 0.5);
    if constexpr (BASIS == CUBIC) s.first = floor(x) - 1.0;
    const double u = x - s.first;
    if constexpr (BASIS == LINEAR) {
        s.value[0] = 1.0 - u;
        s.value[1] = u;
        // S (i - x) / D is the gradient for hats, and D = 0 on a node.
        s.gradient[0] = s.affine[0] = -1.0;
        s.gradient[1] = s.affine[1] = 1.0;
        return s;
    }
    if constexpr (BASIS == GIMP) {
        for (int k = 0; k < WIDTH; ++k) gimp(u - k, s.value[k], s.gradient[k]);
    }
    if constexpr (BASIS == QUADRATIC) {
        const double a = 1.5 - u, b = u - 1.0, c = u - 0.5;
        s.value[0] = 0.5 * a * a;
        s.value[1] = 0.75 - b * b;
        s.value[2] = 0.5 * c * c;
        s.gradient[0] = -a;
        s.gradient[1] = -2.0 * b;
        s.gradient[2] = c;
    }
    if constexpr (BASIS == CUBIC) {
        // u in [1, 2): distance to the four nodes is u, u - 1, 2 - u, 3 - u.
        const double a = 2.0 - u, b = u - 1.0, c = 2.0 - u, d = u - 1.0;
        s.value[0] = a * a * a / 6.0;
        s.value[1] = 2.0 / 3.0 - b * b + 0.5 * b * b * b;
        s.value[2] = 2.0 / 3.0 - c * c + 0.5 * c * c * c;
        s.value[WIDTH - 1] = d * d * d / 6.0;
        s.gradient[0] = -0.5 * a * a;
        s.gradient[1] = -2.0 * b + 1.5 * b * b;
        s.gradient[2] = 2.0 * c - 1.5 * c * c;
        s.gradient[WIDTH - 1] = 0.5 * d * d;
    }
    double second = 0.0;
    for (int k = 0; k < WIDTH; ++k) second += s.value[k] * (k - u) * (k - u);
    for (int k = 0; k < WIDTH; ++k) s.affine[k] = s.value[k] * (k - u) / second;
    return s;
}

__device__ inline Stencil stencil_at(const Mpm& m, Vec x) {
    const double per_cell = 1.0 / m.cell;
    const ShapeFunctions along[2] = {shape_functions(x.x * per_cell), shape_functions(x.y * per_cell)};
    Stencil s;
    s.corner = Vec{along[0].first * m.cell, along[1].first * m.cell} - x;
    s.node = (int(along[1].first) + GHOSTS) * m.columns + int(along[0].first) + GHOSTS;
    for (int axis = 0; axis < 2; ++axis) {
        for (int k = 0; k < WIDTH; ++k) {
            s.value[axis][k] = along[axis].value[k];
            s.gradient[axis][k] = along[axis].gradient[k] * per_cell;
            s.affine[axis][k] = along[axis].affine[k] * per_cell;
        }
    }
    return s;
}

// Of the node a columns and b rows from the lowest, leftmost one: S_ip, grad S_ip,
// S_ip D^-1 (x_i - x_p), and x_i - x_p.
__device__ inline double value(const Stencil& s, int a, int b) { return s.value[0][a] * s.value[1][b]; }
__device__ inline Vec gradient(const Stencil& s, int a, int b) {
    return {s.gradient[0][a] * s.value[1][b], s.value[0][a] * s.gradient[1][b]};
}
__device__ inline Vec affine(const Stencil& s, int a, int b) {
    return {s.affine[0][a] * s.value[1][b], s.value[0][a] * s.affine[1][b]};
}
__device__ inline Vec offset(const Stencil& s, int a, int b, double cell) {
    return s.corner + Vec{a * cell, b * cell};
}
