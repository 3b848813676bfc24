/* The built-in controllers, sampled in the loop: twins of control/'s classes, which say what they do and why. */

#define SLOWEST_RIM 1e-3 /* as of control/slip_estimate.py */

/* Linear between the points (x, y), the end values beyond. */
static double between(double at, const double *x, const double *y, integer n) {
  if (at <= x[0]) return y[0];
  if (at >= x[n - 1]) return y[n - 1];
  integer k = 0;
  while (x[k + 1] <= at) ++k;
  return (y[k + 1] - y[k]) / (x[k + 1] - x[k]) * (at - x[k]) + y[k];
}

/* S_hat of Eq (9) from the duty now applied. */
static double slip_by_table(const Loop *l, double rate, double duty) {
  const double rim = l->table_radius * rate, sense = rim < 0.0 ? -1.0 : 1.0, way = (duty > 0.0) - (duty < 0.0);
  const double speed = way * between(fabs(duty), l->table_duty, l->table_speed, l->n_table);
  return fmin(1.0, fmax(-1.0, 1.0 - sense * speed / fmax(fabs(rim), SLOWEST_RIM)));
}

/* The greatest |duty| that the torque limit allows a wheel in a sense of driving. */
static double most_duty(const Loop *l, integer wheel, double pitch, double rate, double sense) {
  if (!l->limit_pitch) return 1.0;
  const double torque = between(pitch, l->limit_pitch, l->limit_torque + wheel * l->n_pitches, l->n_pitches);
  return fmin(1.0, fmax(0.0, torque / l->stall_torque + sense * rate / l->no_load_rate));
}

/* One sample of the slip control: its duty; its integral goes on. */
static double slip_control(const Drive *d, Loop *l, integer wheel, double pitch, double rate) {
  const double slip = l->table_duty ? slip_by_table(l, rate, d->duty[wheel]) : d->record[wheel * N_RECORD + RECORD_SLIP];
  const double seen[3] = {slip, l->integral[wheel], most_duty(l, wheel, pitch, rate, 1.0)};
  const double *arguments[2] = {seen, l->gains};
  double out[2], *results[1] = {out};
  l->slip_law(arguments, results, d->work_i, d->work_w, 0);
  l->integral[wheel] += l->control_period * out[1];
  return out[0];
}

static void command(Drive *d, Loop *l) {
  double attitude[3];
  find_attitude(d->q, attitude);
  for (integer w = 0; w < d->n_wheels; ++w) {
    const double rate = d->v[d->wheel_dof[w]], pitch = attitude[1];
    double duty = l->duty_fixed[w];
    if (l->slip_law) duty = slip_control(d, l, w, pitch, rate);
    else duty = fmin(fmax(duty, -most_duty(l, w, pitch, rate, -1.0)), most_duty(l, w, pitch, rate, 1.0));
    d->duty[w] = fmin(1.0, fmax(-1.0, duty));
  }
  for (integer i = 0; i < d->n_servos; ++i) d->servo_target[i] = l->steer_fixed[i];
}
