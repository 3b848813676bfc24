/* The motors' torques. */

/* What all motors drew from the supply at the last step, a duty share of each winding's current. */
static double bus_current(const Drive *d) {
  double total = 0.0;
  for (integer w = 0; w < d->n_wheels; ++w) total += d->duty[w] * d->record[w * N_RECORD + RECORD_CURRENT];
  return total;
}

static void add_motor(const Drive *d, integer index, double bus, System *system, double step[][2]) {
  integer dof = d->wheel_dof[index], nx = d->n_motor_states;
  double input[4] = {d->duty[index], d->v[dof], (double)index, bus}, out[MAX_OUT], rate_by_state[MAX_STATES][MAX_STATES];
  const double *arguments[3] = {input, d->motor_states + index * nx, d->motor_parameters};
  double *results[1] = {out};
  d->motor_law(arguments, results, d->work_i, d->work_w, 0);
  const double *next = out; /* torque, d torque / d omega, current, supply, rate, its slope, torque by state, rate by state */
  double torque = *next++, slope = *next++;
  d->record[index * N_RECORD + RECORD_CURRENT] = *next++;
  d->record[index * N_RECORD + RECORD_SUPPLY] = *next++;
  for (integer i = 0; i < nx; ++i) step[i][0] = d->dt * *next++;
  for (integer i = 0; i < nx; ++i) step[i][1] = d->dt * *next++;
  const double *by_state = next;
  next += nx;
  for (integer j = 0; j < nx; ++j)
    for (integer i = 0; i < nx; ++i) rate_by_state[i][j] = *next++;
  implicit_states(0.5 * d->dt, nx, rate_by_state, &step[0][0], 2, 2);
  for (integer i = 0; i < nx; ++i) {
    torque += 0.5 * by_state[i] * step[i][0];
    slope += 0.5 * by_state[i] * step[i][1];
  }
  system->motor_torque[dof] = torque;
  system->motor_slope[dof] = slope;
}
