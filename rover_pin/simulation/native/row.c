/* Rows of the drive's log, in the order of trace/rows.py; and the check whether the drive can go on. */

/* Copy n numbers into a row; return the place behind them. */
static double *put(double *row, const double *values, integer n) {
  memcpy(row, values, n * sizeof(double));
  return row + n;
}

/* Roll, pitch (nose down positive) and yaw [rad] of the base, world z-y-x, from its quaternion. */
static void find_attitude(const double *q, double *attitude) {
  const double x = q[3], y = q[4], z = q[5], w = q[6];
  attitude[0] = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y));
  attitude[1] = asin(smaller(1.0, larger(-1.0, 2.0 * (w * y - z * x))));
  attitude[2] = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
}

/* Velocity of the base in the world [m/s]: its own velocity v, rotated by the quaternion. */
static void find_velocity(const double *q, const double *v, double *velocity) {
  double once[3], twice[3];
  cross(q + 3, v, once);
  cross(q + 3, once, twice);
  for (int i = 0; i < 3; ++i) velocity[i] = v[i] + 2.0 * (q[6] * once[i] + twice[i]);
}

/* Update the motors' part of `now` to this instant: the motor law for a step of GLANCE seconds. The loop swaps
   record and `now`, so that the record of the last step is kept. */
static void update_motors_now(Drive *d, Loop *l) {
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

/* Bring `now` up to this instant, once for each instant, because a step records the forces at its beginning. A
   replay is not compared with the soil's loads and keeps those of its last step; wheels that are held to rates have
   no torque of an instant. */
static void observe(Drive *d, Loop *l) {
  if (l->seen) return;
  if (l->place_rows) {
    copy_to_now(d, l);
    if (!d->held_rate) update_motors_now(d, l);
  } else {
    look(d, l, 0);
  }
  l->seen = 1;
}

/* Write the row of this instant; row_type in trace/rows.py has the same order. */
void rover_pin_row(Drive *d, Loop *l, double *row) {
  /* Quantities that a step does not need: energies, attitude, velocity in the world. */
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

/* Whether the drive has diverged, capsized, buried a wheel or folded its suspension. failure.py has the same limits
   and puts the failure into words. */
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
