// Begins a kernel that may have taken its place early (`Launch::early`): waits until the
// kernel before it is done, and lets the one behind take its place.
__device__ inline void await_turn() {
#if __CUDA_ARCH__ >= 900
    asm volatile("griddepcontrol.wait;" ::: "memory");
    asm volatile("griddepcontrol.launch_dependents;");
#endif
}
