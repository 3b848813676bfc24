/* The built-in controllers, sampled in the loop: twins of control/'s classes, which say what they do and why. */

/* What the sensors read at this sample, with their noise and steps if they have any: attitude, then rate and current of
   the wheels, then angles of the suspension. */
static void read_sensors(const Drive *d, Loop *l) {
  const integer n = d->n_wheels, sizes[4] = {3, n, n, l->n_folding};
  const double *noise = l->noise ? l->noise + l->noise_row++ * (3 + 2 * n + l->n_folding) : 0;
  double *read = l->read;
  find_attitude(d->q, read);
  for (integer w = 0; w < n; ++w) {
    read[3 + w] = d->v[d->wheel_dof[w]];
    read[3 + n + w] = d->record[w * N_RECORD + RECORD_CURRENT];
  }
  for (integer i = 0; i < l->n_folding; ++i) read[3 + 2 * n + i] = d->q[l->folding_q[i]];
  if (!noise) return;
  for (int kind = 0; kind < 4; ++kind)
    for (integer i = 0; i < sizes[kind]; ++i, ++read) {
      const double step = l->noise_steps[kind];
      *read += l->noise_sds[kind] * *noise++;
      if (step > 0.0) *read = step * rint(*read / step);
    }
}

/* The on-board estimate takes the sample in: posture, rates, currents. */
static void estimate_slip(const Drive *d, const Loop *l) {
  const integer n = d->n_wheels, links = l->n_folding;
  double most = d->duty[0];
  for (integer w = 1; w < n; ++w) most = larger(most, d->duty[w]);
  memcpy(l->sample, l->read, 2 * sizeof(double));
  memcpy(l->sample + 2, l->read + 3 + 2 * n, links * sizeof(double));
  memcpy(l->sample + 2 + links, l->read + 3, 2 * n * sizeof(double));
  l->sense(l->belief, l->sample, most < l->backwards, NAN);
}

/* The deepest that a wheel's hole may be, by the estimate. */
static double hole_depth(const Loop *l, integer wheel) { return l->slips_and_holes[4 * wheel + 2] + l->slips_and_holes[4 * wheel + 3]; }

/* v_hat of Eq (9) from the duty now applied. */
static double speed_by_table(const Loop *l, double duty) {
  return signed_speed(duty, l->table_duty, l->table_speed, l->n_table);
}

/* The greatest |duty| that the torque limit allows a wheel in a sense of driving. */
static double most_duty(const Loop *l, integer wheel, double pitch, double rate, double sense) {
  if (!l->limit_pitch) return 1.0;
  const double torque = between(pitch, l->limit_pitch, l->limit_torque + wheel * l->n_pitches, l->n_pitches);
  return duty_for(torque, l->stall_torque, sense * rate / l->no_load_rate);
}

/* One sample of the slip control: its duty; its integral and hole go on. */
static double slip_control(const Drive *d, Loop *l, integer wheel, double pitch, double rate) {
  const double *truth = d->record + wheel * N_RECORD;
  double travel = truth[RECORD_TRAVEL], slip = truth[RECORD_SLIP];
  if (l->sense) {
    slip = l->slips_and_holes[4 * wheel];
    travel = slip_travel(slip, l->rim_radius * rate);
    l->depth[wheel] = hole_depth(l, wheel);
  } else if (l->table_duty) {
    travel = speed_by_table(l, d->duty[wheel]);
    slip = slip_by_table(l->table_radius, rate, travel);
  }
  const double most = most_duty(l, wheel, pitch, rate, 1.0);
  const double seen[6] = {slip, l->integral[wheel], most, rate, travel, l->depth[wheel]};
  const double *arguments[2] = {seen, l->gains};
  double out[3], *results[1] = {out};
  l->slip_law(arguments, results, d->work_i, d->work_w, 0);
  l->integral[wheel] += l->control_period * out[1];
  l->depth[wheel] += l->control_period * out[2];
  return out[0];
}

/* Duties and steering of a turn about a point so far to the left. */
static void turn_about(Drive *d, const Loop *l, double radius, double fastest) {
  double most = 0.0;
  for (integer w = 0; w < d->n_wheels; ++w) {
    const double way = radius - l->tack_places[2 * w + 1], speed = hypot(l->tack_places[2 * w], way);
    d->duty[w] = way >= 0.0 ? speed : -speed;
    most = larger(most, speed);
  }
  const double scale = copysign(fastest, radius) / most;
  for (integer w = 0; w < d->n_wheels; ++w) d->duty[w] *= scale;
  for (integer i = 0; i < d->n_servos; ++i) {
    const double *place = l->tack_places + 2 * l->servo_wheel[i], way = radius - place[1], sense = way >= 0.0 ? 1.0 : -1.0;
    d->servo_target[i] = atan2(sense * place[0], sense * way);
  }
}

/* Duties and steering of the tacking control, which goes on in tack_memory. */
static void tack(Drive *d, const Loop *l, const double *attitude) {
  const double t = l->begin + l->k * l->dt;
  double *side = l->tack_memory, *until = l->tack_memory + 1, folded = 0.0;
  for (integer i = 0; i < l->n_folding; ++i) folded = larger(folded, fabs(l->read[3 + 2 * d->n_wheels + i]));
  if (folded > l->tack_alert) {
    *until = t + l->tack_calm;
  } else if (0.0 < *until && *until < t) {
    *side = -*side;
    *until = -1.0;
  }
  const int uneven = t <= *until;
  const double asked = uneven ? *side * l->tack_heading : 0.0;
  const double bend = smaller(larger(l->tack_gain * (asked - attitude[2]), -l->tack_bend), l->tack_bend);
  const double delta = uneven || -attitude[1] > l->tack_alert ? l->tack_climb : l->tack_delta;
  if (fabs(bend) >= l->tack_straight) {
    turn_about(d, l, 1.0 / bend, delta);
    return;
  }
  for (integer w = 0; w < d->n_wheels; ++w) d->duty[w] = delta;
  for (integer i = 0; i < d->n_servos; ++i) d->servo_target[i] = 0.0;
}

/* Stop for good where the estimate says that the rover stands and digs. */
static void stop_stuck(Drive *d, const Loop *l) {
  double *stopped = l->stop_memory + 1, deepest = 0.0;
  for (integer w = 0; w < d->n_wheels; ++w) deepest = larger(deepest, hole_depth(l, w) / d->radius[w]);
  if (stops(l->stop_memory, *l->p_stands > l->stop_p, deepest, l->stop_law)) *stopped = 1.0;
  if (*stopped > 0.0) memset(d->duty, 0, d->n_wheels * sizeof(double));
}

static void command(Drive *d, Loop *l) {
  read_sensors(d, l);
  if (l->sense) estimate_slip(d, l);
  for (integer i = 0; i < d->n_servos; ++i) d->servo_target[i] = l->steer_fixed[i];
  if (l->tack_memory) tack(d, l, l->read);
  for (integer w = 0; w < d->n_wheels; ++w) {
    const double rate = l->read[3 + w], pitch = l->read[1];
    double duty = l->tack_memory ? d->duty[w] : l->duty_fixed[w];
    if (l->slip_law) duty = slip_control(d, l, w, pitch, rate);
    else duty = fmin(fmax(duty, -most_duty(l, w, pitch, rate, -1.0)), most_duty(l, w, pitch, rate, 1.0));
    d->duty[w] = fmin(1.0, fmax(-1.0, duty));
  }
  if (l->stop_memory) stop_stuck(d, l);
}
