/* The built-in controllers, sampled within the loop: twins of the classes in control/, which explain them. */

/* Write the sensor readings of this sample: attitude (3), then rates and currents of the wheels, then angles of the
   suspension. Noise and quantisation are added where sensors have them. */
static void read_sensors(Drive *d, Loop *l) {
  observe(d, l);
  const integer n = d->n_wheels, sizes[4] = {3, n, n, l->n_folding};
  /* One row of noise for each sample, in the order of the readings. */
  const double *noise = l->noise ? l->noise + l->noise_row++ * (3 + 2 * n + l->n_folding) : 0;
  double *read = l->read;
  find_attitude(d->q, read);
  for (integer w = 0; w < n; ++w) {
    read[3 + w] = d->v[d->wheel_dof[w]];
    read[3 + n + w] = l->now[w * N_RECORD + RECORD_CURRENT];
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

/* Pass the sample to the on-board slip estimate: roll and pitch, suspension, rates, currents. The sign of the
   largest duty tells it whether the rover drives backwards. */
static void estimate_slip(const Drive *d, const Loop *l) {
  const integer n = d->n_wheels, links = l->n_folding;
  double largest = d->duty[0];
  for (integer w = 1; w < n; ++w) largest = larger(largest, d->duty[w]);
  memcpy(l->sample, l->read, 2 * sizeof(double));
  memcpy(l->sample + 2, l->read + 3 + 2 * n, links * sizeof(double));
  memcpy(l->sample + 2 + links, l->read + 3, 2 * n * sizeof(double));
  l->sense(l->belief, l->sample, largest < l->backwards, NAN);
}

/* Upper estimate of the depth of a wheel's hole [m]: mean plus one standard deviation. */
static double hole_depth(const Loop *l, integer wheel) {
  const double *estimate = l->slips_and_holes + 4 * wheel;
  return estimate[2] + estimate[3];
}

/* v_hat of Eq (9): travel speed from the duty that is applied now [m/s]. */
static double speed_by_table(const Loop *l, double duty) {
  return signed_speed(duty, l->table_duty, l->table_speed, l->n_table);
}

/* Largest |duty| that the torque limit allows a wheel at this pitch, for driving forwards (sense 1) or backwards
   (-1). */
static double max_duty(const Loop *l, integer wheel, double pitch, double rate, double sense) {
  if (!l->limit_pitch) return 1.0;
  const double torque = between(pitch, l->limit_pitch, l->limit_torque + wheel * l->n_pitches, l->n_pitches);
  return duty_for(torque, l->stall_torque, sense * rate / l->no_load_rate);
}

/* Return the duty of the slip control for one wheel, and advance its integral and its memory of the hole's depth.
   The slip comes from the on-board estimate, from Eq (9), or from the simulator itself. */
static double slip_control(const Drive *d, Loop *l, integer wheel, double pitch, double rate) {
  const double *truth = l->now + wheel * N_RECORD;
  double travel = truth[RECORD_TRAVEL], slip = truth[RECORD_SLIP];
  if (l->sense) {
    slip = l->slips_and_holes[4 * wheel];
    travel = slip_travel(slip, l->rim_radius * rate);
    l->depth[wheel] = hole_depth(l, wheel);
  } else if (l->table_duty) {
    travel = speed_by_table(l, d->duty[wheel]);
    slip = slip_by_table(l->table_radius, rate, travel);
  }
  const double largest = max_duty(l, wheel, pitch, rate, 1.0);
  /* Inputs and outputs of `SlipLaw.law` in native/control.py. */
  const double seen[6] = {slip, l->integral[wheel], largest, rate, travel, l->depth[wheel]};
  const double *arguments[2] = {seen, l->gains};
  double out[3], *results[1] = {out};
  l->slip_law(arguments, results, d->work_i, d->work_w, 0);
  l->integral[wheel] += l->control_period * out[1];
  l->depth[wheel] += l->control_period * out[2];
  return out[0];
}

/* Evaluate a control law of the whole rover: duties and steering; its memory advances. The limits are the lowest and
   highest duty of each wheel under the torque limit. */
static void obey_law(Drive *d, const Loop *l) {
  const double place[3] = {l->begin + l->k * l->dt, d->q[0], d->q[1]};
  for (integer w = 0; w < d->n_wheels; ++w)
    for (int sense = 0; sense < 2; ++sense)
      l->law_limits[sense * d->n_wheels + w] = (2 * sense - 1) * max_duty(l, w, l->read[1], l->read[3 + w], 2 * sense - 1);
  const double *arguments[5] = {place, l->read, l->law_limits, l->law_memory, l->law_numbers};
  double *results[3] = {d->duty, d->servo_target, l->law_next};
  l->drive_law(arguments, results, d->work_i, l->law_w, 0);
  memcpy(l->law_memory, l->law_next, l->n_memory * sizeof(double));
}

/* Set all duties to zero for the rest of the drive once the estimate reports that the rover stands and digs. */
static void stop_stuck(Drive *d, const Loop *l) {
  double *stopped = l->stop_memory + 1, deepest = 0.0;
  for (integer w = 0; w < d->n_wheels; ++w) deepest = larger(deepest, hole_depth(l, w) / d->radius[w]);
  if (stops(l->stop_memory, *l->p_stands > l->stop_p, deepest, l->stop_law)) *stopped = 1.0;
  if (*stopped > 0.0) memset(d->duty, 0, d->n_wheels * sizeof(double));
}

/* Sample the built-in controller: readings, estimate, then the duty of each wheel from the law of the rover, the
   slip control, or the fixed duty under the torque limit. */
static void command(Drive *d, Loop *l) {
  read_sensors(d, l);
  if (l->sense) estimate_slip(d, l);
  for (integer i = 0; i < d->n_servos; ++i) d->servo_target[i] = l->steer_fixed[i];
  if (l->drive_law) obey_law(d, l);
  for (integer w = 0; w < d->n_wheels; ++w) {
    const double rate = l->read[3 + w], pitch = l->read[1];
    double duty = l->drive_law ? d->duty[w] : l->duty_fixed[w];
    if (l->slip_law) duty = slip_control(d, l, w, pitch, rate);
    else duty = fmin(fmax(duty, -max_duty(l, w, pitch, rate, -1.0)), max_duty(l, w, pitch, rate, 1.0));
    d->duty[w] = fmin(1.0, fmax(-1.0, duty));
  }
  if (l->stop_memory) stop_stuck(d, l);
}
