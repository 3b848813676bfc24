/* The terrain as a wheel's plane cuts it: facets, of lanes or of a grid. */

static void finish_facets(Facet *facets, integer n) {
  for (integer k = 0; k < n; ++k) {
    double ds = facets[k + 1].s - facets[k].s, dt = facets[k + 1].t - facets[k].t;
    double scale = 1.0 / sqrt(ds * ds + dt * dt);
    facets[k].n_s = -dt * scale;
    facets[k].n_t = ds * scale;
  }
}

/* What the width carries up to s of it, most in the middle, and the slope. */
static double carried(double s, double *slope) {
  s = fmin(fmax(s, 0.0), 1.0);
  *slope = 6.0 * s * (1.0 - s);
  return s * s * (3.0 - 2.0 * s);
}

/* What share of the wheel a lane carries, and its slope by y. */
static double lane_share(const Drive *d, const Wheel *w, integer lane, double radius, double width, double *slope) {
  double full = width * fabs(w->axle[1]) + radius * fabs(w->forward[1]), low = w->centre[1] - 0.5 * full;
  double right_slope = 0.0, left_slope = 0.0;
  double right = lane > 0 ? carried((d->lane_borders[lane - 1] - low) / full, &right_slope) : 0.0;
  double left = lane < d->n_lanes - 1 ? carried((d->lane_borders[lane] - low) / full, &left_slope) : 1.0;
  *slope = (right_slope - left_slope) / full;
  return left - right;
}

static integer cut_lane(const Drive *d, const Wheel *w, integer lane, double radius, Facet *facets) {
  const integer first = d->lane_start[lane], count = d->lane_start[lane + 1] - first;
  const double *x = d->lane_x + first, *z = d->lane_z + first;
  double reach = 1.05 * radius;
  integer low = 0, high = count - 1;
  while (high - low > 1) {
    integer middle = (low + high) / 2;
    if (x[middle] <= w->centre[0] - reach) low = middle; else high = middle;
  }
  integer start = low > 0 ? low - 1 : 0, n = 0;
  double across = fabs(w->axle[1]) < 1e-3 ? (w->axle[1] < 0 ? -1e-3 : 1e-3) : w->axle[1];
  int backwards = w->forward[0] < 0.0;
  for (integer k = start; k < count && n < MAX_FACETS; ++k) {
    double offset[3] = {x[k] - w->centre[0], 0.0, z[k] - w->centre[2]};
    offset[1] = -(w->axle[0] * offset[0] + w->axle[2] * offset[2]) / across;
    facets[n].s = dot(offset, w->forward);
    facets[n].t = dot(offset, w->up);
    integer piece = k < count - 1 ? k : count - 2;
    double dx = x[piece + 1] - x[piece], dz = z[piece + 1] - z[piece], scale = 1.0 / sqrt(dx * dx + dz * dz);
    facets[n].normal[0] = -dz * scale;
    facets[n].normal[1] = 0.0;
    facets[n].normal[2] = dx * scale;
    facets[n].ground = d->lane_ground[first + piece];
    ++n;
    if (k > start + 1 && x[k] > w->centre[0] + reach && x[k - 1] > w->centre[0] + reach) break;
  }
  if (backwards) { /* keep the points in order of the wheel's own forward direction */
    for (integer i = 0; i < n / 2; ++i) {
      Facet swap = facets[i];
      facets[i] = facets[n - 1 - i];
      facets[n - 1 - i] = swap;
    }
    for (integer i = 0; i < n - 1; ++i) {
      memcpy(facets[i].normal, facets[i + 1].normal, sizeof facets[i].normal);
      facets[i].ground = facets[i + 1].ground;
    }
  }
  finish_facets(facets, n - 1);
  return n - 1;
}

static double grid_height(const Drive *d, double x, double y, double *slope_x, double *slope_y, integer *ground) {
  double u = (x - d->grid_x0) / d->grid_dx, v = (y - d->grid_y0) / d->grid_dy;
  int level_x = u < 0.0 || u > d->grid_nx - 1.0, level_y = v < 0.0 || v > d->grid_ny - 1.0; /* beyond the grid */
  u = fmin(fmax(u, 0.0), d->grid_nx - 1.0);
  v = fmin(fmax(v, 0.0), d->grid_ny - 1.0);
  integer i = (integer)u, j = (integer)v;
  if (i > d->grid_nx - 2) i = d->grid_nx - 2;
  if (j > d->grid_ny - 2) j = d->grid_ny - 2;
  u -= i;
  v -= j;
  const double *z = d->grid_z + i * d->grid_ny + j;
  double z00 = z[0], z01 = z[1], z10 = z[d->grid_ny], z11 = z[d->grid_ny + 1];
  *slope_x = level_x ? 0.0 : ((z10 - z00) * (1 - v) + (z11 - z01) * v) / d->grid_dx;
  *slope_y = level_y ? 0.0 : ((z01 - z00) * (1 - u) + (z11 - z10) * u) / d->grid_dy;
  *ground = d->grid_ground[i * (d->grid_ny - 1) + j];
  return (z00 * (1 - u) + z10 * u) * (1 - v) + (z01 * (1 - u) + z11 * u) * v;
}

static integer cut_grid(const Drive *d, const Wheel *w, double radius, Facet *facets) {
  const integer n = 8;
  double point[9][3], slope_x, slope_y;
  for (integer k = 0; k <= n; ++k) {
    double s = 1.2 * radius * (2.0 * k / n - 1.0), t = -radius;
    integer ground;
    for (int pass = 0; pass < 3; ++pass) {
      for (int c = 0; c < 3; ++c) point[k][c] = w->centre[c] + s * w->forward[c] + t * w->up[c];
      double z = grid_height(d, point[k][0], point[k][1], &slope_x, &slope_y, &ground);
      double lean = w->up[2] - slope_x * w->up[0] - slope_y * w->up[1];
      t += (z - point[k][2]) / lean;
    }
    facets[k].s = s;
    facets[k].t = t;
    for (int c = 0; c < 3; ++c) point[k][c] = w->centre[c] + s * w->forward[c] + t * w->up[c];
  }
  for (integer k = 0; k < n; ++k) {
    double along[3], sideways[3] = {w->axle[0], w->axle[1], 0.0};
    for (int c = 0; c < 3; ++c) along[c] = point[k + 1][c] - point[k][c];
    grid_height(d, 0.5 * (point[k][0] + point[k + 1][0]), 0.5 * (point[k][1] + point[k + 1][1]), &slope_x, &slope_y,
                &facets[k].ground);
    sideways[2] = slope_x * sideways[0] + slope_y * sideways[1];
    cross(along, sideways, facets[k].normal);
    unit(facets[k].normal);
  }
  finish_facets(facets, n);
  return n;
}
