/* From the law at each patch to the load of each wheel, from the loads to the equations of the step, and what the
   step expected of the loads. */

/* Solve (I - half A) X = B for X (n x m, rows of length `stride`), n <= MAX_STATES, by elimination without pivoting:
   half A is small beside 1. */
static void implicit_states(double half, integer n, double a[][MAX_STATES], double *b, integer m, integer stride) {
  double lhs[MAX_STATES][MAX_STATES], inverse[MAX_STATES];
  for (integer i = 0; i < n; ++i)
    for (integer j = 0; j < n; ++j) lhs[i][j] = (i == j) - half * a[i][j];
  for (integer p = 0; p < n; ++p) {
    inverse[p] = 1.0 / lhs[p][p];
    for (integer i = p + 1; i < n; ++i) {
      double factor = lhs[i][p] * inverse[p];
      for (integer j = p; j < n; ++j) lhs[i][j] -= factor * lhs[p][j];
      for (integer j = 0; j < m; ++j) b[i * stride + j] -= factor * b[p * stride + j];
    }
  }
  for (integer p = n - 1; p >= 0; --p)
    for (integer j = 0; j < m; ++j) {
      for (integer i = p + 1; i < n; ++i) b[p * stride + j] -= lhs[p][i] * b[i * stride + j];
      b[p * stride + j] *= inverse[p];
    }
}

/* The implicit step of a patch's states. */

/* change of each state over the step, dx = (I - dt/2 r_x)^-1 dt (r + r_v w): its constant part, then its slopes with
   the speeds w of mean_du */
typedef struct {
  double of[MAX_STATES][5];
} StateStep;

/* Take the states' step, and add its effect to the load and its slopes: while driving, half of the step acts on the
   mean load. */
static void step_states(const Drive *d, Law *law, StateStep *step) {
  const integer nx = d->n_contact_states;
  const double share_of_end = state_share(d);
  for (integer i = 0; i < nx; ++i) {
    step->of[i][0] = d->dt * law->rate[i];
    for (int j = 0; j < 4; ++j) step->of[i][1 + j] = d->dt * law->rate_by_speed[i][j];
  }
  implicit_states(share_of_end * d->dt, nx, law->rate_by_state, &step->of[0][0], 5, 5);
  for (int a = 0; a < 4; ++a)
    for (integer i = 0; i < nx; ++i) {
      const double by_state = share_of_end * law->load_by_state[a][i];
      law->load[a] += by_state * step->of[i][0];
      for (int j = 0; j < 4; ++j) law->by_speed[a][j] += by_state * step->of[i][1 + j];
    }
}

/* Write the wrench at the wheel's centre for a unit of f_t, f_y, f_n and torque: force (3), then moment (3). The
   moments are those across the axle only; about the axle, the law gives the torque itself. */
static void find_wrenches(const Wheel *w, const Spot *spot, double r, double wrench[4][6]) {
  const Patch *patch = &spot->patch;
  const double *N = spot->patch.normal, *t = spot->t, *l = spot->l, across[3] = {0.0, 1.0, 0.0};
  double arm[3], by_n[3], by_y[3], by_side[3];
  for (int c = 0; c < 3; ++c) arm[c] = -r * (patch->n_s * w->forward[c] + patch->n_t * w->up[c]);
  cross(arm, N, by_n);
  cross(arm, l, by_y);
  cross(arm, across, by_side);
  /* part of a side force's moment about the axle; the other forces pass through it */
  const double off_side = dot(by_side, w->axle);
  for (int c = 0; c < 3; ++c) {
    const double axle = w->axle[c];
    wrench[0][c] = patch->share * t[c] + patch->tilt * N[c];
    wrench[1][c] = patch->share * l[c];
    wrench[2][c] = patch->share * N[c] - patch->tilt * t[c] + patch->side * across[c];
    wrench[3][c] = wrench[0][3 + c] = 0.0;
    wrench[1][3 + c] = patch->share * by_y[c];
    wrench[2][3 + c] = patch->share * by_n[c] + patch->side * (by_side[c] - off_side * axle);
    wrench[3][3 + c] = -patch->turn * axle;
  }
}

/* Convert slopes with the patch's speeds (v_x v_y v_n rim) to slopes with the wheel's velocity (3) and spin. */
static void to_wheel_slopes(const Spot *spot, double r, const double *by_speed, double *out) {
  const double *N = spot->patch.normal;
  for (int c = 0; c < 3; ++c) out[c] = by_speed[0] * spot->t[c] + by_speed[1] * spot->l[c] - by_speed[2] * N[c];
  out[3] = by_speed[3] * r;
}

/* Add a patch to the record of its wheel. Slip and travel are means, weighted by the normal force; finish_wheel
   divides by the sum of the weights. */
static void record_patch(const Drive *d, const Spot *spot, const Law *law, double weight) {
  const Patch *patch = &spot->patch;
  double *record = d->record + spot->wheel * N_RECORD;
  record[RECORD_SLIP] += weight * law->slip[0];
  record[RECORD_SLIP_Y] += weight * law->slip[1];
  record[RECORD_NORMAL] += patch->share * law->load[2];
  record[RECORD_TANGENTIAL] += patch->share * law->load[0];
  record[RECORD_LATERAL] += patch->share * law->load[1] + patch->side * spot->l[1] * law->load[2];
  record[RECORD_SOIL_TORQUE] += patch->turn * law->load[3];
  record[RECORD_TRAVEL] += weight * spot->contact[GEOMETRY_V_X];
  if (!spot->airborne) record[RECORD_PATCHES] += 1.0;
}

/* Add the load of a patch, and its slopes, to its wheel. The mean load of the step uses the states half-way through
   the step; the load at its end is extrapolated from begin and mean. */
static void add_patch(const Drive *d, const Wheel *w, const Spot *spot, Law *law, const double *stiffness,
                      WheelLoad *sum) {
  const double r = d->radius[spot->wheel], *N = spot->patch.normal, share = spot->patch.share;
  const double load_shares[4] = {share, share, share, spot->patch.turn};
  double at_begin[4], wrench[4][6];
  StateStep step;
  /* The law's load is that at the beginning; step_states turns it into the mean load. */
  memcpy(at_begin, law->load, sizeof at_begin);
  step_states(d, law, &step);
  find_wrenches(w, spot, r, wrench);
  /* For each of f_t, f_y, f_n and torque: wrench at the wheel's centre, load at the beginning and expected at the
     end. */
  for (int a = 0; a < 4; ++a) {
    double slope[4];
    to_wheel_slopes(spot, r, law->by_speed[a], slope);
    for (int i = 0; i < 6; ++i) {
      sum->wrench[i] += wrench[a][i] * law->load[a];
      for (int c = 0; c < 4; ++c) sum->slope[i][c] += wrench[a][i] * slope[c];
    }
    sum->load[a] += load_shares[a] * at_begin[a];
    sum->end[a] += load_shares[a] * (2.0 * law->load[a] - at_begin[a]);
    for (int c = 0; c < 4; ++c) sum->end_slope[a][c] += load_shares[a] * slope[c];
    /* Setting down: displacement along the patch's normal changes the depth, and so the load. */
    if (!d->settling) continue;
    for (int i = 0; i < 6; ++i)
      for (int c = 0; c < 3; ++c) sum->spring[i][c] -= wrench[a][i] * stiffness[a] * N[c];
  }
  /* States of a wheel with several patches follow the mean of the patches, weighted by their normal force. */
  const double weight = larger(share * law->load[2], 1e-12);
  sum->weight += weight;
  for (integer i = 0; i < d->n_contact_states; ++i) {
    double slope[4];
    to_wheel_slopes(spot, r, step.of[i] + 1, slope);
    sum->gain[i] += weight * step.of[i][0];
    for (int c = 0; c < 4; ++c) sum->gain_slope[i][c] += weight * slope[c];
  }
  record_patch(d, spot, law, weight);
}

/* Evaluate the laws of all spots in the pool, add their loads, and empty the pool. */
static void add_spots(const Drive *d, Step *s) {
  evaluate_laws(d, s);
  for (integer k = 0; k < s->n_spots; ++k) {
    /* While a rover is set down, the answers for a slightly larger sinkage follow those for the sinkage itself. */
    const Spot *spot = s->spots + k;
    Law law;
    double stiffness[4] = {0.0, 0.0, 0.0, 0.0};
    integer answers = travel_law(d, s, spot, spot->asked, &law);
    if (d->settling) find_stiffness(d, s, spot, spot->asked + answers, &law, stiffness);
    add_patch(d, s->wheels + spot->wheel, spot, &law, stiffness, s->loads + spot->wheel);
  }
  s->n_spots = s->n_questions = 0;
}

/* Divide the sums of a wheel by the sum of the patches' weights, and store its wrench. */
static void finish_wheel(const Drive *d, integer index, WheelLoad *sum) {
  double *record = d->record + index * N_RECORD;
  for (int i = 0; i < 6; ++i) d->loads[6 * index + i] = sum->wrench[i];
  if (!(sum->weight > 0.0)) return;
  const double part = 1.0 / sum->weight;
  record[RECORD_SLIP] *= part;
  record[RECORD_SLIP_Y] *= part;
  record[RECORD_TRAVEL] *= part;
  for (integer i = 0; i < d->n_contact_states; ++i) {
    sum->gain[i] *= part;
    for (int c = 0; c < 4; ++c) sum->gain_slope[i][c] *= part;
  }
}

/* Write vector k (of 8 degrees of freedom) of the wrench's slopes with the degrees of freedom above the wheel. While
   a rover is set down, the spring's slopes are added for all but the base's slide. */
static void slope_row(const Drive *d, const Wheel *w, const WheelLoad *sum, integer k, Row slope[6]) {
  const Row x = ((const Row *)w->lin[0])[k], y = ((const Row *)w->lin[1])[k], z = ((const Row *)w->lin[2])[k];
  const Row rim = ((const Row *)w->rim)[k];
  for (int i = 0; i < 6; ++i) {
    const double *by = sum->slope[i];
    slope[i] = by[0] * x + by[1] * y + by[2] * z + by[3] * rim;
  }
  if (!d->settling) return;
  Row free;
  for (integer j = 0; j < 8; ++j) free[j] = 8 * k + j < w->n && !slides(w->cols[8 * k + j]);
  for (int i = 0; i < 6; ++i) slope[i] += free * (sum->spring[i][0] * x + sum->spring[i][1] * y + sum->spring[i][2] * z);
}

/* Add J^T wrench to the generalised forces, and J^T slope J times -implicit_dt to the left side A of the equations. */
static void add_wheel(const Drive *d, const Wheel *w, const WheelLoad *sum, double implicit_dt, System *system) {
  const double *J[6] = {w->lin[0], w->lin[1], w->lin[2], w->ang[0], w->ang[1], w->ang[2]};
  for (integer k = 0; k < w->rows; ++k) {
    Row slope[6];
    const integer first = 8 * k, last = w->n < first + 8 ? w->n : first + 8;
    slope_row(d, w, sum, k, slope);
    for (integer i = 0; i < w->n; ++i) {
      Row row = J[0][i] * slope[0];
      for (int a = 1; a < 6; ++a) row += J[a][i] * slope[a];
      row *= implicit_dt;
      double *target = system->A[w->cols[i]];
      integer j = first;
      /* the base's six columns come first in every wheel's Jacobian and in A, so they are added as one vector */
      if (k == 0) {
        Row base = row;
        base[6] = base[7] = 0.0;
        *(Row *)target -= base;
        j = 6;
      }
      for (; j < last; ++j) target[w->cols[j]] -= row[j - first];
    }
  }
  for (integer i = 0; i < w->n; ++i)
    for (int a = 0; a < 6; ++a) system->force[w->cols[i]] += J[a][i] * sum->wrench[a];
}

/* After the solve: the wheels' motion over the step, and the error of the linear forecast of their loads, which
   controls the step size (pace.c). */

/* Forecast error of a wheel: the largest difference between its load per normal force now and as the last step
   expected it [-]. Torque is compared as torque / r. A wheel that carries less than its equal share of the weight
   counts less. */
static double misjudged(const Drive *d, integer index, const WheelLoad *now) {
  const double *before = d->foreseen + 4 * index;
  if (!(now->load[2] > 0.0 && before[2] > 0.0)) return 0.0;
  double largest = 0.0;
  for (int a = 0; a < 4; ++a) {
    double arm = a == 3 ? d->radius[index] : 1.0;
    largest = larger(largest, fabs(now->load[a] / now->load[2] - before[a] / before[2]) / arm);
  }
  return largest * smaller(1.0, now->load[2] / d->wheel_share);
}

/* Inner product of slopes with a change of velocity and spin. */
static double slope_times_motion(const double *slope, const double *moved) {
  return slope[0] * moved[0] + slope[1] * moved[1] + slope[2] * moved[2] + slope[3] * moved[3];
}

/* Write the velocity and spin of a wheel that belong to speeds of the rover. */
static void motion_by(const Wheel *wheel, const double *speeds, double *motion) {
  _Alignas(64) double own[MAX_COLS];
  gather_columns(wheel, speeds, own);
  for (int c = 0; c < 3; ++c) motion[c] = along(wheel->lin[c], own, wheel->rows);
  motion[3] = along(wheel->rim, own, wheel->rows);
}

/* End the step of a wheel: its change of motion, the load expected at the step's end, and its states there. */
static void end_wheel(const Drive *d, integer index, const Wheel *wheel, const double *mean_du, WheelLoad *sum) {
  /* The forecast uses du, the change over the whole step; the states use the change of the mean force. */
  const integer nx = d->n_contact_states;
  motion_by(wheel, d->du, sum->moved);
  motion_by(wheel, mean_du, sum->mean_moved);
  for (int a = 0; a < 4; ++a) d->foreseen[4 * index + a] = sum->end[a] + slope_times_motion(sum->end_slope[a], sum->moved);
  for (integer i = 0; i < nx; ++i)
    d->contact_states[index * nx + i] += sum->gain[i] + slope_times_motion(sum->gain_slope[i], sum->mean_moved);
}

/* Return the power [W] of the soil on a wheel at the mean speed of the step, and store its mean wrench. */
static double soil_power(const Drive *d, integer index, const Wheel *wheel, const WheelLoad *sum) {
  _Alignas(64) double du[MAX_COLS];
  double power = 0.0, *mean = d->mean_loads + 6 * index;
  gather_columns(wheel, d->du, du);
  for (int i = 0; i < 6; ++i) mean[i] = sum->wrench[i] + slope_times_motion(sum->slope[i], sum->mean_moved);
  for (int c = 0; c < 3; ++c) {
    power += mean[c] * (wheel->velocity[c] + 0.5 * sum->moved[c]);
    power += mean[3 + c] * (wheel->rate[c] + 0.5 * along(wheel->ang[c], du, wheel->rows));
  }
  return power;
}
