// Who is near whom: twin of dem/src/neighbours.rs.

// A skin weighs searches against pairs listed in vain. A search costs as much as about 16 substeps
// and is due whenever the fastest disc has moved half the skin; every skin of one largest radius
// makes a substep 0.4 times dearer. With n substeps in which the fastest disc moves v, the cost
// 16 * 2 v / skin + 0.4 n skin / r_max is least at this skin.
__device__ inline Real best_skin(Real travel, const Header& h, const Parameters& p) {
    const Real skin = sqrt(Real(80) * Real(0.5) * Real(h.reach) * travel / Real(p.substeps));
    return min(max(skin, Real(p.least_skin)), Real(p.skin));
}

// Lattice reduction until the cell vectors are as short as can be, and what the search needs.
// `fastest` is the largest speed of a disc (m/s).
__device__ void reduce_lattice(Control& c, const Parameters& p, Real fastest) {
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
    const double2 w = widths(h.cell);
    c.per_width[0] = 1.0 / w.x;
    c.per_width[1] = 1.0 / w.y;
    to_real(scaled(h.cell, 1.0 / PERIOD), c.cell);
    to_real(scaled(h.cell, 1.0 / PERIOD), c.reference_cell);
    Real gradient2 = 0;
    for (int i = 0; i < 4; ++i) gradient2 += c.drive[i] * c.drive[i];
    const Real speed = fastest + Real(0.5 * h.reach) * sqrt(gradient2);
    const Real skin = best_skin(speed * Real(p.dt * p.substeps), h, p);
    h.skin = skin;
    // Bins as wide as the list reaches, and a shade wider in view of round-off. With three bins each
    // way no pair within reach has a second image within reach; an axis that has room for fewer gets
    // a single one.
    const Real area = Real(fabs(determinant(h.cell))) * Real(0.9999);
    const Real range = Real(h.reach) + skin;
    const Real x = area / (range * sqrt(Real(h.cell.xy * h.cell.xy + h.cell.yy * h.cell.yy)));
    const Real y = area / (range * sqrt(Real(h.cell.xx * h.cell.xx + h.cell.yx * h.cell.yx)));
    c.old_imaged = h.imaged;
    h.imaged = !(x >= Real(3) && y >= Real(3));
    c.bins[0] = x >= Real(3) ? int(min(x, Real(BINS))) : 1;
    c.bins[1] = y >= Real(3) ? int(min(y, Real(BINS))) : 1;
    c.searches += 1;
}

// Neighbours of one disc while they are searched: neighbour << 16 | image.
struct Found {
    // Local memory, as its index is not known to the compiler: slow to read.
    unsigned word[ROWS];
    int count;
    // Without images, neighbours go to shared memory once they are sorted.
    bool imaged;

    __device__ unsigned at(int k) const {
        return imaged ? word[k] : unsigned(shared().search.near[k][threadIdx.x]) << 16;
    }

    __device__ void add(unsigned entry) {
        if (count < ROWS) word[count] = entry;
        ++count;
    }

    // Ascending by neighbour and image: a bitonic sorting network, in registers. All threads have done
    // with the bins.
    __device__ void sort() {
        constexpr int STAGES = ROWS <= 8 ? 3 : ROWS <= 16 ? 4 : 5;
        constexpr int N = 1 << STAGES;
        unsigned w[N];
#pragma unroll
        for (int k = 0; k < N; ++k) w[k] = k < ROWS && k < count ? word[k] : ALL;
#pragma unroll
        for (int stage = 1; stage <= STAGES; ++stage) {
#pragma unroll
            for (int step = stage - 1; step >= 0; --step) {
#pragma unroll
                for (int k = 0; k < N; ++k) {
                    const int l = k ^ 1 << step;
                    if (l < k) continue;
                    const unsigned less = min(w[k], w[l]);
                    const unsigned more = max(w[k], w[l]);
                    const bool rising = (k >> stage & 1) == 0;
                    w[k] = rising ? less : more;
                    w[l] = rising ? more : less;
                }
            }
        }
#pragma unroll
        for (int k = 0; k < ROWS; ++k) {
            if (imaged) {
                word[k] = w[k];
            } else {
                shared().search.near[k][threadIdx.x] = (unsigned short)(w[k] >> 16);
            }
        }
    }
};

// Counting sort of the discs into bins. Within a bin their order depends on timing, but what
// is found gets sorted.
__device__ void fill_bins(Position s, Real r, int t) {
    Shared& sh = shared();
    const int nx = sh.control.bins[0];
    const int ny = sh.control.bins[1];
    const int bin = bin_of(s.y, ny) * nx + bin_of(s.x, nx);
    for (int b = t; b < nx * ny; b += THREADS) sh.search.bin_end[b] = 0;
    __syncthreads();
    if (t < DISCS) atomicAdd(&sh.search.bin_end[bin], 1u);
    __syncthreads();
    // Numbers to starts; each lane takes some bins in a row.
    if (t < LANES) {
        const int each = (nx * ny + LANES - 1) / LANES;
        const int first = t * each;
        const int end = min(first + each, nx * ny);
        unsigned own = 0;
        for (int b = first; b < end; ++b) own += sh.search.bin_end[b];
        unsigned before = own;
        for (int d = 1; d < LANES; d *= 2) {
            const unsigned other = __shfl_up_sync(ALL, before, d);
            if (t >= d) before += other;
        }
        before -= own;
        for (int b = first; b < end; ++b) {
            const unsigned discs = sh.search.bin_end[b];
            sh.search.bin_end[b] = before;
            before += discs;
        }
    }
    __syncthreads();
    // Each bin's start walks up to its end.
    if (t < DISCS) sh.search.binned[atomicAdd(&sh.search.bin_end[bin], 1u)] = {s, r, unsigned(t)};
    __syncthreads();
}

// The discs in the 3 x 3 bins around a position; along an axis of one bin, in that one. Bins of a row
// follow each other, and the first one follows the last: `visit` is told the first disc, how many
// there are, and where the row starts and ends.
template <class Visit>
__device__ inline void visit_rows_around(Position s, const Visit& visit) {
    const Shared& sh = shared();
    const unsigned* const bin_end = sh.search.bin_end;
    const int nx = sh.control.bins[0];
    const int ny = sh.control.bins[1];
    const int bx = bin_of(s.x, nx);
    const int by = bin_of(s.y, ny);
    const int left = bx == 0 ? nx - 1 : bx - 1;
    const int right = bx == nx - 1 ? 0 : bx + 1;
    const auto start = [&](int bin) { return bin == 0 ? 0 : int(bin_end[bin - 1]); };
    const int beside = ny == 1 ? 0 : 1;
#pragma unroll 1
    for (int dy = -beside; dy <= beside; ++dy) {
        const int y = by + dy < 0 ? ny - 1 : by + dy == ny ? 0 : by + dy;
        const int row = y * nx;
        const int row_start = start(row);
        const int row_end = int(bin_end[row + nx - 1]);
        const int first = start(row + left);
        const int count =
            int(bin_end[row + right]) - first + (left > right ? row_end - row_start : 0);
        visit(first, count, row_start, row_end);
    }
}

// Nearest images around disc i.
__device__ void find_nearest(Found& found, Position s, Real r, unsigned i) {
    const Shared& sh = shared();
    const Real* const cell = sh.control.cell;
    const Real skin = Real(sh.control.header.skin);
    visit_rows_around(s, [&](int k, int rest, int row_start, int row_end) {
        // Tested first, some at a time, and then collected: few are near.
        constexpr int BATCH = 16, UNROLLED = 4;
        for (; rest > 0; rest -= BATCH) {
            const int first = k;
            unsigned near = 0;
#pragma unroll 1
            for (int n = 0; n < min(rest, BATCH); n += UNROLLED) {
                unsigned hits = 0;
#pragma unroll
                for (int m = 0; m < UNROLLED; ++m) {
                    if (k == row_end) k = row_start;
                    const Binned other = sh.search.binned[k++];
                    // Summed in this order both discs of a pair find the same.
                    const Real range = r + other.r + skin;
                    hits |= unsigned(length2(cell, nearest(s, other.s)) < range * range) << m;
                }
                near |= hits << n;
            }
            // Beyond the last one the row began again.
            if (rest < BATCH) near &= (1u << rest) - 1u;
            for (; near != 0; near &= near - 1) {
                const int at = first + __ffs(int(near)) - 1;
                const unsigned j =
                    sh.search.binned[at < row_end ? at : at - row_end + row_start].disc;
                if (j != i) found.add(j << 16);
            }
        }
    });
}

// All images around disc i, its own included: right for any cell.
__device__ __noinline__ void find_images(Found& found, Position s, Real r, unsigned i) {
    const Shared& sh = shared();
    const double skin = sh.control.header.skin;
    const Matrix h = sh.control.header.cell;
    const double per_width_x = sh.control.per_width[0], per_width_y = sh.control.per_width[1];
    visit_rows_around(s, [&](int k, int rest, int row_start, int row_end) {
#pragma unroll 1
        for (; rest > 0; --rest) {
            if (k == row_end) k = row_start;
            const Binned other = sh.search.binned[k++];
            const double range = double(r) + double(other.r) + skin;
            const Vec d = nearest(s, other.s);
            const double x = double(d.x) / PERIOD;
            const double y = double(d.y) / PERIOD;
            // |s_x| > range / width_x puts the branch out of range whatever s_y is.
            const double most_x = range * per_width_x;
            const double most_y = range * per_width_y;
            const int last_x = int(floor(most_x - x));
            const int last_y = int(floor(most_y - y));
            for (int ky = int(ceil(-most_y - y)); ky <= last_y; ++ky) {
                for (int kx = int(ceil(-most_x - x)); kx <= last_x; ++kx) {
                    if (i == other.disc && kx == 0 && ky == 0) continue;
                    const double sx = x + kx;
                    const double sy = y + ky;
                    const double lx = h.xx * sx + h.xy * sy;
                    const double ly = h.yx * sx + h.yy * sy;
                    if (!(lx * lx + ly * ly < range * range)) continue;
                    // Near half a period the unsigned reading does not jump.
                    const bool ux = fabs(x) > 0.25;
                    const bool uy = fabs(y) > 0.25;
                    const int shift_x = kx - int(ux && x < 0.0);
                    const int shift_y = ky - int(uy && y < 0.0);
                    if (min(shift_x, shift_y) < -32 || max(shift_x, shift_y) > 31) {
                        found.count = ROWS + 1;
                        continue;
                    }
                    found.add(other.disc << 16 | image_code(shift_y, uy) << 7 |
                              image_code(shift_x, ux));
                }
            }
        }
    });
}
