// Who is near whom: twin of dem/src/neighbours.rs.

// A skin weighs searches against pairs listed in vain. A search costs as much as about 16 substeps
// and is due whenever the fastest disc has moved half the skin; every skin of one largest radius
// makes a substep 0.4 times dearer. With n substeps in which the fastest disc moves v, the cost
// 16 * 2 v / skin + 0.4 n skin / r_max is least at this skin for n = 9.
__device__ inline double best_skin(double travel, const Header& h, const Parameters& p) {
    const double skin = 3.0 * sqrt(0.5 * h.reach * travel);
    return fmin(fmax(skin, p.least_skin), p.skin);
}

// Lattice reduction until the cell vectors are as short as can be, and what the search needs.
// `fastest` is the largest speed of a disc (m/s).
__device__ void reduce_lattice(Control& c, const Parameters& p, double fastest) {
    Header& h = c.header;
    Fraction m[4] = {1, 0, 0, 1};
    to_real(scaled(h.cell, 1.0 / PERIOD), c.old_cell);
    // Terminates as every step shortens a vector; the bound is for cells that are not finite.
#pragma unroll 1
    for (int step = 0; step < 64 && oblique(h.cell); ++step) {
        // The longer vector loses the other one k times.
        const double dot = h.cell.xx * h.cell.xy + h.cell.yx * h.cell.yy;
        const double aa = h.cell.xx * h.cell.xx + h.cell.yx * h.cell.yx;
        const double bb = h.cell.xy * h.cell.xy + h.cell.yy * h.cell.yy;
        const double k = round(dot / fmin(aa, bb));
        const Fraction n = Fraction(Signed(k));
        if (aa <= bb) {
            h.cell.xy -= k * h.cell.xx;
            h.cell.yy -= k * h.cell.yx;
            m[0] += n * m[2];
            m[1] += n * m[3];
        } else {
            h.cell.xx -= k * h.cell.xy;
            h.cell.yx -= k * h.cell.yy;
            m[2] += n * m[0];
            m[3] += n * m[1];
        }
    }
    for (int i = 0; i < 4; ++i) c.transform[i] = m[i];

    h.reference_cell = h.cell;
    to_real(scaled(h.cell, 1.0 / PERIOD), c.cell);
    to_real(scaled(h.cell, 1.0 / PERIOD), c.reference_cell);
    double gradient2 = 0.0;
    for (int i = 0; i < 4; ++i) gradient2 += double(c.drive[i]) * double(c.drive[i]);
    const double speed = fastest + 0.5 * h.reach * sqrt(gradient2);
    h.skin = best_skin(speed * p.dt * p.substeps, h, p);
    const double2 w = widths(h.cell);
    // With three bins each way no pair within reach has a second image within reach.
    const double x = floor(w.x / (h.reach + h.skin));
    const double y = floor(w.y / (h.reach + h.skin));
    c.old_imaged = h.imaged;
    h.imaged = !(x >= 3.0 && y >= 3.0);
    c.bins[0] = int(fmin(x, double(BINS)));
    c.bins[1] = int(fmin(y, double(BINS)));
    c.searches += 1;
}

// Neighbours of one disc while they are searched.
struct Found {
    // Neighbour << 16 | image.
    unsigned word[ROWS];
    int count;
    bool full;

    __device__ void add(unsigned entry) {
        full |= count == ROWS;
        if (count < ROWS) word[count++] = entry;
    }

    // Ascending by neighbour and image. Selection: lanes of a warp stay together.
    __device__ void sort() {
#pragma unroll 1
        for (int row = 0; row < count; ++row) {
            unsigned least = word[row];
            int place = row;
            for (int k = row + 1; k < count; ++k) {
                const unsigned other = word[k];
                if (other < least) {
                    least = other;
                    place = k;
                }
            }
            word[place] = word[row];
            word[row] = least;
        }
    }
};

// Counting sort of the seats into bins. Within a bin their order depends on timing, but what
// is found gets sorted.
__device__ void fill_bins(Position s, int t) {
    Shared& sh = shared();
    const int nx = sh.control.bins[0];
    const int ny = sh.control.bins[1];
    const int bin = bin_of(s.y, ny) * nx + bin_of(s.x, nx);
    for (int b = t; b < nx * ny; b += THREADS) sh.search.bin_end[b] = 0;
    __syncthreads();
    if (t < DISCS) atomicAdd(&sh.search.bin_end[bin], 1u);
    __syncthreads();
    if (t < LANES) {
        unsigned before = 0;
        for (int b = t; b - t < nx * ny; b += LANES) {
            const unsigned own = b < nx * ny ? sh.search.bin_end[b] : 0;
            unsigned sum = own;
            for (int d = 1; d < LANES; d *= 2) {
                const unsigned other = __shfl_up_sync(ALL, sum, d);
                if (t >= d) sum += other;
            }
            if (b < nx * ny) sh.search.bin_end[b] = before + sum - own;
            before += __shfl_sync(ALL, sum, LANES - 1);
        }
    }
    __syncthreads();
    // Each bin's start walks up to its end.
    if (t < DISCS) sh.search.bin[atomicAdd(&sh.search.bin_end[bin], 1u)] = (unsigned short)t;
    __syncthreads();
}

// Nearest images among the seats `bin[first..end]`.
__device__ inline void find_in(Found& found, int first, int end, Position s, Real r, int t) {
    const Shared& sh = shared();
    const Real* const cell = sh.control.cell;
    const Real skin = Real(sh.control.header.skin);
#pragma unroll 1
    for (int k = first; k < end; ++k) {
        const int j = sh.search.bin[k];
        // Summed in this order both discs of a pair find the same.
        const Real range = r + sh.search.radius[j] + skin;
        const Vec d = nearest(s, sh.position[j]);
        if (length2(cell, d) < range * range && j != t) found.add(unsigned(sh.disc[j]) << 16);
    }
}

// Nearest images in the 3 x 3 bins around the disc in seat t. Bins of a row follow each other.
__device__ void find_binned(Found& found, Position s, Real r, int t) {
    const unsigned* const bin_end = shared().search.bin_end;
    const int nx = shared().control.bins[0];
    const int ny = shared().control.bins[1];
    const int bx = bin_of(s.x, nx);
    const int by = bin_of(s.y, ny);
    const auto start = [&](int bin) { return bin == 0 ? 0 : int(bin_end[bin - 1]); };
#pragma unroll 1
    for (int dy = -1; dy <= 1; ++dy) {
        const int y = by + dy < 0 ? ny - 1 : by + dy == ny ? 0 : by + dy;
        const int row = y * nx;
        find_in(found, start(row + max(bx - 1, 0)), int(bin_end[row + min(bx + 1, nx - 1)]), s, r, t);
        // The bin across the edge of the cell.
        const int across = row + (bx == 0 ? nx - 1 : 0);
        if (bx == 0 || bx == nx - 1) find_in(found, start(across), int(bin_end[across]), s, r, t);
    }
}

// All images of all discs around the disc in seat t, its own included: right for any cell.
__device__ void find_all_images(Found& found, Position s, Real r, int t) {
    const Shared& sh = shared();
    const double skin = sh.control.header.skin;
    const Matrix h = sh.control.header.cell;
    const double2 w = widths(h);
#pragma unroll 1
    for (int j = 0; j < DISCS; ++j) {
        const double range = double(r) + double(sh.search.radius[j]) + skin;
        const Vec d = nearest(s, sh.position[j]);
        const double x = double(d.x) / PERIOD;
        const double y = double(d.y) / PERIOD;
        // |s_x| > range / width_x puts the branch out of range whatever s_y is.
        const double most_x = range / w.x;
        const double most_y = range / w.y;
        const int last_x = int(floor(most_x - x));
        const int last_y = int(floor(most_y - y));
        for (int ky = int(ceil(-most_y - y)); ky <= last_y; ++ky) {
            for (int kx = int(ceil(-most_x - x)); kx <= last_x; ++kx) {
                if (t == j && kx == 0 && ky == 0) continue;
                const double sx = x + kx;
                const double sy = y + ky;
                const double lx = h.xx * sx + h.xy * sy;
                const double ly = h.yx * sx + h.yy * sy;
                if (!(sqrt(lx * lx + ly * ly) < range)) continue;
                // Near half a period the unsigned reading does not jump.
                const bool ux = fabs(x) > 0.25;
                const bool uy = fabs(y) > 0.25;
                const int shift_x = kx - int(ux && x < 0.0);
                const int shift_y = ky - int(uy && y < 0.0);
                if (min(shift_x, shift_y) < -32 || max(shift_x, shift_y) > 31) {
                    found.full = true;
                    continue;
                }
                found.add(unsigned(sh.disc[j]) << 16 | image_code(shift_y, uy) << 7 |
                             image_code(shift_x, ux));
            }
        }
    }
}
