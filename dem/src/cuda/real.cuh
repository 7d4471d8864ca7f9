// Working precision, and positions as fixed-point fractions: twin of dem/src/real.rs.
//
// Compile-time constant: REAL_BITS, 32 or 64.

#if REAL_BITS == 32
using Real = float;
using Fraction = unsigned;
using Signed = int;
constexpr double PERIOD = 4294967296.0;
#else
using Real = double;
using Fraction = unsigned long long;
using Signed = long long;
constexpr double PERIOD = 18446744073709551616.0;
#endif

__device__ inline Fraction moved(Fraction s, Real units) {
#if REAL_BITS == 32
    return s + Fraction(__float2int_rn(units));
#else
    return s + Fraction(__double2ll_rn(units));
#endif
}

__device__ inline int bin_of(Fraction s, int bins) {
#if REAL_BITS == 32
    return int(__umulhi(s, unsigned(bins)));
#else
    return int(__umul64hi(s, (unsigned long long)(bins)));
#endif
}
