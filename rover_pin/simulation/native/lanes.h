/* A SIMD vector V has one number for each of LANES patches or wheels. The vector types are those of GCC and Clang.
   With -DLIBMVEC the elementary functions are those of glibc's libmvec; without, each lane calls libm in turn, so
   that one source serves all machines. */
#include <math.h>
#include <stdint.h>

/* Widest vector of this processor, and the names of libmvec's functions for it. */
#if defined(__AVX512F__)
#define LANES 8
#define MVEC(f) _ZGVeN8v_##f
#define MVEC2(f) _ZGVeN8vv_##f
#elif defined(__AVX2__)
#define LANES 4
#define MVEC(f) _ZGVdN4v_##f
#define MVEC2(f) _ZGVdN4vv_##f
#else
#define LANES 2
#define MVEC(f) _ZGVbN2v_##f
#define MVEC2(f) _ZGVbN2vv_##f
#endif

typedef double V __attribute__((vector_size(8 * LANES)));
typedef int64_t VMask __attribute__((vector_size(8 * LANES)));
#define ALL(x) ((V){0} + (x)) /* a vector with this number in all lanes */

/* EACH defines a function that calls libm once for each lane, TOGETHER one that calls libmvec for all lanes, where
   that exists. */
#define EACH(f)                                              \
  static inline V v_##f(V x) {                               \
    for (int lane = 0; lane < LANES; ++lane) x[lane] = f(x[lane]); \
    return x;                                                \
  }
#define EACH2(f)                                             \
  static inline V v_##f(V x, V y) {                          \
    for (int lane = 0; lane < LANES; ++lane) x[lane] = f(x[lane], y[lane]); \
    return x;                                                \
  }
#ifdef LIBMVEC
#define TOGETHER(f)                 \
  extern V MVEC(f)(V) __attribute__((const)); \
  static inline V v_##f(V x) { return MVEC(f)(x); }
#define TOGETHER2(f)                \
  extern V MVEC2(f)(V, V) __attribute__((const)); \
  static inline V v_##f(V x, V y) { return MVEC2(f)(x, y); }
#else
#define TOGETHER EACH
#define TOGETHER2 EACH2
#endif

EACH(sqrt)
TOGETHER(exp) TOGETHER(expm1) TOGETHER(log) TOGETHER(log1p) TOGETHER(sin) TOGETHER(cos) TOGETHER(tan) TOGETHER(asin)
TOGETHER(acos) TOGETHER(atan) TOGETHER(sinh) TOGETHER(cosh) TOGETHER(tanh) TOGETHER(erf) TOGETHER2(pow) TOGETHER2(atan2)

/* Comparisons give masks of all ones or all zeros. A mask becomes 1.0 or 0.0 (v_truth), as CasADi's logic expects. */
static inline V v_where(VMask m, V a, V b) { return (V)((m & (VMask)a) | (~m & (VMask)b)); }
static inline V v_truth(VMask m) { return (V)(m & (VMask)ALL(1.0)); }
static inline V v_fabs(V x) { return (V)((VMask)x & 0x7fffffffffffffffLL); }
static inline V v_fmax(V a, V b) { return v_where(a > b, a, b); }
static inline V v_fmin(V a, V b) { return v_where(a < b, a, b); }
static inline V v_sign(V a) { return v_truth(a > 0.0) - v_truth(a < 0.0); }
static inline V v_not(V a) { return v_truth(a == 0.0); }
static inline V v_and(V a, V b) { return v_truth((a != 0.0) & (b != 0.0)); }
static inline V v_or(V a, V b) { return v_truth((a != 0.0) | (b != 0.0)); }
static inline V v_if(V c, V x) { return (V)((VMask)x & (c != 0.0)); }
