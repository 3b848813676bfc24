/* A drive as the native step sees it, in C: what shared.py writes follows. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

typedef int64_t integer;
typedef int (*casadi_function)(const double **, double **, integer *, double *, int);
