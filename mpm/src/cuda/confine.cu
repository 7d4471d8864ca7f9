// Keeps points out of walls and obstacles.

// Moves a point that left the domain or entered an obstacle back onto the face, takes its velocity
// into it away, and books count and impulse. One that is more than a cell beyond is a failure, and
// stays where it is.
__device__ inline void confine(const Mpm& m, const Placed* placed, int p, Vec& position, Vec& velocity) {
    const Vec before = position;
    if (!(finite(before) && finite(velocity))) return raise(m, MOTION, p, NOT_FINITE);
    const double mass = m.mass[p];
    Vec x = position, v = velocity;
    for (int k = 0; k < m.obstacles; ++k) {
        const int side = nearest_face(placed[k], x);
        if (side < 0) continue;
        if (depth(placed[k], x, side) > m.cell) return raise(m, MOTION, p, INSIDE_OBSTACLE + k);
        x = project(placed[k], x, side);
        const Vec after = contact(v, normal(side), placed[k].velocity, 0.0);
        book_obstacle(m.point_ledger, m.points, p, m, k, (after - v) * mass, placed[k].velocity);
        v = after;
    }
    const Vec inside = {fmin(fmax(x.x, 0.0), m.width), fmin(fmax(x.y, 0.0), m.height)};
    const Vec escape = inside - x;
    if (fabs(escape.x) > m.cell || fabs(escape.y) > m.cell) {
        return raise(m, MOTION, p, OUTSIDE_DOMAIN);
    }
    for (int axis = 0; axis < 2; ++axis) {
        const double by = axis == 0 ? escape.x : escape.y;
        if (by == 0.0) continue;
        const Vec inward = axis == 0 ? Vec{copysign(1.0, by), 0.0} : Vec{0.0, copysign(1.0, by)};
        const Vec after = contact(v, inward, {0.0, 0.0}, 0.0);
        book(m.point_ledger, m.points, p, 0, (after - v) * mass);
        v = after;
    }
    if (inside.x != before.x || inside.y != before.y) book_projection(m.point_ledger, m.points, p, m);
    position = inside;
    velocity = v;
}
