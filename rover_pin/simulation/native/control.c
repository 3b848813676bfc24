/* The built-in controllers, sampled in the loop: twins of control/'s classes, which say what they do and why. */

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
  const double travel = l->table_duty ? speed_by_table(l, d->duty[wheel]) : truth[RECORD_TRAVEL];
  const double slip = l->table_duty ? slip_by_table(l->table_radius, rate, travel) : truth[RECORD_SLIP];
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
  for (integer i = 0; i < l->n_folding; ++i) folded = larger(folded, fabs(d->q[l->folding_q[i]]));
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

static void command(Drive *d, Loop *l) {
  double attitude[3];
  find_attitude(d->q, attitude);
  for (integer i = 0; i < d->n_servos; ++i) d->servo_target[i] = l->steer_fixed[i];
  if (l->tack_memory) tack(d, l, attitude);
  for (integer w = 0; w < d->n_wheels; ++w) {
    const double rate = d->v[d->wheel_dof[w]], pitch = attitude[1];
    double duty = l->tack_memory ? d->duty[w] : l->duty_fixed[w];
    if (l->slip_law) duty = slip_control(d, l, w, pitch, rate);
    else duty = fmin(fmax(duty, -most_duty(l, w, pitch, rate, -1.0)), most_duty(l, w, pitch, rate, 1.0));
    d->duty[w] = fmin(1.0, fmax(-1.0, duty));
  }
}
