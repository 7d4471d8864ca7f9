// Types and constants of all files. The structs that Rust knows too are defined in abi.rs.
//
// Compile-time constants, defined by shape.rs:
//   DISCS         discs in an RVE
//   THREADS       DISCS rounded up to whole warps
//   ROWS          most neighbours a disc may have
//   SLOTS         room for the listed pairs at their owners; twice that at the other discs, whose
//                 numbers of pairs are more unequal
//   BLOCKS        thread blocks that one multiprocessor should hold
//   SHARED_BYTES  what shape.rs reserves for `Shared`
//   ROLLING       1 where contacts resist rolling, else 0
//   UNEQUAL       1 where each RVE has parameters of its own, else 0

constexpr int LANES = 32;
constexpr int WARPS = THREADS / LANES;
constexpr unsigned ALL = 0xffffffffu;
constexpr int INCOMING_SLOTS = 2 * SLOTS;
// Springs of a pair: the tangential and, where contacts resist rolling, the rolling one.
constexpr int SPRINGS = 1 + ROLLING;

static_assert(THREADS % LANES == 0 && DISCS <= THREADS && THREADS <= 1024);
// Rows are marked in 32-bit masks.
static_assert(ROWS <= 31 && SLOTS % LANES == 0 && INCOMING_SLOTS < 65536);

using Matrix = Tensor;
using Vec = Vector;
