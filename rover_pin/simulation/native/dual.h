/* Dual numbers: a value and its derivatives by several numbers, which forward-mode differentiation carries through a
   computation (Griewank and Walther, Evaluating Derivatives, 2008, chapter 3). Entry 0 of the vector is the value,
   each other entry a derivative. dual.py translates the C of the step so that its doubles become dual numbers. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

typedef int64_t integer;
typedef double Dual __attribute__((vector_size(8 * DUAL_SIZE), aligned(8), may_alias));
/* Eight dual numbers that are added and multiplied together: the Row of types.h. */
typedef struct { Dual at[8]; } Row;
typedef int64_t Cells __attribute__((vector_size(64)));

#define LANES 1 /* the laws are evaluated for one patch or wheel at a time; the vector holds the derivatives */

static inline Dual dual(double x) { return (Dual){x}; }
/* A function with this value, whose derivative by x is `slope`. */
static inline Dual dual_chain(Dual x, double value, double slope) {
  Dual y = x * slope;
  y[0] = value;
  return y;
}
/* A function of two arguments; a slope that is not finite does not count where the argument is constant. */
static inline int dual_varies(Dual x) {
  for (int k = 1; k < DUAL_SIZE; ++k) if (x[k] != 0.0) return 1;
  return 0;
}
static inline Dual dual_chain2(Dual x, Dual y, double value, double by_x, double by_y) {
  Dual z = dual(value);
  if (dual_varies(x)) z += x * by_x;
  if (dual_varies(y)) z += y * by_y;
  z[0] = value;
  return z;
}

static inline Dual dual_mul(Dual x, Dual y) {
  const Dual mask = dual(-1.0) + 1.0; /* 0 for the value, 1 for the derivatives */
  return x * y[0] + y * (mask * x[0]);
}
static inline Dual dual_div(Dual x, Dual y) {
  const double value = x[0] / y[0];
  Dual z = (x - y * value) * (1.0 / y[0]);
  z[0] = value;
  return z;
}
/* Equal values with equal derivatives: where the C tests for an exact number, it takes a short cut whose derivatives
   would be wrong if only the values were equal. */
static inline int dual_same(Dual x, Dual y) {
  for (int k = 0; k < DUAL_SIZE; ++k) if (x[k] != y[k]) return 0;
  return 1;
}
static inline Dual *dual_increment(Dual *x) {
  (*x)[0] += 1.0;
  return x;
}

/* Elementary functions. At a point without a derivative (the root of 0) the derivatives are 0. */
#define DUAL_OF(f, slope)                                                  \
  static inline Dual dual_##f(Dual a) {                                    \
    const double x = a[0], y = f(x);                                       \
    (void)x;                                                               \
    return dual_chain(a, y, slope);                                        \
  }
DUAL_OF(sqrt, y > 0.0 ? 0.5 / y : 0.0)
DUAL_OF(exp, y)
DUAL_OF(expm1, y + 1.0)
DUAL_OF(log, 1.0 / x)
DUAL_OF(log1p, 1.0 / (1.0 + x))
DUAL_OF(sin, cos(x))
DUAL_OF(cos, -sin(x))
DUAL_OF(tan, 1.0 + y * y)
DUAL_OF(asin, fabs(x) < 1.0 ? 1.0 / sqrt(1.0 - x * x) : 0.0)
DUAL_OF(acos, fabs(x) < 1.0 ? -1.0 / sqrt(1.0 - x * x) : 0.0)
DUAL_OF(atan, 1.0 / (1.0 + x * x))
DUAL_OF(sinh, cosh(x))
DUAL_OF(cosh, sinh(x))
DUAL_OF(tanh, 1.0 - y * y)
DUAL_OF(erf, 1.1283791670955126 * exp(-x * x)) /* 2 / sqrt(pi) */
DUAL_OF(rint, 0.0)
static inline Dual dual_fabs(Dual x) { return x[0] < 0.0 ? -x : x; }
static inline Dual dual_fmax(Dual x, Dual y) { return x[0] > y[0] ? x : y; }
static inline Dual dual_fmin(Dual x, Dual y) { return x[0] < y[0] ? x : y; }
static inline Dual dual_copysign(Dual x, Dual y) { return signbit(x[0]) == signbit(y[0]) ? x : -x; }
static inline Dual dual_remainder(Dual x, Dual y) {
  const double value = remainder(x[0], y[0]);
  return dual_chain2(x, y, value, 1.0, -rint((x[0] - value) / y[0]));
}
static inline Dual dual_atan2(Dual y, Dual x) {
  const double square = x[0] * x[0] + y[0] * y[0];
  return dual_chain2(y, x, atan2(y[0], x[0]), x[0] / square, -y[0] / square);
}
static inline Dual dual_pow(Dual x, Dual n) {
  const double value = pow(x[0], n[0]);
  return dual_chain2(x, n, value, n[0] * pow(x[0], n[0] - 1.0), x[0] > 0.0 ? value * log(x[0]) : 0.0);
}

/* CasADi's logic: 1.0 is true, 0.0 is false. */
static inline double dual_truth(int64_t m) { return m != 0; }
static inline double dual_sign(Dual x) { return (x[0] > 0.0) - (x[0] < 0.0); }
static inline Dual dual_if(Dual c, Dual x) { return c[0] != 0.0 ? x : dual(0.0); }

/* Operations of rows. The eight entries are written out, because compilers keep the rows in registers then. */
#define AT(place, target, entry) { enum { k = place }; target = entry; }
#define ALL_EIGHT(target, entry)                                                                        \
  AT(0, target, entry) AT(1, target, entry) AT(2, target, entry) AT(3, target, entry)                   \
  AT(4, target, entry) AT(5, target, entry) AT(6, target, entry) AT(7, target, entry)
#define EACH_OF_ROW(name, parameters, entry)             \
  static inline Row name parameters {                    \
    Row out;                                             \
    ALL_EIGHT(out.at[k], entry)                          \
    return out;                                          \
  }
EACH_OF_ROW(row_of, (Dual x), x)
EACH_OF_ROW(row_add, (Row a, Row b), a.at[k] + b.at[k])
EACH_OF_ROW(row_sub, (Row a, Row b), a.at[k] - b.at[k])
EACH_OF_ROW(row_mul, (Row a, Row b), dual_mul(a.at[k], b.at[k]))
EACH_OF_ROW(row_div, (Row a, Row b), dual_div(a.at[k], b.at[k]))
EACH_OF_ROW(row_scale, (Row a, Dual x), dual_mul(a.at[k], x))
EACH_OF_ROW(row_where, (Cells m, Row a, Row b), m[k] ? a.at[k] : b.at[k])
EACH_OF_ROW(row_from_cells, (Cells m), dual((double)m[k]))
#define ROW_CELLS(name, parameters, entry)               \
  static inline Cells name parameters {                  \
    Cells out;                                           \
    ALL_EIGHT(out[k], entry)                             \
    return out;                                          \
  }
ROW_CELLS(row_to_cells, (Row a), (int64_t)a.at[k][0])
ROW_CELLS(row_greater, (Row a, Row b), -(int64_t)(a.at[k][0] > b.at[k][0]))
ROW_CELLS(row_less, (Row a, Row b), -(int64_t)(a.at[k][0] < b.at[k][0]))
