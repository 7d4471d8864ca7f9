// Dense granular flow: in-plane Drucker-Prager yield with the mu(I) friction law.

__device__ inline Matrix deviator(const Matrix& a) {
    const double mean = 0.5 * trace(a);
    return {a.xx - mean, a.xy, a.yx, a.yy - mean};
}

// sqrt(s : s / 2): radius of Mohr's circle of a deviator.
__device__ inline double in_plane_norm(const Matrix& s) {
    return sqrt(0.5 * (s.xx * s.xx + s.xy * s.xy + s.yx * s.yx + s.yy * s.yy));
}

// Stress after a step that ends at volume strain `strain`.
__device__ inline Matrix stress_after(const DruckerPragerLaw& law, double strain, const Matrix& old,
                                      const Matrix& l, double dt) {
    const double p = -law.bulk_modulus * strain;
    if (p <= 0.0) return {0.0, 0.0, 0.0, 0.0};
    const Matrix rate = deviator(strain_rate(l));
    const Matrix trial = deviator(rotated(old, l, dt)) + rate * (2.0 * law.shear_modulus * dt);

    // |D| = sqrt(D : D / 2), so gamma = sqrt(2 D : D) = 2 |D|.
    const double shear_rate = 2.0 * in_plane_norm(rate);
    const double inertial = shear_rate * law.grain_diameter * sqrt(law.grain_density / p);
    const double friction = law.static_friction + (law.dynamic_friction - law.static_friction) *
                                                      inertial / (law.inertial_number + inertial);
    const double strength = p * friction, size = in_plane_norm(trial);
    const double scale = size > strength ? strength / size : 1.0;
    return trial * scale + Matrix{-p, 0.0, 0.0, -p};
}

extern "C" __global__ void drucker_prager(const Mpm m, const DruckerPragerLaw law, double* volume_strain) {
    const int p = point_of_thread(m);
    if (p == NOBODY) return;
    const Matrix l = m.velocity_gradient[p];
    const double strain = volume_strain[p] + m.dt * trace(l);
    volume_strain[p] = strain;
    respond(m, p, stress_after(law, strain, m.stress[p], l, m.dt), stretched(m.volume[p], l, m.dt));
}
