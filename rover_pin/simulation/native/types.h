/* Types of the step. The struct Drive, which shared.py writes, follows in the source. */
#include <stddef.h>
#include <string.h>

typedef int64_t integer;
typedef double real;
/* A function that CasADi generates: inputs, outputs, integer and real work space, memory slot. */
typedef int (*casadi_function)(const double **, double **, integer *, double *, int);
/* inputs: contact or motor, states, constants; then the output. Entry i of each is LANES numbers */
typedef void (*lanes_function)(const double *, const double *, const double *, double *);
/* The on-board slip estimate: its memory, the sample, whether the rover drives backwards, a late speed or NAN. */
typedef void (*sense_function)(void *, const double *, integer, double);
/* Eight numbers that are added and multiplied together; it may alias a plain array of doubles. */
typedef double Row __attribute__((vector_size(64), may_alias));

/* Maximum and minimum, inlined. Unlike fmax and fmin they do not look for NaN. */
static inline double larger(double a, double b) { return b > a ? b : a; }
static inline double smaller(double a, double b) { return b < a ? b : a; }
