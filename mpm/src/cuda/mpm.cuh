// What all kernels of the solver share: vectors, matrices, and the state in device memory.
// Per unit thickness, SI, tension positive.

typedef unsigned long long u64;

struct alignas(16) Vec {
    double x, y;
};

// Row by row.
struct alignas(16) Matrix {
    double xx, xy, yx, yy;
};

__device__ inline Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y}; }
__device__ inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y}; }
__device__ inline Vec operator*(Vec a, double s) { return {a.x * s, a.y * s}; }
__device__ inline Vec operator/(Vec a, double s) { return {a.x / s, a.y / s}; }
__device__ inline double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y; }
__device__ inline double norm(Vec a) { return sqrt(dot(a, a)); }
__device__ inline bool finite(Vec a) { return isfinite(a.x) && isfinite(a.y); }

__device__ inline Matrix operator+(Matrix a, Matrix b) {
    return {a.xx + b.xx, a.xy + b.xy, a.yx + b.yx, a.yy + b.yy};
}
__device__ inline Matrix operator*(Matrix a, double s) {
    return {a.xx * s, a.xy * s, a.yx * s, a.yy * s};
}
__device__ inline Vec operator*(const Matrix& a, Vec v) {
    return {a.xx * v.x + a.xy * v.y, a.yx * v.x + a.yy * v.y};
}
// v (x) w
__device__ inline Matrix outer(Vec v, Vec w) { return {v.x * w.x, v.x * w.y, v.y * w.x, v.y * w.y}; }
__device__ inline double trace(const Matrix& a) { return a.xx + a.yy; }
__device__ inline bool finite(const Matrix& a) {
    return isfinite(a.xx) && isfinite(a.xy) && isfinite(a.yx) && isfinite(a.yy);
}

__device__ inline double infinity() { return __longlong_as_double(0x7ff0000000000000); }

// Ends a list of points.
constexpr int NOBODY = -1;

// Basis functions of all nodes that one point sees.
struct Stencil {
    // From the point to the lowest, leftmost node (m).
    Vec corner;
    // Along x and y: values, gradients (1/m), affine weights (1/m).
    double value[2][WIDTH], gradient[2][WIDTH], affine[2][WIDTH];
    // Index of that node.
    int node;
};

// A rigid box with the friction of its left, right, bottom and top face (0 slips, infinity sticks).
struct Obstacle {
    double min[2], max[2];
    double friction[4];
    double velocity[2];
    double start;
};

// A box as it stands and moves in one step; sides on or behind a wall are at infinity.
struct Placed {
    double min[2], max[2];
    double friction[4];
    Vec velocity;
};

// Points sorted by cells, cell by cell a list that ascends. Entries of `head` and `first` hold the
// step they were made in (upper half) and a point: those of older steps mean an empty cell.
struct Bins {
    int* cell;
    // As pushed, in any order.
    u64* head;
    int* next;
    // Ascending.
    u64* first;
    int* successor;
};

// Where the run is. A failure is the phase of the step it happened in (upper half) and the point: the
// smallest is the one that the CPU would have met first. From the next step on nothing moves.
struct Clock {
    u64 step;
    u64 failure;
    u64 running;
};

constexpr u64 NO_FAILURE = ~u64(0);
// Of a step: USF updates stresses before points move, the others after.
enum Phase : unsigned { STRESS_FIRST, MOTION, STRESS_LAST };
// Why a point failed; from INSIDE_OBSTACLE on with the index of the obstacle.
enum Fault : int { NOT_FINITE = 1, OUTSIDE_DOMAIN, BAD_RESPONSE, MATERIAL, INSIDE_OBSTACLE };

struct Mpm {
    double cell, width, height;
    double dt;
    double gravity_x, gravity_y;
    // Nodes up to this mass (kg/m) are left at rest.
    double cutoff;
    double pic_share;
    // Of the walls: left, right, bottom, top.
    double friction[4];
    u64 first_step;
    int columns, rows, cells_x, cells_y;
    int points, obstacles, affine;
    unsigned stress_phase;

    Clock* clock;
    const Obstacle* obstacle;
    // At the beginning of the step, then at its end.
    Placed* placed;

    Vec* position;
    Vec* velocity;
    Matrix* affine_velocity;
    const double* mass;
    double* volume;
    Matrix* velocity_gradient;
    Matrix* stress;
    Stencil* stencil;
    int* fault;

    double* node_mass;
    Vec* node_momentum;
    Vec* node_old_velocity;
    Vec* node_velocity;
    // Speeds along x and y up to which a node may approach the walls it lies on in this step.
    Vec* node_approach;

    // What contacts have done since the ledger was last summed: arrays over nodes and over points
    // of impulses by the walls (x, y) and by each obstacle (x, y), work of the obstacles, and how
    // often a point was moved back.
    double* node_ledger;
    double* point_ledger;

    // By the lowest, leftmost node, and by the cell of the background grid.
    Bins bins;
    Bins cells;
    // Of each cell: sum V_p and sum V_p tr L_p.
    Vec* cell_sum;
};

static_assert(sizeof(Stencil) == STENCIL_BYTES && sizeof(Obstacle) == OBSTACLE_BYTES &&
                  sizeof(Placed) == PLACED_BYTES && sizeof(Mpm) == MPM_BYTES,
              "laid out as memory.rs has it");

__device__ inline int thread_index() { return int(blockIdx.x * blockDim.x + threadIdx.x); }

// Begins every kernel of a step; false if the run has failed.
__device__ inline bool may_run(const Mpm& m) {
    await_turn();
    return m.clock->running;
}

// The point of this thread, or NOBODY if there is none or the run has failed.
__device__ inline int point_of_thread(const Mpm& m) {
    const int p = thread_index();
    return may_run(m) && p < m.points ? p : NOBODY;
}

__device__ inline void raise(const Mpm& m, unsigned phase, int point, int fault) {
    // The first of a point counts: others follow from it.
    if (m.fault[point] == 0) m.fault[point] = fault;
    atomicMin(&m.clock->failure, u64(phase) << 32 | u64(point));
}

// A stress that is not finite or a volume that is not positive is a failure.
__device__ inline void check_response(const Mpm& m, int p, const Matrix& stress, double volume) {
    if (!(finite(stress) && isfinite(volume) && volume > 0.0)) {
        raise(m, m.stress_phase, p, BAD_RESPONSE);
    }
}
