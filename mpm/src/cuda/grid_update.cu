// Momentum balance on the grid, and the velocities that contacts leave.

// v_i = (m v)_i / m_i; light nodes stay at rest.
__device__ inline void set_velocity(const Mpm& m, const Placed* placed, int node, double mass,
                                    Vec momentum) {
    Vec velocity = {0.0, 0.0};
    if (mass > m.cutoff) velocity = momentum / mass;
    m.node_velocity[node] = constrain(m, placed, node, mass, velocity, false);
}

// v_i^{n+1} = v_i^n + dt (f_i / m_i + g).
__device__ inline void accelerate(const Mpm& m, const Placed* placed, int node, double mass,
                                  Vec momentum, Vec force) {
    Vec old_velocity = {0.0, 0.0}, velocity = {0.0, 0.0};
    if (mass > m.cutoff) {
        old_velocity = momentum / mass;
        velocity = old_velocity + (force / mass + Vec{m.gravity_x, m.gravity_y}) * m.dt;
    }
    m.node_old_velocity[node] = old_velocity;
    m.node_velocity[node] = constrain(m, placed, node, mass, velocity, true);
}
