/* The ground near a wheel as facets: straight pieces in the wheel's plane. Terrain is either lanes (strips along x,
   each with a profile z(x); flat ground is one lane) or a height grid. */

/* facets whose x is further from the wheel's centre than this times the radius are left out; drive_fields.py
   makes room accordingly */
#define REACH 1.05
/* smallest y component of the axle that is divided by: beyond, the axle points along the lane */
#define LEAST_ACROSS 1e-3

/* Share of the load that the part [0, s] of the wheel's width carries, s in [0, 1], and its derivative. The load
   density 6 s (1 - s) vanishes at both edges, so that a wheel that crosses a border feels no jump. */
static double load_share_up_to(double s, double *slope) {
  s = smaller(larger(s, 0.0), 1.0);
  *slope = 6.0 * s * (1.0 - s);
  return s * s * (3.0 - 2.0 * s);
}

/* Share of a wheel's load that a lane carries, and its slope with the y of the wheel. The wheel covers `full` in y:
   its width and, when it is steered, part of its diameter. */
static double lane_share(const Drive *d, const Wheel *w, integer lane, double radius, double width, double *slope) {
  double full = width * fabs(w->axle[1]) + radius * fabs(w->forward[1]), low = w->centre[1] - 0.5 * full;
  double right_slope = 0.0, left_slope = 0.0;
  double right = lane > 0 ? load_share_up_to((d->lane_borders[lane - 1] - low) / full, &right_slope) : 0.0;
  double left = lane < d->n_lanes - 1 ? load_share_up_to((d->lane_borders[lane] - low) / full, &left_slope) : 1.0;
  *slope = (right_slope - left_slope) / full;
  return left - right;
}

/* Index of the last point of a lane with a coordinate of at most x; 0 where all points lie ahead. A bin narrows the
   search, which then halves the interval. */
static integer piece_at(const Drive *d, integer lane, double x) {
  const integer bins = d->bin_start[lane + 1] - d->bin_start[lane] - 1;
  const integer *bin = d->bin + d->bin_start[lane];
  const double *points = d->lane_x + d->lane_start[lane];
  /* The bin that holds x, then the points between this bin's beginning and the next one's. */
  double place = (x - d->bin_x0[lane]) * d->bin_per_metre[lane];
  integer at = place > 0.0 ? (place < bins - 1 ? (integer)place : bins - 1) : 0;
  integer low = bin[at], high = bin[at + 1] + 1;
  while (low > 0 && points[low] > x) --low; /* round-off put x into the bin ahead */
  while (high - low > 1) {
    integer middle = (low + high) / 2;
    if (points[middle] <= x) low = middle; else high = middle;
  }
  return low;
}

/* Write the facets of a lane from behind to ahead of the wheel, in the wheel's forward direction, and return their
   number. A corner of the profile is a level line along y; it is where that line meets the wheel's plane. */
static integer cut_lane(const Drive *d, const Wheel *w, integer lane, double radius, Facet *facets) {
  const integer base = d->lane_start[lane], last_piece = d->lane_start[lane + 1] - base - 2;
  integer first = piece_at(d, lane, w->centre[0] - REACH * radius) - 1;
  integer last = piece_at(d, lane, w->centre[0] + REACH * radius) + 1;
  if (first < 0) first = 0;
  if (last > last_piece) last = last_piece;
  const double across = fabs(w->axle[1]) < LEAST_ACROSS ? copysign(LEAST_ACROSS, w->axle[1]) : w->axle[1];
  /* y of a corner per x and per z from the wheel's centre, within the wheel's plane */
  const double aside[2] = {-w->axle[0] / across, -w->axle[2] / across};
  const double s_x = w->forward[0] + aside[0] * w->forward[1], s_z = w->forward[2] + aside[1] * w->forward[1];
  const double t_x = w->up[0] + aside[0] * w->up[1], t_z = w->up[2] + aside[1] * w->up[1];
  /* A wheel that points backwards sees the points in reverse order. */
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

/* A height grid. The wheel's plane cuts it in a line of N_CUT facets; eight points are worked out at once. */

/* facets of equal length along the wheel's plane; their 9 end points take two vectors of 8. GRID_FACETS of
   drive_fields.py */
#define N_CUT 8
#define N_ROWS 2
#define SETTLED 1e-14 /* [m] largest move after which a point counts as on the ground */
/* horizontal part of `up` below which a point keeps its x and y when it moves along `up`, so that one move is exact */
#define UPRIGHT 1e-13
#define STRAIGHT 1e-11 /* difference between unit normals up to which neighbouring facets are merged */

typedef int64_t Cells __attribute__((vector_size(64)));

typedef struct { /* points of the cut, in the wheel's plane (s, t) and in the world */
  Row s[N_ROWS], t[N_ROWS], x[N_ROWS], y[N_ROWS], z[N_ROWS];
} Cut;

/* The grid at eight points: height [m], slopes with x and y, and the index of the cell. */
typedef struct { Row height, slope_x, slope_y; Cells cell; } Below;

/* Choose a where the mask m is set, else b. */
static inline Row row_where(Cells m, Row a, Row b) { return (Row)((m & (Cells)a) | (~m & (Cells)b)); }
/* Clip to [0, most]; NaN becomes 0. */
static inline Row within(Row x, double largest) {
  x = row_where(x > 0.0, x, (Row){0}); /* NaN compares false, so it becomes 0 */
  return row_where(x > largest, (Row){0} + largest, x);
}

/* Index of the cell that holds a grid coordinate u, `last` at most. */
static inline Cells cell_of(Row u, integer last) {
  const Cells at = __builtin_convertvector(u, Cells), beyond = at > last;
  return (beyond & last) | (~beyond & at);
}

/* `rate` inside the grid, 0 beyond its ends, where the height is constant. */
static inline Row rate_within(Row u, double largest, double rate) {
  return row_where((u < 0.0) | (u > largest), (Row){0}, (Row){0} + rate);
}

/* Height and slopes of the grid at points x, y: bilinear within a cell; beyond the ends the height of the end, with
   slope 0. */
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

/* Points of the cut from the wheel's plane to the world. */
static inline void place_points(const Wheel *w, Cut *cut, int row) {
  const Row s = cut->s[row], t = cut->t[row];
  cut->x[row] = w->centre[0] + s * w->forward[0] + t * w->up[0];
  cut->y[row] = w->centre[1] + s * w->forward[1] + t * w->up[1];
  cut->z[row] = w->centre[2] + s * w->forward[2] + t * w->up[2];
}

/* Move points along `up` of the wheel until they lie on the ground, by Newton's method. */
static void settle_on_grid(const Drive *d, const Wheel *w, Cut *cut, int row) {
  /* In an upright wheel a point moves straight up or down, and one pass is exact. */
  const int passes = fabs(w->up[0]) + fabs(w->up[1]) < UPRIGHT ? 1 : 3;
  double largest = 1.0;
  place_points(w, cut, row);
  for (int pass = 0; pass < passes && largest > SETTLED; ++pass) {
    const Below below = look_below(d, cut->x[row], cut->y[row]);
    const Row move = (below.height - cut->z[row]) / (w->up[2] - below.slope_x * w->up[0] - below.slope_y * w->up[1]);
    cut->t[row] += move;
    place_points(w, cut, row);
    if (passes == 1) return;
    largest = 0.0;
    for (int k = 0; k < 8; ++k) largest = larger(largest, fabs(move[k]));
  }
}

/* The points, each shifted to its successor. */
static inline Row next_of(const Row *at) {
  Row next;
  memcpy(&next, (const double *)at + 1, sizeof next);
  return next;
}

/* Write the facets between neighbouring points. A facet's normal is across two tangents of the ground: the line
   between its points, and the ground's slope along the axle at the middle. */
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

/* Whether two facets lie in one plane and on one soil. */
static int same_plane(const Facet *a, const Facet *b) {
  double largest = 0.0;
  for (int c = 0; c < 3; ++c) largest = larger(largest, fabs(a->normal[c] - b->normal[c]));
  return a->ground == b->ground && largest <= STRAIGHT;
}

/* Write the facets of a grid under a wheel, from 1.2 radii behind to 1.2 radii ahead, and return their number.
   Neighbours in one plane are merged, because their parts would add up to that plane anyway. */
static integer cut_grid(const Drive *d, const Wheel *w, double radius, Facet *facets) {
  Cut cut;
  integer n = 1;
  /* Points at equal distances along the wheel's plane, first at the height of the wheel's lowest point. */
  for (int k = 0; k < 8 * N_ROWS; ++k) cut.s[k / 8][k % 8] = 1.2 * radius * (2.0 * smaller(k, N_CUT) / N_CUT - 1.0);
  for (int row = 0; row < N_ROWS; ++row) {
    cut.t[row] = (Row){0} - radius;
    settle_on_grid(d, w, &cut, row);
  }
  lie_on_grid(d, w, &cut, facets);
  /* Keep the first facet of each plane; the last point ends the last facet. */
  for (integer k = 1; k < N_CUT; ++k)
    if (!same_plane(facets + n - 1, facets + k)) facets[n++] = facets[k];
  facets[n].s = cut.s[1][0];
  facets[n].t = cut.t[1][0];
  return n;
}
