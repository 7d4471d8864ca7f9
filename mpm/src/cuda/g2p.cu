// Grid to points: velocity, affine matrix and position, kept out of walls and obstacles.
//
// v_p <- (1 - s) (v_p + sum S_ip (v_i^{n+1} - v_i^n)) + s sum S_ip v_i^{n+1}
// C_p <- sum S_ip v_i^{n+1} (x) D^-1 (x_i - x_p)             (affine transfers)
// x_p <- x_p + dt sum S_ip v_i^{n+1}
extern "C" __global__ void g2p(const Mpm m) {
    const int p = point_of_thread(m);
    if (p == NOBODY) return;
    const Stencil s = m.stencil[p];
    Vec pic = {0.0, 0.0}, increment = {0.0, 0.0};
    Matrix c = {0.0, 0.0, 0.0, 0.0};
    for (int b = 0; b < WIDTH; ++b) {
        for (int a = 0; a < WIDTH; ++a) {
            const int node = s.node + b * m.columns + a;
            const Vec v = m.node_velocity[node];
            pic = pic + v * value(s, a, b);
            increment = increment + (v - m.node_old_velocity[node]) * value(s, a, b);
            c = c + outer(v, affine(s, a, b));
        }
    }
    Vec velocity = (m.velocity[p] + increment) * (1.0 - m.pic_share) + pic * m.pic_share;
    Vec position = m.position[p] + pic * m.dt;
    confine(m, m.placed + m.obstacles, p, position, velocity);
    m.velocity[p] = velocity;
    m.position[p] = position;
    m.affine_velocity[p] = m.affine ? c : Matrix{0.0, 0.0, 0.0, 0.0};
}
