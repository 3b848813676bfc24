/* A height grid as a wheel's plane cuts it; eight points of the cut at once. */

#define N_CUT 8 /* facets of equal length along the wheel's plane, between 9 points; rows hold 16 */
#define N_ROWS 2
#define SETTLED 1e-14 /* m */
#define UPRIGHT 1e-13 /* of `up` along the ground, below which a point's x and y stay where they are along `up` */
#define STRAIGHT 1e-11 /* difference of unit normals up to which neighbours are one facet */

typedef int64_t Cells __attribute__((vector_size(64)));

typedef struct { /* points of the cut: in the wheel's plane, and in the world */
  Row s[N_ROWS], t[N_ROWS], x[N_ROWS], y[N_ROWS], z[N_ROWS];
} Cut;

typedef struct { Row height, slope_x, slope_y; Cells cell; } Below;

static inline Row row_where(Cells m, Row a, Row b) { return (Row)((m & (Cells)a) | (~m & (Cells)b)); }
static inline Row within(Row x, double most) {
  x = row_where(x > 0.0, x, (Row){0}); /* not a number: 0 */
  return row_where(x > most, (Row){0} + most, x);
}

static inline Cells cell_of(Row u, integer last) {
  const Cells at = __builtin_convertvector(u, Cells), beyond = at > last;
  return (beyond & last) | (~beyond & at);
}

static inline Row rate_within(Row u, double most, double rate) {
  return row_where((u < 0.0) | (u > most), (Row){0}, (Row){0} + rate);
}

/* The grid at points: its height, and its slopes, none beyond its ends. */
static inline Below look_below(const Drive *d, Row x, Row y) {
  const integer nx = d->grid_nx, ny = d->grid_ny;
  const Row out_u = (x - d->grid_x0) * d->grid_per_x, out_v = (y - d->grid_y0) * d->grid_per_y;
  Row u = within(out_u, nx - 1.0), v = within(out_v, ny - 1.0), z00, z01, z10, z11;
  const Cells i = cell_of(u, nx - 2), j = cell_of(v, ny - 2), corner = i * ny + j;
  for (int k = 0; k < 8; ++k) {
    const double *z = d->grid_z + corner[k];
    z00[k] = z[0];
    z01[k] = z[1];
    z10[k] = z[ny];
    z11[k] = z[ny + 1];
  }
  u -= __builtin_convertvector(i, Row);
  v -= __builtin_convertvector(j, Row);
  return (Below){
    (z00 * (1.0 - u) + z10 * u) * (1.0 - v) + (z01 * (1.0 - u) + z11 * u) * v,
    ((z10 - z00) * (1.0 - v) + (z11 - z01) * v) * rate_within(out_u, nx - 1.0, d->grid_per_x),
    ((z01 - z00) * (1.0 - u) + (z11 - z10) * u) * rate_within(out_v, ny - 1.0, d->grid_per_y),
    i * (ny - 1) + j,
  };
}

static inline void place_points(const Wheel *w, Cut *cut, int row) {
  const Row s = cut->s[row], t = cut->t[row];
  cut->x[row] = w->centre[0] + s * w->forward[0] + t * w->up[0];
  cut->y[row] = w->centre[1] + s * w->forward[1] + t * w->up[1];
  cut->z[row] = w->centre[2] + s * w->forward[2] + t * w->up[2];
}

/* Put points on the ground straight below or above them in the wheel's plane, by Newton's method along `up`. */
static void settle_on_grid(const Drive *d, const Wheel *w, Cut *cut, int row) {
  const int passes = fabs(w->up[0]) + fabs(w->up[1]) < UPRIGHT ? 1 : 3;
  double most = 1.0;
  place_points(w, cut, row);
  for (int pass = 0; pass < passes && most > SETTLED; ++pass) {
    const Below below = look_below(d, cut->x[row], cut->y[row]);
    const Row move = (below.height - cut->z[row]) / (w->up[2] - below.slope_x * w->up[0] - below.slope_y * w->up[1]);
    cut->t[row] += move;
    place_points(w, cut, row);
    if (passes == 1) return;
    most = 0.0;
    for (int k = 0; k < 8; ++k) most = larger(most, fabs(move[k]));
  }
}

/* The points from the second on. */
static inline Row next_of(const Row *at) {
  Row next;
  memcpy(&next, (const double *)at + 1, sizeof next);
  return next;
}

/* Normals and soils of the ground between neighbouring points. */
static void lie_on_grid(const Drive *d, const Wheel *w, const Cut *cut, Facet *facets) {
  const Row x = next_of(cut->x), y = next_of(cut->y), along_x = x - cut->x[0], along_y = y - cut->y[0];
  const Row along_z = next_of(cut->z) - cut->z[0];
  const Below below = look_below(d, 0.5 * (cut->x[0] + x), 0.5 * (cut->y[0] + y));
  const Row side_z = below.slope_x * w->axle[0] + below.slope_y * w->axle[1];
  const Row n_x = along_y * side_z - along_z * w->axle[1], n_y = along_z * w->axle[0] - along_x * side_z;
  const Row n_z = along_x * w->axle[1] - along_y * w->axle[0], square = n_x * n_x + n_y * n_y + n_z * n_z;
  Row length;
  for (int k = 0; k < N_CUT; ++k) length[k] = sqrt(square[k]);
  const Row scale = 1.0 / length, normal[3] = {n_x * scale, n_y * scale, n_z * scale};
  for (int k = 0; k < N_CUT; ++k)
    facets[k] = (Facet){.s = cut->s[0][k], .t = cut->t[0][k], .normal = {normal[0][k], normal[1][k], normal[2][k]},
                        .ground = d->grid_ground[below.cell[k]]};
}

static int same_plane(const Facet *a, const Facet *b) {
  double most = 0.0;
  for (int c = 0; c < 3; ++c) most = larger(most, fabs(a->normal[c] - b->normal[c]));
  return a->ground == b->ground && most <= STRAIGHT;
}

/* Facets along the cut; those of one plane, whose parts would add up to it, are one. */
static integer cut_grid(const Drive *d, const Wheel *w, double radius, Facet *facets) {
  Cut cut;
  integer n = 1;
  for (int k = 0; k < 8 * N_ROWS; ++k) cut.s[k / 8][k % 8] = 1.2 * radius * (2.0 * smaller(k, N_CUT) / N_CUT - 1.0);
  for (int row = 0; row < N_ROWS; ++row) {
    cut.t[row] = (Row){0} - radius;
    settle_on_grid(d, w, &cut, row);
  }
  lie_on_grid(d, w, &cut, facets);
  for (integer k = 1; k < N_CUT; ++k)
    if (!same_plane(facets + n - 1, facets + k)) facets[n++] = facets[k];
  facets[n].s = cut.s[1][0];
  facets[n].t = cut.t[1][0];
  return n;
}
