/* A height grid as a wheel's plane cuts it. */

#define N_CUT 8 /* facets of equal length along the wheel's plane */
#define SETTLED 1e-14 /* m */
#define STRAIGHT 1e-11 /* difference of unit normals up to which neighbours are one facet */

static double grid_height(const Drive *d, double x, double y, double *slope_x, double *slope_y, integer *ground) {
  double u = (x - d->grid_x0) * d->grid_per_x, v = (y - d->grid_y0) * d->grid_per_y;
  int level_x = u < 0.0 || u > d->grid_nx - 1.0, level_y = v < 0.0 || v > d->grid_ny - 1.0; /* beyond the grid */
  u = smaller(larger(u, 0.0), d->grid_nx - 1.0);
  v = smaller(larger(v, 0.0), d->grid_ny - 1.0);
  integer i = (integer)u, j = (integer)v;
  if (i > d->grid_nx - 2) i = d->grid_nx - 2;
  if (j > d->grid_ny - 2) j = d->grid_ny - 2;
  u -= i;
  v -= j;
  const double *z = d->grid_z + i * d->grid_ny + j;
  double z00 = z[0], z01 = z[1], z10 = z[d->grid_ny], z11 = z[d->grid_ny + 1];
  *slope_x = level_x ? 0.0 : ((z10 - z00) * (1 - v) + (z11 - z01) * v) * d->grid_per_x;
  *slope_y = level_y ? 0.0 : ((z01 - z00) * (1 - u) + (z11 - z10) * u) * d->grid_per_y;
  *ground = d->grid_ground[i * (d->grid_ny - 1) + j];
  return (z00 * (1 - u) + z10 * u) * (1 - v) + (z01 * (1 - u) + z11 * u) * v;
}

/* The height of the grid straight below or above a point of the wheel's plane, by Newton's method along `up`. */
static double settle_on_grid(const Drive *d, const Wheel *w, double s, double t, double point[3]) {
  double slope_x, slope_y, move = 1.0;
  integer ground;
  for (int pass = 0; pass < 3 && fabs(move) > SETTLED; ++pass) {
    for (int c = 0; c < 3; ++c) point[c] = w->centre[c] + s * w->forward[c] + t * w->up[c];
    double z = grid_height(d, point[0], point[1], &slope_x, &slope_y, &ground);
    move = (z - point[2]) / (w->up[2] - slope_x * w->up[0] - slope_y * w->up[1]);
    t += move;
  }
  for (int c = 0; c < 3; ++c) point[c] = w->centre[c] + s * w->forward[c] + t * w->up[c];
  return t;
}

/* Normal and soil of the ground between two points of the cut. */
static void lie_on_grid(const Drive *d, const Wheel *w, const double from[3], const double to[3], Facet *facet) {
  double slope_x, slope_y, along[3], sideways[3] = {w->axle[0], w->axle[1], 0.0};
  for (int c = 0; c < 3; ++c) along[c] = to[c] - from[c];
  grid_height(d, 0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1]), &slope_x, &slope_y, &facet->ground);
  sideways[2] = slope_x * sideways[0] + slope_y * sideways[1];
  cross(along, sideways, facet->normal);
  unit(facet->normal);
}

static int same_plane(const Facet *a, const Facet *b) {
  double most = 0.0;
  for (int c = 0; c < 3; ++c) most = larger(most, fabs(a->normal[c] - b->normal[c]));
  return a->ground == b->ground && most <= STRAIGHT;
}

/* Facets along the cut; those of one plane, whose parts would add up to it, are one. */
static integer cut_grid(const Drive *d, const Wheel *w, double radius, Facet *facets) {
  double point[N_CUT + 1][3];
  integer n = 0;
  Facet next = {.t = -radius};
  for (integer k = 0; k <= N_CUT; ++k) {
    next.s = 1.2 * radius * (2.0 * k / N_CUT - 1.0);
    next.t = settle_on_grid(d, w, next.s, -radius, point[k]);
    facets[k] = next;
  }
  for (integer k = 0; k < N_CUT; ++k) {
    next = facets[k];
    lie_on_grid(d, w, point[k], point[k + 1], &next);
    if (n == 0 || !same_plane(&facets[n - 1], &next)) facets[n++] = next;
  }
  facets[n] = facets[N_CUT];
  return n;
}
