// L_p = sum v_i (x) grad S_ip (1/s), so L_ij = dv_i/dx_j.
extern "C" __global__ void velocity_gradient(const Mpm m) {
    const int p = point_of_thread(m);
    if (p == NOBODY) return;
    const Stencil s = m.stencil[p];
    Matrix l = {0.0, 0.0, 0.0, 0.0};
    for (int b = 0; b < WIDTH; ++b) {
        for (int a = 0; a < WIDTH; ++a) {
            l = l + outer(m.node_velocity[s.node + b * m.columns + a], gradient(s, a, b));
        }
    }
    m.velocity_gradient[p] = l;
}
