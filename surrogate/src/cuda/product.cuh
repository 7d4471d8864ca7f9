// The gradient of a linear's weights, X^T dZ, and of its bias, the column sums of dZ. The rows are
// shared out among blocks, whose sums `reduce_gradient` adds up in a fixed order.

struct Product {
    const u32* count;
    // X, rows x 128; row k is row `index[k]` if there is an index.
    const Stored* x;
    const u32* index;
    // X, rows x feature_count, if `x` is null.
    const float* features;
    // dZ, rows x 128.
    const Stored* dz;
    // Sums of each block: 128 x 128 and 128 numbers.
    float* weight;
    float* bias;
    u32 rows;
    int feature_count, blocks;
};
