// Decisions for a whole RVE, at the start of a macro step and of its substeps: twin of
// `Rve::advance` in dem/src/rve.rs.

// How far discs may have moved since the search before the list must be renewed, squared;
// negative: at once (neighbours.rs).
//
// A pair not listed was further apart than R + skin, R = r_i + r_j. Displacements D, measured in
// the cell of the search, and the affine motion of smallest stretch s <= 1 leave at least
// s (R + skin - 2 D). That must exceed R for all R up to `reach`.
__device__ Real allowed_displacement2(const Header& h, const Matrix& cell) {
    if (!(h.skin > 0.0) || oblique(cell)) return Real(-1);
    const Real stretch = min(Real(1), min_stretch(cell, h.reference_cell));
    const Real reach = Real(h.reach);
    const Real allowed = Real(0.5) * (Real(h.skin) + reach - reach / stretch);
    return allowed > Real(0) ? allowed * allowed : Real(-1);
}

__device__ State free_state(double area, double solid_fraction) {
    State state = {};
    state.area = area;
    state.solid_fraction = solid_fraction;
    state.min_width = 1.0 / 0.0;
    state.free = 1;
    return state;
}

// What happens before discs move; one thread.
__device__ Action begin(Control& c, const Batch& b, const Parameters& p, unsigned rve,
                        const Matrix& l) {
    c.rve = rve;
    c.header = b.header[rve];
    c.searches = 0;
    c.thin = 0;
    c.dense = 0;
    c.status = OK;
    Header& h = c.header;
    if (h.status != OK) return DONE;
#if UNEQUAL
    if (p.substeps == 0) return DONE;
#endif
    h.steps += 1;
    const double dt = p.dt * p.substeps;
    if (!finite(l)) {
        c.status = NOT_FINITE;
        return DONE;
    }

    const double area = determinant(h.cell);
    if (h.free_area < 0.0 && h.solid < p.free_solid_fraction * area) h.free_area = area;
    if (h.free_area >= 0.0) {
        // A stress-free RVE only keeps its area; dense enough again, it restarts from the fresh
        // packing of its kind scaled to that area.
        const Header& fresh = b.header[p.rves + h.kind];
        h.free_area = fmin(h.free_area * exp((l.xx + l.yy) * dt), fresh.solid / p.least_solid_fraction);
        const double ratio = h.free_area / determinant(fresh.cell);
        const double solid_fraction = fresh.solid / h.free_area;
        b.state[rve] = free_state(h.free_area, solid_fraction);
        if (solid_fraction < p.free_solid_fraction) return DONE;
        const unsigned steps = h.steps;
        h = fresh;
        h.cell = scaled(fresh.cell, sqrt(ratio));
        h.free_area = -1.0;
        h.steps = steps;
        return RESTART;
    }

    Matrix drive = l;
    // area / longest < thin_width, and thinner after the step.
    const bool thin = area * area < p.thin_width * p.thin_width * longest2(h.cell);
    if (thin &&
        !(min_width(product(exponential(scaled(drive, dt)), h.cell)) >= min_width(h.cell))) {
        const double spin = 0.5 * (drive.yx - drive.xy);
        const double volumetric = 0.5 * (drive.xx + drive.yy);
        drive = {volumetric, -spin, spin, volumetric};
        c.thin = 1;
    }
    if (drive.xx + drive.yy < 0.0 && h.solid > p.max_solid_fraction * area) {
        const double volumetric = 0.5 * (drive.xx + drive.yy);
        drive.xx -= volumetric;
        drive.yy -= volumetric;
        c.dense = 1;
    }
    c.gradient = drive;
    to_real(drive, c.drive);
    const double spin = 0.5 * (drive.yx - drive.xy);
    c.half_spin = Real(0.5 * spin);
    c.spin_change = Real(spin - h.spin);
    h.spin = spin;
    c.drift = {Real(h.drift_x), Real(h.drift_y)};
    to_real(scaled(h.reference_cell, 1.0 / PERIOD), c.reference_cell);
    return ADVANCE;
}

// What k substeps under a velocity gradient do to the cell, for lane k of a warp. It stays in
// `Substep::exact` until the first plan, as long as the gradient is what acts on the cell.
__device__ void prepare_plan(const Parameters& p, const Matrix& l, int lane) {
    shared().substep[lane].exact = exponential(scaled(l, lane * p.dt));
}

// The cell in the next substeps: lane k of a warp tells substep `done + k`. The last entry
// only tells the state after them.
__device__ void plan_substeps(const Parameters& p, int done, bool prepared, int lane) {
    Shared& sh = shared();
    Control& c = sh.control;
    Substep& s = sh.substep[lane];
    if (!prepared || c.thin || c.dense) prepare_plan(p, c.gradient, lane);
    const Matrix h = product(s.exact, c.header.cell);
    const Matrix end = {__shfl_down_sync(ALL, h.xx, 1), __shfl_down_sync(ALL, h.xy, 1),
                        __shfl_down_sync(ALL, h.yx, 1), __shfl_down_sync(ALL, h.yy, 1)};
    if (done + lane > int(p.substeps)) return;
    const Real area = Real(determinant(end));
    if (lane == 0) c.growth = area / Real(determinant(h));
    s.exact = h;
    s.sampled = done + lane >= int(p.substeps - p.samples);
    s.last = lane == LANES - 1 || done + lane == int(p.substeps);
    s.allowed2 = allowed_displacement2(c.header, h);
    to_real(scaled(h, 1.0 / PERIOD), s.cell);
    const Real k = Real(p.dt * PERIOD) / area;
    if (!isfinite(k)) c.status = NOT_FINITE;
    s.to_units[0] = Real(end.yy) * k;
    s.to_units[1] = -Real(end.xy) * k;
    s.to_units[2] = -Real(end.yx) * k;
    s.to_units[3] = Real(end.xx) * k;
}

// Whether a disc moved so far since the search that a pair which is not listed may touch.
__device__ inline bool moved_far(Position reference, Position s, Real allowed2) {
    return !(length2(shared().control.reference_cell, nearest(reference, s)) <= allowed2);
}
