// Which RVE a block takes. Blocks start in the order of their index, and a search makes one slow:
// RVEs that may soon need one go first, lest a slow block be left alone at the end. Results do not
// depend on this order.

__device__ inline unsigned next_rve(const Batch& b, unsigned launch) {
    const Turn turn = b.turn[blockIdx.x];
    return (launch & 1u) == 0 ? turn.even : turn.odd;
}

// Queues an RVE for the launch after number `launch`; one thread.
__device__ void queue_again(const Batch& b, unsigned launch, unsigned rve, bool slow) {
    const unsigned long long queued = atomicAdd(&b.queue->queued, slow ? 1ull << 32 : 1ull);
    const unsigned front = unsigned(queued >> 32);
    const unsigned back = unsigned(queued);
    const unsigned place = slow ? front : gridDim.x - 1 - back;
    ((launch & 1u) == 0 ? b.turn[place].odd : b.turn[place].even) = rve;
    if (front + back == gridDim.x - 1) *b.queue = {0, launch + 1};
}
