/* One step of the drive: wheel-terrain patches, their loads, and a linearly implicit solve of Eq (8).
   Pinocchio has filled M, nle, J and the wheel centres half a step on; the laws are functions generated from the effects.
   Twin of plain.py, which is slower, explains the scheme, and is the reference. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define MAX_DOF 48
#define MAX_COLS 20
#define MAX_FACETS 64
#define MAX_STATES 8
#define MAX_OUT 192
#define N_SOIL 9
#define SOIL_N 5 /* place of the exponent n in a soil's constants */
#define N_GEOMETRY 7
#define N_WHEEL 2
#define N_RECORD 12
#define PI 3.14159265358979323846
#define UNDECIDED_SHARE 100.0 /* direction speed over the speed below which both speeds decide alike */
#define DEEPEST 0.98 /* sinkage over radius at which the law is held; drives stop long before */

typedef int64_t integer;
typedef int (*casadi_function)(const double **, double **, integer *, double *, int);

typedef struct { /* field order is mirrored in kernel.py */
  integer nv, n_wheels, n_cols, n_axles, n_contact_states, n_motor_states, n_joints, n_servos, n_stops, n_body, n_lanes, grid_nx, grid_ny;
  integer n_soils, n_kinds, n_held;
  integer differential_left, n_coupled, symmetric, settling;
  double dt, direction_speed, grid_x0, grid_y0, grid_dx, grid_dy, wheel_share, misjudged;
  double *M, *nle, *J, *q, *v, *du;
  double **centres;
  integer *cols, *col_count, *wheel_dof, *axle;
  double *radius;
  integer *kind; /* wheels of one kind have the same sizes */
  double *kinds; /* radius and width of each kind */
  integer *joint_dof, *joint_q, *joint_unbounded;
  integer *servo_dof, *servo_q;
  double *servo_target, *servo_gain; /* gain: stiffness, damping */
  integer *stop_dof, *stop_q;
  double *stop_limits, *stop_gain; /* limits: lower, upper per stop */
  integer *body_dof, *body_q; /* base (6), then the suspension's joints; body_q: those joints alone */
  integer *coupled_dof; /* follower, leader of each coupling; a rigid differential is the last one, of ratio -1 */
  double *coupled_ratio;
  integer *mirror_index;
  double *mirror_sign;
  double *contact_states, *motor_states;
  double *contact_odd;
  double *contact_parameters, *motor_parameters, *body_parameters, *soils;
  double *held; /* what the contact law holds for each kind of wheel on each soil: n_kinds x n_soils x n_held */
  double *duty;
  double *lane_borders;
  integer *lane_start;
  double *lane_x, *lane_z;
  integer *lane_ground;
  double *grid_z;
  integer *grid_ground;
  double *foreseen; /* 4 a wheel: its load as the last step expected it */
  double *record, *energy, *loads, *impulse, *differential; /* record: n_wheels x N_RECORD; energy: 6; impulse: of the soil's forces; differential: its torque */
  casadi_function contact_before, contact_law, motor_law, body_law;
  integer *work_i;
  double *work_w;
} Drive;

enum { ENERGY_MOTOR, ENERGY_SOIL, ENERGY_STOPS, ENERGY_SERVOS, ENERGY_ELECTRIC, ENERGY_BODY };
enum { OK, NOT_FINITE, SINGULAR };
enum { DRIVING, IN_HAND, ON_THE_SOIL }; /* settling: in hand the soil is not sheared, whatever the speeds */

typedef struct {
  double s, t;       /* start point in the wheel plane, from the centre */
  double n_s, n_t;   /* in-plane unit normal */
  double normal[3];  /* normal in the world */
  integer ground;
} Facet;

typedef struct {
  double sinkage, depth, share, tilt, turn; /* sinkage of the facet's plane; greatest depth within the patch */
  double side; /* push of a lane's edge along y, per normal force */
  const Facet *facet;
} Patch;

typedef struct {
  double centre[3], axle[3], forward[3], up[3], velocity[3], spin;
  double lin[MAX_COLS][3], ang[MAX_COLS][3];
  const integer *cols;
  integer n;
} Wheel;

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double *a, const double *b, double *out) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

static void unit(double *a) {
  double scale = 1.0 / sqrt(dot(a, a));
  for (int i = 0; i < 3; ++i) a[i] *= scale;
}

static void look_at_wheel(const Drive *d, integer w, Wheel *wheel) {
  const double *p = d->centres[w];
  memcpy(wheel->centre, p, sizeof wheel->centre);
  memcpy(wheel->axle, d->J + 6 * d->wheel_dof[w] + 3, sizeof wheel->axle);
  const double vertical[3] = {0.0, 0.0, 1.0};
  for (int i = 0; i < 3; ++i) wheel->up[i] = vertical[i] - wheel->axle[2] * wheel->axle[i];
  unit(wheel->up);
  cross(wheel->axle, wheel->up, wheel->forward);
  wheel->cols = d->cols + w * d->n_cols;
  wheel->n = d->col_count[w];
  double rate[3] = {0.0, 0.0, 0.0};
  memset(wheel->velocity, 0, sizeof wheel->velocity);
  for (integer i = 0; i < wheel->n; ++i) {
    const double *column = d->J + 6 * wheel->cols[i];
    cross(column + 3, p, wheel->lin[i]);
    for (int c = 0; c < 3; ++c) {
      wheel->lin[i][c] += column[c];
      wheel->ang[i][c] = column[3 + c];
      wheel->velocity[c] += wheel->lin[i][c] * d->v[wheel->cols[i]];
      rate[c] += column[3 + c] * d->v[wheel->cols[i]];
    }
  }
  wheel->spin = dot(rate, wheel->axle);
}

/* ---- the terrain as the wheel's plane cuts it ---- */

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

/* Clip [*low, *high] to where a + r sin(theta - delta / 2) has the sign `side` (+1: at least 0, -1: at most 0). */
static int clip_at_bisector(double a, double r, double delta, double side, double *low, double *high) {
  if (side * a >= r) return 1;
  if (side * a <= -r) return 0;
  double edge = asin(-a / r), turn = side > 0 ? PI : -PI;
  double from = fmin(edge, turn - edge) + 0.5 * delta, to = fmax(edge, turn - edge) + 0.5 * delta;
  *low = fmax(*low, from);
  *high = fmin(*high, to);
  return *low < *high;
}

#define N_GAUSS 10
static const double GAUSS_NODE[N_GAUSS] = {
    0.013046735741414128, 0.067468316655507732, 0.16029521585048778, 0.28330230293537639, 0.42556283050918442,
    0.57443716949081558, 0.71669769706462361, 0.83970478414951222, 0.93253168334449232, 0.98695326425858587};
static const double GAUSS_WEIGHT[N_GAUSS] = {
    0.033335672154344069, 0.074725674575290293, 0.10954318125799102, 0.13463335965499817, 0.14776211235737644,
    0.14776211235737644, 0.13463335965499817, 0.10954318125799102, 0.074725674575290293, 0.033335672154344069};

/* int_theta^theta_0 (cos t - cos theta_0)^n {cos t, 1} dt, nodes graded by u^2 towards the singular end theta_0. */
static void depth_integrals(double theta, double theta_0, double n, double out[2]) {
  double length = theta_0 - theta, cosine = cos(theta_0), sine = sin(theta_0);
  out[0] = out[1] = 0.0;
  if (length <= 0.0) return;
  for (int i = 0; i < N_GAUSS; ++i) {
    double u = GAUSS_NODE[i], half = 0.5 * length * u * u, c = cos(half), s = sin(half);
    double depth = 2.0 * (sine * c - cosine * s) * s; /* cos(theta_0 - 2 half) - cos(theta_0), without the loss */
    double part = GAUSS_WEIGHT[i] * 2.0 * length * u * (n == 1.0 ? depth : pow(depth, n));
    out[0] += part * (cosine + depth);
    out[1] += part;
  }
}

/* The same from any theta >= -theta_0, given the integrals from 0: the integrand is even. */
static void integrals_from(double theta, double theta_0, double n, const double half[2], double out[2]) {
  depth_integrals(fabs(theta), theta_0, n, out);
  if (theta < 0.0) for (int i = 0; i < 2; ++i) out[i] = 2.0 * half[i] - out[i];
}

/* The part of facet k's contact arc that belongs to it: theta from its normal, between the bisectors to its neighbours.
   Parts of one plane share the plane's sinkage, and their shares add up to 1. */
static int find_patch(const Facet *facets, integer n, integer k, double radius, double n_soil, Patch *patch) {
  const Facet *f = facets + k;
  double distance = -(f->s * f->n_s + f->t * f->n_t);
  double h = radius - distance;
  if (h <= 0.0) return 0;
  if (h > 1.999 * radius) h = 1.999 * radius;
  double theta = acos(1.0 - h / radius), low = -theta, high = theta;
  if (fmax(f[1].s, f->s) < -radius || fmin(f[1].s, f->s) > radius) return 0;
  for (int side = -1; side <= 1; side += 2) {
    integer other = k - side; /* side +1: the lower bound, set by the facet behind */
    if (other < 0 || other >= n) continue;
    const Facet *g = facets + other, *corner = side > 0 ? f : f + 1;
    double m_s = f->n_s + g->n_s, m_t = f->n_t + g->n_t, scale = 1.0 / sqrt(m_s * m_s + m_t * m_t);
    double ahead_s = m_t * scale, ahead_t = -m_s * scale; /* across the bisector, forwards */
    double a = -(corner->s * ahead_s + corner->t * ahead_t);
    double tilt = asin(fmin(1.0, fmax(-1.0, f->n_s * ahead_s + f->n_t * ahead_t)));
    if (!clip_at_bisector(a, radius, 2.0 * tilt, side, &low, &high)) return 0;
  }
  double cosine = cos(theta), deepest = cos(fmin(fmax(0.0, low), high)) - cosine;
  patch->facet = f;
  patch->sinkage = fmin(h, DEEPEST * radius);
  patch->depth = radius * deepest;
  patch->share = patch->turn = 1.0;
  patch->tilt = patch->side = 0.0;
  if (low > -theta || high < theta) {
    if (deepest <= 1e-12) return 0;
    double own[2], whole[2], upper[2], lower[2];
    depth_integrals(0.0, theta, n_soil, own);
    memcpy(whole, own, sizeof whole);
    if (patch->sinkage < h) depth_integrals(0.0, acos(1.0 - patch->sinkage / radius), n_soil, whole);
    integrals_from(low, theta, n_soil, own, lower);
    integrals_from(high, theta, n_soil, own, upper);
    patch->share = 0.5 * (lower[0] - upper[0]) / whole[0];
    patch->turn = 0.5 * (lower[1] - upper[1]) / whole[1];
    double from = fmax(cos(low) - cosine, 0.0), to = fmax(cos(high) - cosine, 0.0);
    patch->tilt = 0.5 * (pow(from, n_soil + 1.0) - pow(to, n_soil + 1.0)) / ((n_soil + 1.0) * whole[0]);
  }
  return 1;
}

/* ---- the laws ---- */

typedef struct {
  double load[4];                           /* f_t f_y f_n torque */
  double by_speed[4][4];                    /* d load / d (v_x v_y v_n rim) */
  double rate[MAX_STATES], rate_by_speed[MAX_STATES][4];
  double load_by_state[4][MAX_STATES], rate_by_state[MAX_STATES][MAX_STATES];
  double slip[2];
} Law;

static void mirror_law(Law *law, integer nx, const double *odd) {
  const double sign[4] = {-1, -1, 1, -1};
  for (int i = 0; i < 4; ++i) {
    law->load[i] *= sign[i];
    for (int j = 0; j < 4; ++j) law->by_speed[i][j] *= sign[i] * sign[j];
    for (integer j = 0; j < nx; ++j) law->load_by_state[i][j] *= sign[i] * odd[j];
  }
  for (integer i = 0; i < nx; ++i) {
    law->rate[i] *= odd[i];
    for (int j = 0; j < 4; ++j) law->rate_by_speed[i][j] *= odd[i] * sign[j];
    for (integer j = 0; j < nx; ++j) law->rate_by_state[i][j] *= odd[i] * odd[j];
  }
  law->slip[0] *= -1;
  law->slip[1] *= -1;
}

static void evaluate_law(const Drive *d, const double *contact, const double *held, const double *states, int mirrored, Law *law) {
  integer nx = d->n_contact_states;
  double own_contact[N_GEOMETRY], own_states[MAX_STATES], out[MAX_OUT];
  memcpy(own_contact, contact, sizeof own_contact);
  for (integer i = 0; i < nx; ++i) own_states[i] = states[i] * (mirrored ? d->contact_odd[i] : 1.0);
  if (mirrored) {
    own_contact[1] = -contact[1];
    own_contact[2] = -contact[2];
    own_contact[4] = -contact[4];
    own_contact[6] = d->n_axles - 1 - contact[6];
  }
  const double *arguments[3] = {own_contact, own_states, held};
  double *results[1] = {out};
  d->contact_law(arguments, results, d->work_i, d->work_w, 0);
  const double *next = out; /* column-major blocks, in the order laws.py writes them */
  for (int i = 0; i < 4; ++i) law->load[i] = *next++;
  for (int j = 0; j < 4; ++j) for (int i = 0; i < 4; ++i) law->by_speed[i][j] = *next++;
  for (integer i = 0; i < nx; ++i) law->rate[i] = *next++;
  for (int j = 0; j < 4; ++j) for (integer i = 0; i < nx; ++i) law->rate_by_speed[i][j] = *next++;
  for (integer j = 0; j < nx; ++j) for (int i = 0; i < 4; ++i) law->load_by_state[i][j] = *next++;
  for (integer j = 0; j < nx; ++j) for (integer i = 0; i < nx; ++i) law->rate_by_state[i][j] = *next++;
  law->slip[0] = *next++;
  law->slip[1] = *next++;
  if (mirrored) mirror_law(law, nx, d->contact_odd);
}

static void blend(double *a, const double *b, double share, size_t n) {
  for (size_t i = 0; i < n; ++i) a[i] = share * a[i] + (1.0 - share) * b[i];
}

/* Which way a wheel goes, -1 to 1 over `direction_speed`, and its slopes with v_x and rim: the faster of both decides. */
static double direction(const Drive *d, double v, double rim, double slope[2]) {
  const double least = d->direction_speed / UNDECIDED_SHARE, both = least / sqrt(2.0);
  const double top = v * fabs(v) + rim * fabs(rim) + both * (v + rim), bottom_2 = v * v + rim * rim + least * least;
  const double scale = 1.0 / (sqrt(2.0 * bottom_2) * d->direction_speed);
  slope[0] = (2.0 * fabs(v) + both - top * v / bottom_2) * scale;
  slope[1] = (2.0 * fabs(rim) + both - top * rim / bottom_2) * scale;
  return top * scale;
}

/* The law in the direction of travel; within the speed `direction_speed` around rest, a blend of both directions.
   Its slopes hold the blend's own: near rest they are the stiffest part of a resistance that turns with the wheel. */
static void travel_law(const Drive *d, const double *contact, const double *held, const double *states, Law *law) {
  double slope[2], z = fmin(1.0, fmax(-1.0, direction(d, contact[1], contact[4], slope)));
  double forwards = 0.5 + 0.25 * z * (3.0 - z * z);
  evaluate_law(d, contact, held, states, forwards <= 0.0, law);
  if (forwards <= 0.0 || forwards >= 1.0) return;
  Law back;
  evaluate_law(d, contact, held, states, 1, &back);
  double steep = 0.75 * (1.0 - z * z), load[4], rate[MAX_STATES];
  for (int i = 0; i < 4; ++i) load[i] = steep * (law->load[i] - back.load[i]);
  for (integer i = 0; i < d->n_contact_states; ++i) rate[i] = steep * (law->rate[i] - back.rate[i]);
  blend((double *)law, (const double *)&back, forwards, sizeof(Law) / sizeof(double));
  for (int j = 0; j < 2; ++j) { /* v_x and rim */
    for (int i = 0; i < 4; ++i) law->by_speed[i][3 * j] += load[i] * slope[j];
    for (integer i = 0; i < d->n_contact_states; ++i) law->rate_by_speed[i][3 * j] += rate[i] * slope[j];
  }
}

/* Weight of the step's end in what is taken implicitly: the midpoint rule drives, implicit Euler sets down. */
static double implicit_share(const Drive *d) { return d->settling ? 1.0 : 0.5; }

/* While a rover is set down, the normal spring is implicit too: how the load rises with depth over half a step. In hand
   nothing else changes with the speeds. */
static void add_stiffness(const Drive *d, const double *contact, const double *held, const double *states, Law *law, double *stiffness) {
  double deeper[N_GEOMETRY], push = 1e-6 * contact[0];
  Law pushed;
  memcpy(deeper, contact, sizeof deeper);
  deeper[0] += push;
  travel_law(d, deeper, held, states, &pushed);
  for (int i = 0; i < 4; ++i) stiffness[i] = 0.5 * d->dt * (pushed.load[i] - law->load[i]) / push;
  if (d->settling == IN_HAND) {
    memset(law->by_speed, 0, sizeof law->by_speed);
    memset(law->load_by_state, 0, sizeof law->load_by_state);
  }
}

/* A rover that is set down is not moved by its own slide along the ground: the base's x, y and yaw. */
static int slides(integer dof) { return dof == 0 || dof == 1 || dof == 5; }

/* Solve (I - half A) X = B for X (n x m, rows of stride `stride`), n <= MAX_STATES. */
static void implicit_states(double half, integer n, double a[][MAX_STATES], double *b, integer m, integer stride) {
  double lhs[MAX_STATES][MAX_STATES];
  for (integer i = 0; i < n; ++i)
    for (integer j = 0; j < n; ++j) lhs[i][j] = (i == j) - half * a[i][j];
  for (integer p = 0; p < n; ++p)
    for (integer i = p + 1; i < n; ++i) {
      double factor = lhs[i][p] / lhs[p][p];
      for (integer j = p; j < n; ++j) lhs[i][j] -= factor * lhs[p][j];
      for (integer j = 0; j < m; ++j) b[i * stride + j] -= factor * b[p * stride + j];
    }
  for (integer p = n - 1; p >= 0; --p)
    for (integer j = 0; j < m; ++j) {
      for (integer i = p + 1; i < n; ++i) b[p * stride + j] -= lhs[p][i] * b[i * stride + j];
      b[p * stride + j] /= lhs[p][p];
    }
}

/* ---- assembly ---- */

typedef struct {
  double A[MAX_DOF][MAX_DOF], soil_D[MAX_DOF][MAX_DOF], soil_Q[MAX_DOF];
  double motor_torque[MAX_DOF], motor_slope[MAX_DOF];
  double other_Q[MAX_DOF], other_slope[MAX_DOF];
} System;

typedef struct { /* what acts on the n degrees of freedom body_dof: force Q + D du (D by columns), and T of the differential */
  double Q[MAX_DOF], D[MAX_DOF * MAX_DOF], torque, torque_slope[MAX_DOF];
} BodyPush;

typedef struct { /* what a wheel's states need once the new speeds are known, and its load: now, and expected at the step's end */
  double weight, gain[MAX_STATES], by_col[MAX_STATES][MAX_COLS];
  double load[4], end[4], end_by_velocity[4][3], end_by_spin[4];
} WheelUpdate;

static void add_patch(const Drive *d, const Wheel *w, integer index, const Patch *patch, System *system, WheelUpdate *update) {
  const double *N = patch->facet->normal;
  const integer nx = d->n_contact_states, n = w->n;
  double r = d->radius[index], t[3], l[3], arm[3];
  cross(w->axle, N, t);
  unit(t);
  cross(N, t, l);
  double contact[N_GEOMETRY] = {patch->sinkage, dot(w->velocity, t), dot(w->velocity, l), -dot(w->velocity, N),
                                r * w->spin, w->centre[0], (double)d->axle[index]};
  const double *held = d->held + d->n_held * (d->kind[index] * d->n_soils + patch->facet->ground);
  Law law;
  double *states = d->contact_states + index * nx;
  travel_law(d, contact, held, states, &law);
  double stiffness[4] = {0.0, 0.0, 0.0, 0.0};
  if (d->settling) add_stiffness(d, contact, held, states, &law, stiffness);

  double begun[4];
  memcpy(begun, law.load, sizeof begun);

  /* the states' step dx = (I - dt/2 r_x)^-1 dt (r + r_v dv/2); half of it acts on the load of the implicit solve */
  const double share_of_end = implicit_share(d);
  double step[MAX_STATES][5];
  if (nx) {
    for (integer i = 0; i < nx; ++i) {
      step[i][0] = d->dt * law.rate[i];
      for (int j = 0; j < 4; ++j) step[i][1 + j] = d->dt * law.rate_by_speed[i][j];
    }
    implicit_states(share_of_end * d->dt, nx, law.rate_by_state, &step[0][0], 5, 5);
    for (int a = 0; a < 4; ++a)
      for (integer i = 0; i < nx; ++i) {
        law.load[a] += share_of_end * law.load_by_state[a][i] * step[i][0];
        for (int j = 0; j < 4; ++j) law.by_speed[a][j] += share_of_end * law.load_by_state[a][i] * step[i][1 + j];
      }
  }
  double in_plane[3];
  for (int c = 0; c < 3; ++c) in_plane[c] = patch->facet->n_s * w->forward[c] + patch->facet->n_t * w->up[c];
  double share = patch->share, tilt = patch->tilt, turn = patch->turn, side = patch->side;
  double e_t[3], e_n[3], moment_n[3], moment_y[3], moment_side[3];
  for (int c = 0; c < 3; ++c) {
    arm[c] = -r * in_plane[c];
    e_t[c] = share * t[c] + tilt * N[c];
    e_n[c] = share * N[c] - tilt * t[c];
  }
  cross(arm, N, moment_n);
  cross(arm, l, moment_y);
  const double across[3] = {0.0, 1.0, 0.0};
  cross(arm, across, moment_side);
  e_n[1] += side;
  double off_n = dot(moment_n, w->axle), off_y = dot(moment_y, w->axle), off_side = dot(moment_side, w->axle);
  for (int c = 0; c < 3; ++c) {
    moment_n[c] = share * (moment_n[c] - off_n * w->axle[c]) + side * (moment_side[c] - off_side * w->axle[c]);
    moment_y[c] = share * (moment_y[c] - off_y * w->axle[c]);
  }
  double push[4][MAX_COLS], see[4][MAX_COLS];
  for (integer i = 0; i < n; ++i) {
    const double *lin = w->lin[i], *ang = w->ang[i];
    double spin = dot(ang, w->axle);
    push[0][i] = dot(lin, e_t);
    push[1][i] = share * dot(lin, l) + dot(ang, moment_y);
    push[2][i] = dot(lin, e_n) + dot(ang, moment_n);
    push[3][i] = -turn * spin;
    see[0][i] = dot(lin, t);
    see[1][i] = dot(lin, l);
    see[2][i] = -dot(lin, N);
    see[3][i] = r * spin;
  }
  for (integer i = 0; i < n; ++i) {
    double row[4] = {0, 0, 0, 0};
    for (int a = 0; a < 4; ++a) {
      system->soil_Q[w->cols[i]] += push[a][i] * law.load[a];
      for (int b = 0; b < 4; ++b) row[b] += push[a][i] * law.by_speed[a][b];
    }
    double *target = system->soil_D[w->cols[i]];
    for (integer j = 0; j < n; ++j)
      target[w->cols[j]] += row[0] * see[0][j] + row[1] * see[1][j] + row[2] * see[2][j] + row[3] * see[3][j];
    if (!d->settling) continue;
    double spring = push[0][i] * stiffness[0] + push[1][i] * stiffness[1] + push[2][i] * stiffness[2] + push[3][i] * stiffness[3];
    for (integer j = 0; j < n; ++j) if (!slides(w->cols[j])) target[w->cols[j]] += spring * see[2][j];
  }
  const double felt[4] = {share, share, share, turn};
  for (int a = 0; a < 4; ++a) {
    update->load[a] += felt[a] * begun[a];
    update->end[a] += felt[a] * (2.0 * law.load[a] - begun[a]);
    const double *slope = law.by_speed[a];
    for (int c = 0; c < 3; ++c)
      update->end_by_velocity[a][c] += felt[a] * (slope[0] * t[c] + slope[1] * l[c] - slope[2] * N[c]);
    update->end_by_spin[a] += felt[a] * slope[3] * r;
  }
  double weight = fmax(share * law.load[2], 1e-12);
  update->weight += weight;
  for (integer i = 0; i < nx; ++i) {
    update->gain[i] += weight * step[i][0];
    for (integer j = 0; j < n; ++j)
      for (int b = 0; b < 4; ++b) update->by_col[i][j] += weight * step[i][1 + b] * see[b][j];
  }
  double *record = d->record + index * N_RECORD;
  record[0] += weight * law.slip[0];
  record[1] += weight * law.slip[1];
  record[3] += share * law.load[2];
  record[4] += share * law.load[0];
  record[5] += share * law.load[1] + side * l[1] * law.load[2];
  record[6] += turn * law.load[3];
  record[7] += weight * contact[1];
  record[8] += 1.0;
  for (int c = 0; c < 3; ++c)
    d->loads[6 * index + c] += e_n[c] * law.load[2] + e_t[c] * law.load[0] + share * l[c] * law.load[1];
  for (int c = 0; c < 3; ++c)
    d->loads[6 * index + 3 + c] += moment_n[c] * law.load[2] + moment_y[c] * law.load[1] - turn * w->axle[c] * law.load[3];
}

/* Add the patches of one strip of a wheel's width, which has this share of it; return how many touch. */
static integer add_strip(const Drive *d, const Wheel *wheel, integer index, const Facet *facets, integer n, double share,
                         double slope, System *system, WheelUpdate *update) {
  double radius = d->radius[index], deepest = 0.0, *sinkage = d->record + index * N_RECORD + 2, before = *sinkage;
  integer touching = 0;
  for (integer k = 0; k < n; ++k) {
    Patch patch;
    double n_soil = d->soils[N_SOIL * facets[k].ground + SOIL_N];
    if (!find_patch(facets, n, k, radius, n_soil, &patch)) continue;
    ++touching;
    deepest = fmax(deepest, patch.depth);
    patch.side = -slope * patch.share * patch.sinkage / (n_soil + 1.5);
    patch.share *= share;
    patch.tilt *= share;
    patch.turn *= share;
    add_patch(d, wheel, index, &patch, system, update);
  }
  *sinkage = before + share * deepest;
  return touching;
}

static void add_wheel(const Drive *d, integer index, Wheel *wheel, System *system, WheelUpdate *update) {
  Facet facets[MAX_FACETS + 1];
  look_at_wheel(d, index, wheel);
  double radius = d->radius[index];
  memset(update, 0, sizeof *update);
  memset(d->record + index * N_RECORD, 0, 9 * sizeof(double));
  memset(d->loads + 6 * index, 0, 6 * sizeof(double));
  integer touching = d->n_lanes ? 0 : add_strip(d, wheel, index, facets, cut_grid(d, wheel, radius, facets), 1.0, 0.0, system, update);
  for (integer lane = 0; lane < d->n_lanes; ++lane) {
    double slope, share = lane_share(d, wheel, lane, radius, d->kinds[2 * d->kind[index] + 1], &slope);
    if (share > 0.0) touching += add_strip(d, wheel, index, facets, cut_lane(d, wheel, lane, radius, facets), share, slope, system, update);
  }
  if (!touching && d->n_contact_states) { /* in the air: the states go on, nothing pushes */
    Facet below = {0, -radius, 0, 1, {wheel->up[0], wheel->up[1], wheel->up[2]}, 0};
    Patch patch = {1e-9, 0.0, 0.0, 0.0, 0.0, 0.0, &below};
    add_patch(d, wheel, index, &patch, system, update);
    d->record[index * N_RECORD + 8] = 0.0;
  }
  double *record = d->record + index * N_RECORD;
  if (update->weight > 0.0) {
    record[0] /= update->weight;
    record[1] /= update->weight;
    record[7] /= update->weight;
    for (integer i = 0; i < d->n_contact_states; ++i) {
      update->gain[i] /= update->weight;
      for (integer j = 0; j < wheel->n; ++j) update->by_col[i][j] /= update->weight;
    }
  }
}

/* By how much of its normal force a wheel's load now is not what the last step took it to become. */
static double misjudged(const Drive *d, integer index, const WheelUpdate *now) {
  const double *before = d->foreseen + 4 * index;
  if (!(now->load[2] > 0.0 && before[2] > 0.0)) return 0.0;
  double most = 0.0;
  for (int a = 0; a < 4; ++a) {
    double arm = a == 3 ? d->radius[index] : 1.0;
    most = fmax(most, fabs(now->load[a] / now->load[2] - before[a] / before[2]) / arm);
  }
  return most * fmin(1.0, now->load[2] / d->wheel_share);
}

static void foresee(const Drive *d, integer index, const Wheel *wheel, const WheelUpdate *update) {
  double velocity[3] = {0.0, 0.0, 0.0}, spin = 0.0;
  for (integer i = 0; i < wheel->n; ++i) {
    double du = d->du[wheel->cols[i]];
    for (int c = 0; c < 3; ++c) velocity[c] += wheel->lin[i][c] * du;
    spin += dot(wheel->ang[i], wheel->axle) * du;
  }
  for (int a = 0; a < 4; ++a)
    d->foreseen[4 * index + a] = update->end[a] + dot(update->end_by_velocity[a], velocity) + update->end_by_spin[a] * spin;
}

/* What all motors drew from the supply at the last step, a duty share of each winding's current. */
static double bus_current(const Drive *d) {
  double total = 0.0;
  for (integer w = 0; w < d->n_wheels; ++w) total += d->duty[w] * d->record[w * N_RECORD + 10];
  return total;
}

static void add_motor(const Drive *d, integer index, double bus, System *system, double step[][2]) {
  integer dof = d->wheel_dof[index], nx = d->n_motor_states;
  double input[4] = {d->duty[index], d->v[dof], (double)index, bus}, out[MAX_OUT], rate_by_state[MAX_STATES][MAX_STATES];
  const double *arguments[3] = {input, d->motor_states + index * nx, d->motor_parameters};
  double *results[1] = {out};
  d->motor_law(arguments, results, d->work_i, d->work_w, 0);
  const double *next = out; /* torque, d torque / d omega, current, supply, rate, its slope, torque by state, rate by state */
  double torque = *next++, slope = *next++;
  d->record[index * N_RECORD + 10] = *next++;
  d->record[index * N_RECORD + 11] = *next++;
  for (integer i = 0; i < nx; ++i) step[i][0] = d->dt * *next++;
  for (integer i = 0; i < nx; ++i) step[i][1] = d->dt * *next++;
  const double *by_state = next;
  next += nx;
  for (integer j = 0; j < nx; ++j)
    for (integer i = 0; i < nx; ++i) rate_by_state[i][j] = *next++;
  implicit_states(0.5 * d->dt, nx, rate_by_state, &step[0][0], 2, 2);
  for (integer i = 0; i < nx; ++i) {
    torque += 0.5 * by_state[i] * step[i][0];
    slope += 0.5 * by_state[i] * step[i][1];
  }
  system->motor_torque[dof] = torque;
  system->motor_slope[dof] = slope;
}

static void add_springs(const Drive *d, System *system) {
  for (integer i = 0; i < d->n_servos; ++i) { /* stiff and damped, taken at the end of the step */
    integer dof = d->servo_dof[i];
    double error = d->q[d->servo_q[i]] + 0.5 * d->dt * d->v[dof] - d->servo_target[i];
    system->other_Q[dof] = -d->servo_gain[0] * error - d->servo_gain[1] * d->v[dof];
    system->other_slope[dof] = -0.5 * d->servo_gain[0] * d->dt - d->servo_gain[1];
  }
  for (integer i = 0; i < d->n_stops; ++i) {
    integer dof = d->stop_dof[i];
    double angle = d->q[d->stop_q[i]], over = 0.0;
    if (angle > d->stop_limits[2 * i + 1]) over = angle - d->stop_limits[2 * i + 1];
    if (angle < d->stop_limits[2 * i]) over = angle - d->stop_limits[2 * i];
    if (over == 0.0) continue;
    double push = -d->stop_gain[0] * (over + 0.5 * d->dt * d->v[dof]) - d->stop_gain[1] * d->v[dof];
    if (push * over > 0.0) continue; /* leaving faster than the damper: a stop does not pull */
    system->other_Q[dof] = push;
    system->other_slope[dof] = -0.5 * d->stop_gain[0] * d->dt - d->stop_gain[1];
  }
}

static void push_body(const Drive *d, BodyPush *push) {
  const integer n = d->n_body, joints = n - 6;
  double input[14 + 2 * MAX_DOF], out[MAX_DOF * (MAX_DOF + 2) + 1], *next = input;
  memcpy(next, d->q, 7 * sizeof(double));
  memcpy(next + 7, d->v, 6 * sizeof(double));
  next += 13;
  for (integer i = 0; i < joints; ++i) *next++ = d->q[d->body_q[i]];
  for (integer i = 0; i < joints; ++i) *next++ = d->v[d->body_dof[6 + i]];
  *next = 0.5 * d->dt;
  const double *arguments[3] = {input, 0, d->body_parameters};
  double *results[1] = {out};
  d->body_law(arguments, results, d->work_i, d->work_w, 0);
  memcpy(push->Q, out, n * sizeof(double));
  memcpy(push->D, out + n, n * n * sizeof(double));
  push->torque = out[n + n * n];
  memcpy(push->torque_slope, out + n + n * n + 1, n * sizeof(double));
}

/* Component i of the body's push at the end of the step. */
static double body_force(const Drive *d, const BodyPush *push, integer i) {
  double force = push->Q[i];
  for (integer j = 0; j < d->n_body; ++j) force += push->D[i + j * d->n_body] * d->du[d->body_dof[j]];
  return force;
}

/* Gaussian elimination with row pivoting on A (n x n) and b. */
static int solve(integer n, double A[][MAX_DOF], double *b) {
  for (integer p = 0; p < n; ++p) {
    integer best = p;
    for (integer i = p + 1; i < n; ++i) if (fabs(A[i][p]) > fabs(A[best][p])) best = i;
    if (!(fabs(A[best][p]) > 1e-300)) return SINGULAR;
    if (best != p) {
      for (integer j = p; j < n; ++j) { double s = A[p][j]; A[p][j] = A[best][j]; A[best][j] = s; }
      double s = b[p]; b[p] = b[best]; b[best] = s;
    }
    double inverse = 1.0 / A[p][p];
    for (integer i = p + 1; i < n; ++i) {
      double factor = A[i][p] * inverse;
      if (factor == 0.0) continue;
      for (integer j = p + 1; j < n; ++j) A[i][j] -= factor * A[p][j];
      b[i] -= factor * b[p];
    }
  }
  for (integer p = n - 1; p >= 0; --p) {
    for (integer j = p + 1; j < n; ++j) b[p] -= A[p][j] * b[j];
    b[p] /= A[p][p];
  }
  return OK;
}

/* (M - dt/2 D) du = dt (Q - nle), with v_follower = ratio v_leader for joints that are coupled, as the rockers of a
   differential are; springs and the body's push fully implicit. */
static int solve_speeds(const Drive *d, System *system, const BodyPush *push) {
  integer nv = d->nv, n = 0, index[MAX_DOF], follows[MAX_DOF] = {0};
  double b[MAX_DOF], half = implicit_share(d) * d->dt;
  for (integer j = 0; j < nv; ++j)
    for (integer i = 0; i <= j; ++i) { /* pinocchio fills the upper triangle */
      double m = d->M[i * nv + j];
      system->A[i][j] = m - half * system->soil_D[i][j];
      if (i != j) system->A[j][i] = m - half * system->soil_D[j][i];
    }
  for (integer i = 0; i < nv; ++i) {
    system->A[i][i] -= half * system->motor_slope[i] + d->dt * system->other_slope[i];
    b[i] = d->dt * (system->soil_Q[i] + system->motor_torque[i] + system->other_Q[i] - d->nle[i]);
  }
  for (integer j = 0; j < d->n_body; ++j) {
    b[d->body_dof[j]] += d->dt * push->Q[j];
    for (integer i = 0; i < d->n_body; ++i) system->A[d->body_dof[i]][d->body_dof[j]] -= d->dt * push->D[i + j * d->n_body];
  }
  for (integer c = 0; c < d->n_coupled; ++c) {
    integer follower = d->coupled_dof[2 * c], leader = d->coupled_dof[2 * c + 1];
    double ratio = d->coupled_ratio[c];
    for (integer j = 0; j < nv; ++j) system->A[leader][j] += ratio * system->A[follower][j];
    for (integer i = 0; i < nv; ++i) system->A[i][leader] += ratio * system->A[i][follower];
    b[leader] += ratio * b[follower];
    follows[follower] = 1;
  }
  for (integer i = 0; i < nv; ++i) if (!follows[i]) index[n++] = i;
  if (n < nv)
    for (integer i = 0; i < n; ++i) { /* in place: index[i] >= i */
      b[i] = b[index[i]];
      for (integer j = 0; j < n; ++j) system->A[i][j] = system->A[index[i]][index[j]];
    }
  int status = solve(n, system->A, b);
  for (integer i = 0; i < n; ++i) d->du[index[i]] = b[i];
  for (integer c = 0; c < d->n_coupled; ++c)
    d->du[d->coupled_dof[2 * c]] = d->coupled_ratio[c] * d->du[d->coupled_dof[2 * c + 1]];
  return status;
}

static void account(const Drive *d, const System *system, const BodyPush *push) {
  double soil = 0, motor = 0, other = 0, servos = 0;
  for (integer i = 0; i < d->nv; ++i) {
    double speed = d->v[i] + 0.5 * d->du[i], force = system->soil_Q[i];
    for (integer j = 0; j < d->nv; ++j) force += 0.5 * system->soil_D[i][j] * d->du[j];
    soil -= force * speed;
    motor += (system->motor_torque[i] + 0.5 * system->motor_slope[i] * d->du[i]) * speed;
    other -= (system->other_Q[i] + system->other_slope[i] * d->du[i]) * speed;
  }
  for (integer k = 0; k < d->n_servos; ++k) {
    integer i = d->servo_dof[k];
    servos -= (system->other_Q[i] + system->other_slope[i] * d->du[i]) * (d->v[i] + 0.5 * d->du[i]);
  }
  for (integer k = 0; k < d->n_body; ++k) {
    integer i = d->body_dof[k];
    d->energy[ENERGY_BODY] -= d->dt * body_force(d, push, k) * (d->v[i] + 0.5 * d->du[i]);
  }
  d->energy[ENERGY_MOTOR] += d->dt * motor;
  d->energy[ENERGY_SOIL] += d->dt * soil;
  d->energy[ENERGY_STOPS] += d->dt * (other - servos);
  d->energy[ENERGY_SERVOS] += d->dt * servos;
  for (integer w = 0; w < d->n_wheels; ++w)
    for (int c = 0; c < 3; ++c) d->impulse[c] += d->dt * d->loads[6 * w + c];
  for (integer w = 0; w < d->n_wheels; ++w)
    d->energy[ENERGY_ELECTRIC] += d->dt * d->record[w * N_RECORD + 10] * d->record[w * N_RECORD + 11] * d->duty[w];
}

/* The differential's torque on the left rocker: what Eq (8) lacks in its row, or what stands for it on the body. */
static double differential_torque(const Drive *d, const System *system, const BodyPush *push) {
  integer i = d->differential_left;
  if (i < 0) {
    double torque = d->n_body ? push->torque : 0.0;
    for (integer j = 0; j < d->n_body; ++j) torque += push->torque_slope[j] * d->du[d->body_dof[j]];
    return torque;
  }
  double torque = d->nle[i] - system->soil_Q[i] - system->other_Q[i] - system->other_slope[i] * d->du[i];
  for (integer j = 0; j < d->nv; ++j)
    torque += (d->M[i * d->nv + j] / d->dt - 0.5 * system->soil_D[i][j]) * d->du[j];
  for (integer k = 6; k < d->n_body; ++k) if (d->body_dof[k] == i) torque -= body_force(d, push, k);
  return torque;
}

/* ---- configuration ---- */

static void advance_base(double *q, const double *v, double dt) {
  double w[3] = {v[3] * dt, v[4] * dt, v[5] * dt}, u[3] = {v[0] * dt, v[1] * dt, v[2] * dt};
  double angle_2 = dot(w, w), angle = sqrt(angle_2), a, b, s, c;
  if (angle < 1e-4) {
    a = 0.5 - angle_2 / 24.0;
    b = 1.0 / 6.0 - angle_2 / 120.0;
    s = 0.5 - angle_2 / 48.0;
  } else {
    a = (1.0 - cos(angle)) / angle_2;
    b = (angle - sin(angle)) / (angle_2 * angle);
    s = sin(0.5 * angle) / angle;
  }
  c = cos(0.5 * angle);
  double wu[3], wwu[3], move[3], turned[3], twice[3];
  cross(w, u, wu);
  cross(w, wu, wwu);
  for (int i = 0; i < 3; ++i) move[i] = u[i] + a * wu[i] + b * wwu[i];
  cross(q + 3, move, turned); /* R move = move + 2 qw (qv x move) + 2 qv x (qv x move) */
  cross(q + 3, turned, twice);
  for (int i = 0; i < 3; ++i) q[i] += move[i] + 2.0 * (q[6] * turned[i] + twice[i]);
  double e[3] = {s * w[0], s * w[1], s * w[2]}, mixed[3], product[4];
  cross(q + 3, e, mixed);
  for (int i = 0; i < 3; ++i) product[i] = q[6] * e[i] + c * q[3 + i] + mixed[i];
  product[3] = q[6] * c - dot(q + 3, e);
  double scale = 1.0 / sqrt(dot(product, product) + product[3] * product[3]);
  for (int i = 0; i < 4; ++i) q[3 + i] = product[i] * scale;
}

/* Move the configuration half a step on at the present velocity. */
void rover_pin_drift(const Drive *d) {
  const double half = 0.5 * d->dt;
  advance_base(d->q, d->v, half);
  for (integer k = 0; k < d->n_joints; ++k) {
    double step = d->v[d->joint_dof[k]] * half, *q = d->q + d->joint_q[k];
    if (!d->joint_unbounded[k]) { *q += step; continue; }
    double c = cos(step), s = sin(step), x = c * q[0] - s * q[1], y = s * q[0] + c * q[1];
    double scale = 1.0 / sqrt(x * x + y * y);
    q[0] = x * scale;
    q[1] = y * scale;
  }
}

static void mirror_speeds(const Drive *d) {
  double image[MAX_DOF];
  for (integer i = 0; i < d->nv; ++i) image[i] = d->mirror_sign[i] * d->v[d->mirror_index[i]];
  for (integer i = 0; i < d->nv; ++i) d->v[i] = 0.5 * (d->v[i] + image[i]);
}

/* Work out what the contact law holds; again after every change of the soils. */
void rover_pin_hold(const Drive *d) {
  double constants[N_WHEEL + N_SOIL], *row = d->held;
  const double *arguments[2] = {constants, d->contact_parameters};
  for (integer kind = 0; kind < d->n_kinds; ++kind)
    for (integer soil = 0; soil < d->n_soils; ++soil, row += d->n_held) {
      memcpy(constants, d->kinds + N_WHEEL * kind, N_WHEEL * sizeof(double));
      memcpy(constants + N_WHEEL, d->soils + N_SOIL * soil, N_SOIL * sizeof(double));
      double *results[1] = {row};
      d->contact_before(arguments, results, d->work_i, d->work_w, 0);
    }
}

/* For the caller to check that its mirror of the struct is this one. */
integer rover_pin_size(void) { return (integer)sizeof(Drive); }

/* The second half of a step: speeds from the forces half-way, then the configuration to the end. */
int rover_pin_step(Drive *d) {
  System system;
  BodyPush push;
  Wheel wheels[MAX_DOF];
  WheelUpdate updates[MAX_DOF];
  double motor_steps[MAX_DOF][MAX_STATES][2];
  integer nv = d->nv, nx = d->n_contact_states;
  for (integer i = 0; i < nv; ++i) memset(system.soil_D[i], 0, nv * sizeof(double));
  memset(system.soil_Q, 0, sizeof(System) - offsetof(System, soil_Q));
  d->misjudged = 0.0;
  const double bus = bus_current(d), share_of_end = implicit_share(d);
  for (integer w = 0; w < d->n_wheels; ++w) {
    add_wheel(d, w, &wheels[w], &system, &updates[w]);
    d->misjudged = fmax(d->misjudged, misjudged(d, w, &updates[w]));
    add_motor(d, w, bus, &system, motor_steps[w]);
    d->record[w * N_RECORD + 9] = system.motor_torque[d->wheel_dof[w]];
  }
  add_springs(d, &system);
  if (d->n_body) push_body(d, &push);
  int status = solve_speeds(d, &system, &push);
  if (status != OK) return status;
  account(d, &system, &push);
  *d->differential = differential_torque(d, &system, &push);
  for (integer w = 0; w < d->n_wheels; ++w) {
    foresee(d, w, &wheels[w], &updates[w]);
    for (integer i = 0; i < nx; ++i) {
      double change = updates[w].gain[i];
      for (integer j = 0; j < d->col_count[w]; ++j) change += share_of_end * updates[w].by_col[i][j] * d->du[d->cols[w * d->n_cols + j]];
      d->contact_states[w * nx + i] += change;
    }
    for (integer i = 0; i < d->n_motor_states; ++i)
      d->motor_states[w * d->n_motor_states + i] += motor_steps[w][i][0] + 0.5 * motor_steps[w][i][1] * d->du[d->wheel_dof[w]];
  }
  double total = 0.0;
  for (integer i = 0; i < nv; ++i) {
    d->v[i] += d->du[i];
    total += d->v[i];
  }
  if (!isfinite(total)) return NOT_FINITE;
  if (d->symmetric) mirror_speeds(d);
  rover_pin_drift(d);
  return OK;
}
