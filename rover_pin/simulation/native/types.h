/* A drive as the native step sees it, in C: what shared.py writes follows. */
#include <stddef.h>
#include <string.h>

typedef int64_t integer;
typedef double real;
typedef int (*casadi_function)(const double **, double **, integer *, double *, int);
typedef void (*lanes_function)(const double *, const double *, const double *, double *); /* varying, states, constants */
typedef void (*sense_function)(void *, const double *, integer, double);
typedef double Row __attribute__((vector_size(64), may_alias));

/* As fmax and fmin for numbers, without their calls. */
static inline double larger(double a, double b) { return b > a ? b : a; }
static inline double smaller(double a, double b) { return b < a ? b : a; }
