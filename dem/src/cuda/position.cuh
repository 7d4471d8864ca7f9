// Positions as fractions of the cell, and periodic images: twin of dem/src/real.rs.

__device__ inline Real length2(const Real* cell, Vec d) {
    const Real x = cell[0] * d.x + cell[1] * d.y;
    const Real y = cell[2] * d.x + cell[3] * d.y;
    return x * x + y * y;
}

// Nearest image of b - a, in units of `Fraction`.
__device__ inline Vec nearest(Position a, Position b) {
    return {Real(Signed(b.x - a.x)), Real(Signed(b.y - a.y))};
}

// An image along one cell vector: seven bits, shift + 32 and whether the reading is unsigned.
__device__ inline unsigned image_code(int shift, bool is_unsigned) {
    return unsigned(shift + 32) << 1 | unsigned(is_unsigned);
}

// The image of i seen from j, if `code` is that of j seen from i, along one cell vector.
__device__ inline unsigned reversed(unsigned code) {
    const bool is_unsigned = code & 1u;
    return image_code(32 - int(code >> 1) - int(is_unsigned), is_unsigned);
}

// Both cell vectors: seven bits each, that of the second one above.
constexpr unsigned ZERO_IMAGE = 64u << 7 | 64u;

// Whether disc i at a, and not j at b, evaluates their pair: the one below, so that every disc owns
// about half of its pairs; `a` and `b` are the positions at the search. Among several images it is
// the disc of lower index, and of two images of a disc itself the positive one.
__device__ inline bool owns(unsigned i, Position a, unsigned j, Position b, bool imaged,
                            unsigned image) {
    if (i == j) return image > ZERO_IMAGE;
    const Fraction up = b.y - a.y;
    const Fraction down = a.y - b.y;
    return imaged || up == down ? i < j : Signed(up) > 0;
}

// d + k periods, where d is the signed difference; odd in (d, k).
__device__ inline Real image(Fraction difference, unsigned code) {
    const Signed d = Signed(difference);
    const bool carry = (code & 1u) != 0 && d < 0;
    const int k = int(code >> 1) - 32 + int(carry);
#if REAL_BITS == 32
    return Real((long long)d + (long long)k * 4294967296LL);
#else
    return Real(d) + k * PERIOD;
#endif
}

// Branch from a to its neighbour b in units of `Fraction`; the image is in the upper half of `word`.
template <bool IMAGED>
__device__ inline Vec separation(Position a, Position b, unsigned word) {
    if (IMAGED) {
        return {image(b.x - a.x, word >> 16 & 127u), image(b.y - a.y, word >> 23)};
    }
    return nearest(a, b);
}

__device__ inline Vec branch(const Real* cell, Vec d) {
    return {cell[0] * d.x + cell[1] * d.y, cell[2] * d.x + cell[3] * d.y};
}
