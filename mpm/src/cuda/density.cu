// L_p <- L_p - rate (e_p - s) I / 2 where the volumes of points overlap by e_p, more than the slack s: twin of
// density.rs.
extern "C" __global__ void correct_density(const Mpm m) {
    const int p = point_of_thread(m);
    if (p == NOBODY) return;
    const Stencil s = m.stencil[p];
    double sum = 0.0, area = 0.0;
    for (int b = 0; b < WIDTH; ++b) {
        for (int a = 0; a < WIDTH; ++a) {
            const int node = s.node + b * m.columns + a;
            sum += m.node_mass[node] * value(s, a, b);
            area += m.node_area[node] * value(s, a, b);
        }
    }
    const double excess = sum * m.volume[p] / (m.mass[p] * area) - 1.0 - DENSITY_SLACK;
    if (!(excess > 0.0)) return;
    const double correction = 0.5 * m.density_rate * excess;
    Matrix l = m.velocity_gradient[p];
    l.xx -= correction;
    l.yy -= correction;
    m.velocity_gradient[p] = l;
}
