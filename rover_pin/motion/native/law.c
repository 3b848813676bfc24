/* What a patch pushes: the generated law in the direction of travel, and its slopes. */

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
