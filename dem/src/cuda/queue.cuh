// Which RVE a block takes. Blocks start in the order of their index, and a search makes one slow:
// RVEs that may soon need one go first, lest a slow block be left alone at the end. Results do not
// depend on this order.

__device__ inline unsigned next_rve(const Batch& b) {
    const uint2 turn = b.turn[blockIdx.x];
    return (b.queue->launch & 1u) == 0 ? turn.x : turn.y;
}

// Queues an RVE for the next launch; one thread, when it is done with everything else.
__device__ void queue_again(const Batch& b, unsigned rve, bool slow) {
    Queue& q = *b.queue;
    const unsigned launch = q.launch;
    const unsigned place = slow ? atomicAdd(&q.front, 1u) : gridDim.x - 1 - atomicAdd(&q.back, 1u);
    ((launch & 1u) == 0 ? b.turn[place].y : b.turn[place].x) = rve;
    __threadfence();
    if (atomicAdd(&q.finished, 1u) == gridDim.x - 1) q = {launch + 1, 0, 0, 0};
}
