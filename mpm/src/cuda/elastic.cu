// Isotropic elasticity in plane strain: dsigma/dt = lambda tr(D) I + 2 G D + W sigma - sigma W.
extern "C" __global__ void elastic(const Mpm m, double lambda, double shear_modulus) {
    const int p = point_of_thread(m);
    if (p == NOBODY) return;
    const Matrix l = m.velocity_gradient[p], d = strain_rate(l);
    const double volumetric = lambda * trace(d);
    const Matrix rate = Matrix{volumetric, 0.0, 0.0, volumetric} + d * (2.0 * shear_modulus);
    respond(m, p, rotated(m.stress[p], l, m.dt) + rate * m.dt, stretched(m.volume[p], l, m.dt));
}
