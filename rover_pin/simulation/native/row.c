/* What is logged of an instant, in the order of trace/rows.py; and whether the drive can go on. */

static double *put(double *row, const double *values, integer n) {
  memcpy(row, values, n * sizeof(double));
  return row + n;
}

static void find_attitude(const double *q, double *attitude) {
  const double x = q[3], y = q[4], z = q[5], w = q[6];
  attitude[0] = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y));
  attitude[1] = asin(smaller(1.0, larger(-1.0, 2.0 * (w * y - z * x))));
  attitude[2] = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
}

/* The base's velocity in the world. */
static void find_velocity(const double *q, const double *v, double *velocity) {
  double once[3], twice[3];
  cross(q + 3, v, once);
  cross(q + 3, once, twice);
  for (int i = 0; i < 3; ++i) velocity[i] = v[i] + 2.0 * (q[6] * once[i] + twice[i]);
}

/* Let the motors' part of `now` be of this instant. */
static void look_at_motors(Drive *d, Loop *l) {
  const double dt = d->dt;
  d->dt = GLANCE;
  add_motors(d, bus_current(d), d->step);
  d->dt = dt;
  for (integer i = 0; i < d->n_wheels * N_RECORD; ++i) {
    const double before = l->now[i];
    l->now[i] = d->record[i];
    d->record[i] = before;
  }
}

/* What a step records is of its begin. A replay compares nothing of the soil's loads, and keeps its last step's; wheels
   that are held to rates have no torque in an instant. */
static void observe(Drive *d, Loop *l) {
  if (l->seen) return;
  if (l->place_rows) {
    keep_now(d, l);
    if (!d->held_rate) look_at_motors(d, l);
  } else {
    look(d, l, 0);
  }
  l->seen = 1;
}

void rover_pin_row(Drive *d, Loop *l, double *row) {
  double mechanical[2] = {0.0, 0.0}, attitude[3], velocity[3];
  observe(d, l);
  if (d->accounts) rover_pin_energies(d, mechanical);
  find_attitude(d->q, attitude);
  find_velocity(d->q, d->v, velocity);
  *row++ = l->begin + l->k * l->dt;
  row = put(row, d->q, d->nq);
  row = put(row, d->v, d->nv);
  row = put(row, l->now, d->n_wheels * N_RECORD);
  row = put(row, d->duty, d->n_wheels);
  row = put(row, d->servo_target, d->n_servos);
  row = put(row, d->energy, N_ENERGY);
  row = put(row, d->impulse, 3);
  row = put(row, l->now + d->n_wheels * N_RECORD, 1);
  row = put(row, mechanical, 2);
  row = put(row, attitude, 3);
  row = put(row, velocity, 3);
  put(row, l->moved, 3);
}

/* Whether the drive has capsized, is buried, folded or diverged: failure.py says which, and with what. */
static int fails(const Drive *d, const Loop *l) {
  const double x = d->q[3], y = d->q[4];
  for (int i = 0; i < 3; ++i) if (!(fabs(d->v[i]) < l->fastest)) return 1;
  if (1.0 - 2.0 * (x * x + y * y) < l->upright) return 1;
  for (integer w = 0; w < d->n_wheels; ++w)
    if (l->now[w * N_RECORD + RECORD_SINKAGE] > l->buried * d->radius[w]) return 1;
  for (integer i = 0; i < l->n_folding; ++i) {
    const double angle = d->q[l->folding_q[i]];
    if (larger(angle - l->folding_limits[2 * i + 1], l->folding_limits[2 * i] - angle) > l->folded) return 1;
  }
  return 0;
}
