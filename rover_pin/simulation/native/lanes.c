/* Lanes as a wheel's plane cuts them: which it stands in, and their facets near it. */

#define REACH 1.05 /* facets further off than this share of the radius are not looked at */
#define LEAST_ACROSS 1e-3 /* of the axle across a lane */

/* What the width carries up to s of it, most in the middle, and the slope. */
static double carried(double s, double *slope) {
  s = smaller(larger(s, 0.0), 1.0);
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

/* The last of a lane's points at or behind x; the first where x lies behind all. */
static integer piece_at(const Drive *d, integer lane, double x) {
  const integer bins = d->bin_start[lane + 1] - d->bin_start[lane] - 1;
  const integer *bin = d->bin + d->bin_start[lane];
  const double *points = d->lane_x + d->lane_start[lane];
  double place = (x - d->bin_x0[lane]) * d->bin_per_metre[lane];
  integer at = place > 0.0 ? (place < bins - 1 ? (integer)place : bins - 1) : 0;
  integer low = bin[at], high = bin[at + 1] + 1;
  while (low > 0 && points[low] > x) --low; /* a bin's end, rounded */
  while (high - low > 1) {
    integer middle = (low + high) / 2;
    if (points[middle] <= x) low = middle; else high = middle;
  }
  return low;
}

/* Facets from behind to ahead of the wheel, in its own forward direction; a lane's corners are level lines. */
static integer cut_lane(const Drive *d, const Wheel *w, integer lane, double radius, Facet *facets) {
  const integer base = d->lane_start[lane], last_piece = d->lane_start[lane + 1] - base - 2;
  integer first = piece_at(d, lane, w->centre[0] - REACH * radius) - 1;
  integer last = piece_at(d, lane, w->centre[0] + REACH * radius) + 1;
  if (first < 0) first = 0;
  if (last > last_piece) last = last_piece;
  const double across = fabs(w->axle[1]) < LEAST_ACROSS ? copysign(LEAST_ACROSS, w->axle[1]) : w->axle[1];
  const double aside[2] = {-w->axle[0] / across, -w->axle[2] / across}; /* y of a corner, by x and by z from the centre */
  const double s_x = w->forward[0] + aside[0] * w->forward[1], s_z = w->forward[2] + aside[1] * w->forward[1];
  const double t_x = w->up[0] + aside[0] * w->up[1], t_z = w->up[2] + aside[1] * w->up[1];
  const integer n = last - first + 1, step = w->forward[0] < 0.0 ? -1 : 1, start = base + (step > 0 ? first : last + 1);
  for (integer k = 0; k <= n; ++k) {
    const integer point = start + step * k, piece = step > 0 ? point : point - 1;
    const double x = d->lane_x[point] - w->centre[0], z = d->lane_z[point] - w->centre[2];
    facets[k].s = s_x * x + s_z * z;
    facets[k].t = t_x * x + t_z * z;
    if (k == n) break;
    facets[k].normal[0] = d->lane_normal[2 * piece];
    facets[k].normal[1] = 0.0;
    facets[k].normal[2] = d->lane_normal[2 * piece + 1];
    facets[k].ground = d->lane_ground[piece];
  }
  return n;
}
