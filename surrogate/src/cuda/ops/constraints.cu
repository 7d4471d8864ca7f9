// Walls and rigid boxes as hard constraints: the CUDA twin of `Constraints::confine` in Rust, equal to
// it to the bit, for which products are rounded before they are added. `RigidBox` is defined in
// constraints.rs.

// A point may touch one box after another.
constexpr int PASSES = 4;
// Part of a box's size that counts as its surface.
constexpr double SKIN = 1e-9;

struct Pair {
    double x[2];
};

__device__ double product(double a, double b) { return __dmul_rn(a, b); }

// How far a box has moved.
__device__ double shift(const RigidBox& box, int k, double time) {
    return product(box.velocity[k], fmax(time - box.start, 0.0));
}

__device__ bool within(const Pair& x, const Pair& low, const Pair& high, const double* skin) {
    bool inside = true;
    for (int k = 0; k < 2; ++k) {
        inside = inside && x.x[k] > low.x[k] + skin[k] && x.x[k] < high.x[k] - skin[k];
    }
    return inside;
}

// The face through which a path enters a box, in the order of `friction`; -1 if it stays outside.
__device__ int entry(const Pair& low, const Pair& high, const Pair& start, const Pair& end) {
    double skin[2];
    for (int k = 0; k < 2; ++k) {
        skin[k] = product(SKIN, high.x[k] - low.x[k]);
    }
    if (within(start, low, high, skin)) {
        // It should not have been there: out through the nearest face.
        if (!within(end, low, high, skin)) {
            return -1;
        }
        int nearest = 0;
        double least = end.x[0] - low.x[0];
        for (int face = 1; face < 4; ++face) {
            const int k = face / 2;
            const double distance = face % 2 ? high.x[k] - end.x[k] : end.x[k] - low.x[k];
            if (distance < least) {
                least = distance;
                nearest = face;
            }
        }
        return nearest;
    }
    // Parts of the path between the two faces of each axis.
    double enters = 0.0, leaves = 1.0;
    int face = -1;
    for (int k = 0; k < 2; ++k) {
        const double step = end.x[k] - start.x[k];
        const double near = low.x[k] + skin[k], far = high.x[k] - skin[k];
        if (step == 0.0) {
            if (start.x[k] <= near || start.x[k] >= far) {
                return -1;
            }
            continue;
        }
        const double first = ((step > 0.0 ? near : far) - start.x[k]) / step;
        const double last = ((step > 0.0 ? far : near) - start.x[k]) / step;
        if (first >= enters) {
            enters = first;
            face = 2 * k + (step < 0.0);
        }
        leaves = fmin(leaves, last);
    }
    return enters < leaves ? face : -1;
}

// Stops the path from `old` at the first face of the box that it crosses, and lets the point slide
// along that face as far as friction allows.
__device__ Pair push_out(const RigidBox& box, const Pair& old, Pair point, const double* times) {
    Pair low, high, start;
    for (int k = 0; k < 2; ++k) {
        const double after = shift(box, k, times[1]);
        low.x[k] = box.low[k] + after;
        high.x[k] = box.high[k] + after;
        // As seen from the box: where the point would have started had the box not moved.
        start.x[k] = old.x[k] + (low.x[k] - (box.low[k] + shift(box, k, times[0])));
    }
    const int face = entry(low, high, start, point);
    if (face < 0) {
        return point;
    }
    const int axis = face / 2, along = 1 - axis;
    const double surface = face % 2 ? high.x[axis] : low.x[axis];
    const double depth = fabs(surface - point.x[axis]);
    const double path = point.x[along] - start.x[along];
    // Without depth infinite friction gives NaN, and fmax 0: it stops the point in any case.
    const double slid = fmax(fabs(path) - product(box.friction[face], depth), 0.0);
    point.x[axis] = surface;
    point.x[along] = start.x[along] + copysign(slid, path);
    return point;
}

__device__ Pair inside(Pair point, const double* domain) {
    for (int k = 0; k < 2; ++k) {
        point.x[k] = fmin(fmax(point.x[k], 0.0), domain[k]);
    }
    return point;
}

// Moves a point that went from `old` to `point` between two times out of the walls and boxes that it
// entered.
__device__ Pair confine(
    const RigidBox* boxes, unsigned number, const double* domain, const Pair& old, Pair point,
    const double* times) {
    point = inside(point, domain);
    for (int pass = 0; pass < PASSES; ++pass) {
        const Pair before = point;
        for (unsigned box = 0; box < number; ++box) {
            point = push_out(boxes[box], old, point, times);
        }
        point = inside(point, domain);
        if (point.x[0] == before.x[0] && point.x[1] == before.x[1]) {
            break;
        }
    }
    return point;
}
