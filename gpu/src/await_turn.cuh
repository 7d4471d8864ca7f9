// Begins a kernel that may be launched early (`Launch::early`): waits until the kernel before it is
// done, and allows the kernel after it to be launched.
__device__ inline void await_turn() {
#if __CUDA_ARCH__ >= 900
    asm volatile("griddepcontrol.wait;" ::: "memory");
    asm volatile("griddepcontrol.launch_dependents;");
#endif
}
