// PTX instructions: tensor cores, asynchronous copies, dependent launches.

typedef unsigned int u32;

// d += a b with a 16 x 16, b 16 x 8 of bf16 or f16 and d 16 x 8 of f32. With g = lane / 4 and
// t = lane % 4 a lane holds a: (g, 2t), (g + 8, 2t), (g, 2t + 8), (g + 8, 2t + 8), each with its
// right neighbour; b: (2t, g), (2t + 8, g), each with the one below; d: (g, 2t), (g, 2t + 1),
// (g + 8, 2t), (g + 8, 2t + 1).
__device__ __forceinline__ void multiply_add(float (&d)[4], const u32 (&a)[4], u32 b0, u32 b1) {
    asm("mma.sync.aligned.m16n8k16.row.col.f32.bf16.bf16.f32 "
        "{%0, %1, %2, %3}, {%4, %5, %6, %7}, {%8, %9}, {%0, %1, %2, %3};"
        : "+f"(d[0]), "+f"(d[1]), "+f"(d[2]), "+f"(d[3])
        : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b0), "r"(b1));
}

__device__ __forceinline__ void multiply_add_f16(float (&d)[4], const u32 (&a)[4], u32 b0, u32 b1) {
    asm("mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32 "
        "{%0, %1, %2, %3}, {%4, %5, %6, %7}, {%8, %9}, {%0, %1, %2, %3};"
        : "+f"(d[0]), "+f"(d[1]), "+f"(d[2]), "+f"(d[3])
        : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b0), "r"(b1));
}

// Two f32 to bf16 or f16, the first in the low half.
__device__ __forceinline__ u32 pack(float low, float high) {
    u32 both;
    asm("cvt.rn.bf16x2.f32 %0, %1, %2;" : "=r"(both) : "f"(high), "f"(low));
    return both;
}

__device__ __forceinline__ u32 pack_f16(float low, float high) {
    u32 both;
    asm("cvt.rn.f16x2.f32 %0, %1, %2;" : "=r"(both) : "f"(high), "f"(low));
    return both;
}

__device__ __forceinline__ void unpack_f16(u32 both, float& low, float& high) {
    asm("{ .reg .f16 l, h; mov.b32 {l, h}, %2; cvt.f32.f16 %0, l; cvt.f32.f16 %1, h; }"
        : "=f"(low), "=f"(high)
        : "r"(both));
}

#define LOAD_MATRICES(TRANSPOSED) \
    asm volatile("ldmatrix.sync.aligned.m8n8.x4" TRANSPOSED ".shared.b16 {%0, %1, %2, %3}, [%4];" \
                 : "=r"(d[0]), "=r"(d[1]), "=r"(d[2]), "=r"(d[3]) \
                 : "r"((u32)__cvta_generic_to_shared(row)) \
                 : "memory")

// Four 8 x 8 matrices of two-byte numbers from shared memory: lane 8 m + k gives the address of row
// k of matrix m, and gets columns 2t and 2t + 1 of row g of each.
__device__ __forceinline__ void load_matrices(u32 (&d)[4], const void* row) { LOAD_MATRICES(""); }

// The same, but gets rows 2t and 2t + 1 of column g of each.
__device__ __forceinline__ void load_transposed(u32 (&d)[4], const void* row) { LOAD_MATRICES(".trans"); }
#undef LOAD_MATRICES

// Waits for all threads of the block, which may be at different places of the program.
__device__ __forceinline__ void barrier() { asm volatile("bar.sync 0;" ::: "memory"); }

// As `await_turn`, but neither instruction moves past a memory access: with `await_turn` edges_backward gets
// other registers.
__device__ __forceinline__ void wait_for_kernel_before() {
#if __CUDA_ARCH__ >= 900
    asm volatile("griddepcontrol.wait;\n"
                 "griddepcontrol.launch_dependents;" ::: "memory");
#endif
}

// Reads a value before that, past the multiprocessor's own cache, which may hold it as it was before
// the kernel before.
template <class T>
__device__ __forceinline__ T read_early(const T* from) {
    return __ldcg(from);
}

// Copies 16 bytes to shared memory without waiting, or zeros.
__device__ __forceinline__ void copy_async(void* to, const void* from, bool valid) {
    u32 address = (u32)__cvta_generic_to_shared(to);
    asm volatile("cp.async.cg.shared.global [%0], [%1], 16, %2;"
                 :
                 : "r"(address), "l"(from), "r"(valid ? 16 : 0)
                 : "memory");
}

// Copies a number to shared memory without waiting, or zero.
__device__ __forceinline__ void copy_async(float* to, const float* from, bool valid) {
    u32 address = (u32)__cvta_generic_to_shared(to);
    asm volatile("cp.async.ca.shared.global [%0], [%1], 4, %2;"
                 :
                 : "r"(address), "l"(from), "r"(valid ? 4 : 0)
                 : "memory");
}

// Ends a group of copies.
__device__ __forceinline__ void end_copies() { asm volatile("cp.async.commit_group;" ::: "memory"); }

// Waits until at most `N` groups of this thread's copies are under way.
template <int N>
__device__ __forceinline__ void wait_for_copies() {
    asm volatile("cp.async.wait_group %0;" : : "n"(N) : "memory");
}

#ifdef __CUDA_ARCH_FEAT_SM90_ALL
// Products of the four warps of a warp group, z += a b with a 64 x 16 (16 rows of each warp, laid out
// as for `multiply_add`), b 16 x 128 in shared memory and z 64 x 128 (as 16 results of `multiply_add`
// side by side). They are under way until `end_products`.
__device__ __forceinline__ void begin_products() { asm volatile("wgmma.fence.sync.aligned;" ::: "memory"); }

__device__ __forceinline__ void commit_products() {
    asm volatile("wgmma.commit_group.sync.aligned;" ::: "memory");
}

__device__ __forceinline__ void wait_for_products() {
    asm volatile("wgmma.wait_group.sync.aligned 0;" ::: "memory");
}

__device__ __forceinline__ void end_products() {
    commit_products();
    wait_for_products();
}

// Before the first products of what a thread has written to shared memory.
__device__ __forceinline__ void show_to_products() {
    asm volatile("fence.proxy.async.shared::cta;" ::: "memory");
}

// b is 16 x 2 matrices of 8 columns x 8 rows, one after the other; rows of a column are contiguous.
__device__ __forceinline__ unsigned long long describe(const void* b) {
    const unsigned long long address = (u32)__cvta_generic_to_shared(b);
    // From one matrix to that of the next rows, 128 bytes, and of the next columns, 256.
    return address >> 4 | 128ull >> 4 << 16 | 256ull >> 4 << 32;
}

#define PRODUCT(TYPE) \
    asm volatile("{ .reg .pred yes; setp.eq.u32 yes, 0, 0; " \
                 "wgmma.mma_async.sync.aligned.m64n128k16.f32." TYPE "." TYPE " {" \
                 "%0, %1, %2, %3, %4, %5, %6, %7, %8, %9, %10, %11, %12, %13, %14, %15, " \
                 "%16, %17, %18, %19, %20, %21, %22, %23, %24, %25, %26, %27, %28, %29, %30, %31, " \
                 "%32, %33, %34, %35, %36, %37, %38, %39, %40, %41, %42, %43, %44, %45, %46, %47, " \
                 "%48, %49, %50, %51, %52, %53, %54, %55, %56, %57, %58, %59, %60, %61, %62, %63}, " \
                 "{%64, %65, %66, %67}, %68, yes, 1, 1, 0; }" \
                 : FOUR(0), FOUR(1), FOUR(2), FOUR(3), FOUR(4), FOUR(5), FOUR(6), FOUR(7), \
                   FOUR(8), FOUR(9), FOUR(10), FOUR(11), FOUR(12), FOUR(13), FOUR(14), FOUR(15) \
                 : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "l"(describe(b)))
#define FOUR(j) "+f"(z[j][0]), "+f"(z[j][1]), "+f"(z[j][2]), "+f"(z[j][3])

template <bool F16>
__device__ __forceinline__ void add_product(float (&z)[16][4], const u32 (&a)[4], const void* b) {
    if (F16) PRODUCT("f16");
    else PRODUCT("bf16");
}
#undef FOUR
#undef PRODUCT
#else
__device__ __forceinline__ void begin_products() {}
__device__ __forceinline__ void end_products() {}
__device__ __forceinline__ void wait_for_products() {}
__device__ __forceinline__ void show_to_products() {}

template <bool F16>
__device__ __forceinline__ void add_product(float (&z)[16][4], const u32 (&a)[4], const uint4* b) {
#pragma unroll
    for (int j = 0; j < 8; j++) {
        u32 w[4];
        load_matrices(w, b + 32 * j + threadIdx.x % 32);
        if (F16) {
            multiply_add_f16(z[2 * j], a, w[0], w[1]);
            multiply_add_f16(z[2 * j + 1], a, w[2], w[3]);
        } else {
            multiply_add(z[2 * j], a, w[0], w[1]);
            multiply_add(z[2 * j + 1], a, w[2], w[3]);
        }
    }
}
#endif
