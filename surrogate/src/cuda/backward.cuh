// What the backward kernels of MLPs take.

struct Backward {
    // Number of rows.
    const u32* count;
    // Gradient of the output, the sum of up to four: rows x 128, row `index[k]` of it, ...
    const Stored* output;
    const u32* output_index;
    // ... in f32, ...
    float* output32;
    // ... x_0 W_0 + x_1 W_1 with packed and transposed weights, if these are not null (rows x 128; the
    // sum with `output32` goes there if something is to be added to it), ...
    const Stored* parts[2];
    const uint4* part_weights;
    // ... row `gathered_index[k]` of a matrix.
    const float* gathered;
    const u32* gathered_index;
    // If there is a selection, rows count where it is NONE (`select_none` = 1) or is not.
    const u32* selection;
    // What the forward pass left.
    const Stored* hidden;
    size_t stride;
    const Stored* normal;
    const float* deviation;
    // Hidden layers, the last first, then x_0, x_1; packed and transposed, or (edges_backward.cu)
    // plain.
    const uint4* weights;
    const float* parameters;
    // Products for the weights' gradients, if they are added up on the way (edges_backward.cu).
    const Product* products;
    // Gradients of the linears' outputs, `stride` apart, the first linear's first.
    Stored* linear;
    // Gradients of x_0 and x_1 if not null, added to what is there if bit 0 or 1 of `accumulate` is
    // set.
    float* input32[2];
    Stored* input;
    // For each block, gradients of LayerNorm's scale and shift, 128 each.
    float* norm_sums;
    // Gradients of the first linear's outputs, summed over rows with the same `gathered_index`
    // (edges_backward.cu).
    float* sums;

    int units, select_none;
    int norm, layers, width, accumulate;
    // Number of products, and of blocks that share the rows.
    int product_count, blocks;
    float slope;
};

struct BackwardBatch {
    Backward item[8];
};
