// Copies between device and shared memory that go on while threads compute. Addresses and bytes are
// multiples of 16. The threads for which `copies` is true make these calls, and all those that wait.

#if __CUDA_ARCH__ >= 900

// Whole arrays at a time, on behalf of one thread. It is in the last warp: the first one has else to
// do.
using Copies = unsigned long long;

__device__ inline bool copies(int t) { return t == THREADS - 1; }

__device__ inline unsigned shared_address(const void* p) {
    return unsigned(__cvta_generic_to_shared(p));
}

// Others may wait after a barrier.
__device__ inline void begin_copies(Copies& copies) {
    asm volatile(
        "mbarrier.init.shared::cta.b64 [%0], 1;\n\t"
        "fence.proxy.async.shared::cta;" ::"r"(shared_address(&copies)) : "memory");
}

__device__ inline void fetch(Copies& copies, void* to, const void* from, unsigned bytes) {
    if (bytes == 0) return;
    asm volatile(
        "mbarrier.expect_tx.relaxed.cta.shared::cta.b64 [%0], %3;\n\t"
        "cp.async.bulk.shared::cluster.global.mbarrier::complete_tx::bytes [%1], [%2], %3, [%0];" ::
            "r"(shared_address(&copies)), "r"(shared_address(to)), "l"(from), "r"(bytes) : "memory");
}

__device__ inline void end_copies(Copies& copies) {
    asm volatile(
        "{.reg .b64 state;\n\t"
        "mbarrier.arrive.shared::cta.b64 state, [%0];}" ::"r"(shared_address(&copies)) : "memory");
}

__device__ inline void wait_for_copies(Copies& copies) {
    asm volatile(
        "{.reg .pred done;\n\t"
        "again: mbarrier.try_wait.parity.shared::cta.b64 done, [%0], 0;\n\t"
        "@!done bra again;}" ::"r"(shared_address(&copies)) : "memory");
}

// What this thread wrote to shared memory may be stored after a barrier.
__device__ inline void offer_stores() {
    asm volatile("fence.proxy.async.shared::cta;" ::: "memory");
}

__device__ inline void store(void* to, const void* from, unsigned bytes) {
    if (bytes == 0) return;
    asm volatile("cp.async.bulk.global.shared::cta.bulk_group [%0], [%1], %2;" ::"l"(to),
                 "r"(shared_address(from)), "r"(bytes) : "memory");
}

// Until the block may end.
__device__ inline void end_stores() {
    asm volatile(
        "cp.async.bulk.commit_group;\n\t"
        "cp.async.bulk.wait_group.read 0;" ::: "memory");
}

#else

// Each thread a part of every array.
struct Copies {};

__device__ inline bool copies(int) { return true; }

__device__ inline void begin_copies(Copies&) {}

__device__ inline void fetch(Copies&, void* to, const void* from, unsigned bytes) {
    const unsigned first = unsigned(__cvta_generic_to_shared(to));
    const char* const source = static_cast<const char*>(from);
#pragma unroll 1
    for (unsigned k = 16 * threadIdx.x; k < bytes; k += 16 * THREADS) {
        asm volatile("cp.async.cg.shared.global [%0], [%1], 16;" ::"r"(first + k), "l"(source + k)
                     : "memory");
    }
}

__device__ inline void end_copies(Copies&) {}

__device__ inline void wait_for_copies(Copies&) {
    asm volatile("cp.async.wait_all;" ::: "memory");
    __syncthreads();
}

__device__ inline void offer_stores() {}

__device__ inline void store(void* to, const void* from, unsigned bytes) {
#pragma unroll 1
    for (unsigned k = threadIdx.x; k < bytes / 16; k += THREADS) {
        static_cast<uint4*>(to)[k] = static_cast<const uint4*>(from)[k];
    }
}

__device__ inline void end_stores() {}

#endif
