// Cell averages of the volumetric strain rate, against volumetric locking:
// L_p <- L_p + (tr L_cell - tr L_p) I / 2, tr L_cell the volume-weighted mean over the points in the
// cell where they are now.

// A point on the right or upper wall belongs to the last cell.
__device__ inline int cell_along(double x, double cell, int cells) {
    return max(0, min(int(x / cell), cells - 1));
}

extern "C" __global__ void cell_push(const Mpm m) {
    const int p = point_of_thread(m);
    if (p == NOBODY) return;
    const Vec x = m.position[p];
    const int row = cell_along(x.y, m.cell, m.cells_y), column = cell_along(x.x, m.cell, m.cells_x);
    push(m.cells, m.clock->step, p, row * m.cells_x + column);
}

extern "C" __global__ void cell_sort(const Mpm m) {
    const int p = point_of_thread(m);
    if (p != NOBODY) link(m.cells, m.clock->step, p);
}

// The first point of a cell sums for all.
extern "C" __global__ void cell_sums(const Mpm m) {
    const int p = point_of_thread(m);
    if (p == NOBODY || first_point(m.cells, m, m.cells.cell[p]) != p) return;
    Vec sum = {0.0, 0.0};
    for (int q = p; q != NOBODY; q = m.cells.successor[q]) {
        sum = sum + Vec{1.0, trace(m.velocity_gradient[q])} * m.volume[q];
    }
    m.cell_sum[m.cells.cell[p]] = sum;
}

extern "C" __global__ void cell_average(const Mpm m) {
    const int p = point_of_thread(m);
    if (p == NOBODY) return;
    const Vec sum = m.cell_sum[m.cells.cell[p]];
    Matrix l = m.velocity_gradient[p];
    const double correction = 0.5 * (sum.y / sum.x - trace(l));
    l.xx += correction;
    l.yy += correction;
    m.velocity_gradient[p] = l;
}
