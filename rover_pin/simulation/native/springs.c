/* Steering servos and end stops. */

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
