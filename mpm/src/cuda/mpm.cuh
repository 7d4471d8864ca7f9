// What all kernels of the solver share. Per unit thickness, SI, tension positive. The structs that Rust
// knows too are defined in abi.rs.

typedef unsigned long long u64;
using Vec = Vector;

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

static_assert(sizeof(Stencil) == STENCIL_BYTES, "as long as in abi.rs");

constexpr u64 NO_FAILURE = ~u64(0);

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
