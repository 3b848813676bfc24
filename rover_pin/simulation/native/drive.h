/* What the files of the step share besides the struct Drive, which shared.py writes. */
#define PI 3.14159265358979323846
#define UNDECIDED_SHARE 100.0 /* direction speed over the speed below which both speeds decide alike */
#define DEEPEST 0.98 /* sinkage over radius at which the law is held; drives stop long before */

enum { OK, NOT_FINITE, SINGULAR, ASKS, FAILS };
enum { DRIVING, IN_HAND, ON_THE_SOIL }; /* settling: in hand the soil is not sheared, whatever the speeds */

typedef struct {
  double s, t;       /* start point in the wheel plane, from the centre */
  double n_s, n_t;   /* in-plane unit normal */
  double normal[3];  /* normal in the world */
  integer ground;
} Facet;

typedef struct {
  double sinkage;           /* of the facet's plane */
  double share, tilt, turn; /* of the plane's load, by the share of the width */
  double side;              /* push of a lane's edge along y, per normal force */
  double n_s, n_t, normal[3];
  integer ground;
} Patch;

_Static_assert(sizeof(Facet) == 8 * N_FACET && sizeof(Patch) == 8 * N_PATCH, "shared.py sizes their arrays");

typedef struct { /* Jacobian of the centre in columns: along (lin), about (ang), and about the axle (rim) */
  _Alignas(64) double lin[3][MAX_COLS], ang[3][MAX_COLS], rim[MAX_COLS];
  double centre[3], axle[3], forward[3], up[3], velocity[3], rate[3], spin;
  const integer *cols;
  integer n, rows; /* columns, and rows of 8 that hold them */
} Wheel;

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/* Sum of a row times a column, both in whole rows of 8. */
static double along(const double *row, const double *speeds, integer rows) {
  const Row *a = (const Row *)row, *b = (const Row *)speeds;
  Row sum = a[0] * b[0];
  for (integer k = 1; k < rows; ++k) sum += a[k] * b[k];
  return ((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7]));
}

static void cross(const double *a, const double *b, double *out) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

static void unit(double *a) {
  double scale = 1.0 / sqrt(dot(a, a));
  for (int i = 0; i < 3; ++i) a[i] *= scale;
}
