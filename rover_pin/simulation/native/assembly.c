/* From what patches push to a wheel's load, and from that to generalised forces and their slopes. */

typedef struct { /* the states' step dx = (I - dt/2 r_x)^-1 dt (r + r_v w), w: mean_du; its start, and its slopes with speeds */
  double of[MAX_STATES][5];
} StateStep;

/* Half of the states' step acts on the load of the implicit solve. */
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

/* The wrench at the wheel's centre by a unit of f_t, f_y, f_n and torque: force (3), moment (3) across the axle. */
static void find_wrenches(const Wheel *w, const Spot *spot, double r, double wrench[4][6]) {
  const Patch *patch = &spot->patch;
  const double *N = spot->patch.normal, *t = spot->t, *l = spot->l, across[3] = {0.0, 1.0, 0.0};
  double arm[3], by_n[3], by_y[3], by_side[3];
  for (int c = 0; c < 3; ++c) arm[c] = -r * (patch->n_s * w->forward[c] + patch->n_t * w->up[c]);
  cross(arm, N, by_n);
  cross(arm, l, by_y);
  cross(arm, across, by_side);
  const double off_side = dot(by_side, w->axle); /* forces in the patch's plane and normal to it pass through the axle */
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

/* Rows of slopes with the patch's speeds (v_x v_y v_n rim) as slopes with the wheel's velocity and spin. */
static void by_motion(const Spot *spot, double r, const double *by_speed, double *out) {
  const double *N = spot->patch.normal;
  for (int c = 0; c < 3; ++c) out[c] = by_speed[0] * spot->t[c] + by_speed[1] * spot->l[c] - by_speed[2] * N[c];
  out[3] = by_speed[3] * r;
}

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

static void add_patch(const Drive *d, const Wheel *w, const Spot *spot, Law *law, const double *stiffness, WheelLoad *sum) {
  const double r = d->radius[spot->wheel], *N = spot->patch.normal, share = spot->patch.share;
  const double felt[4] = {share, share, share, spot->patch.turn};
  double begun[4], wrench[4][6];
  StateStep step;
  memcpy(begun, law->load, sizeof begun);
  step_states(d, law, &step);
  find_wrenches(w, spot, r, wrench);
  for (int a = 0; a < 4; ++a) {
    double slope[4];
    by_motion(spot, r, law->by_speed[a], slope);
    for (int i = 0; i < 6; ++i) {
      sum->wrench[i] += wrench[a][i] * law->load[a];
      for (int c = 0; c < 4; ++c) sum->slope[i][c] += wrench[a][i] * slope[c];
    }
    sum->load[a] += felt[a] * begun[a];
    sum->end[a] += felt[a] * (2.0 * law->load[a] - begun[a]);
    for (int c = 0; c < 4; ++c) sum->end_slope[a][c] += felt[a] * slope[c];
    if (!d->settling) continue;
    for (int i = 0; i < 6; ++i)
      for (int c = 0; c < 3; ++c) sum->spring[i][c] -= wrench[a][i] * stiffness[a] * N[c];
  }
  const double weight = larger(share * law->load[2], 1e-12);
  sum->weight += weight;
  for (integer i = 0; i < d->n_contact_states; ++i) {
    double slope[4];
    by_motion(spot, r, step.of[i] + 1, slope);
    sum->gain[i] += weight * step.of[i][0];
    for (int c = 0; c < 4; ++c) sum->gain_slope[i][c] += weight * slope[c];
  }
  record_patch(d, spot, law, weight);
}

/* The laws of all spots so far, and what they push. */
static void add_spots(const Drive *d, Step *s) {
  answer_all(d, s);
  for (integer k = 0; k < s->n_spots; ++k) {
    const Spot *spot = s->spots + k;
    Law law;
    double stiffness[4] = {0.0, 0.0, 0.0, 0.0};
    integer answers = travel_law(d, s, spot, spot->asked, &law);
    if (d->settling) find_stiffness(d, s, spot, spot->asked + answers, &law, stiffness);
    add_patch(d, s->wheels + spot->wheel, spot, &law, stiffness, s->loads + spot->wheel);
  }
  s->n_spots = s->n_questions = 0;
}

/* Means over a wheel's patches, by their normal force. */
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

/* Row k of 8 of the slopes of a wrench with the degrees of freedom above the wheel. */
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

/* J^T wrench into the forces, and its slopes by `implicit_dt` into the left side. */
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
      if (k == 0) { /* the base's columns come first in every wheel's, and in A */
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
