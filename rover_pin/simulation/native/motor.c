/* The motors' torques, LANES wheels at a time. */

/* What all motors drew from the supply at the last step, a duty share of each winding's current. */
static double bus_current(const Drive *d) {
  double total = 0.0;
  for (integer w = 0; w < d->n_wheels; ++w) total += d->duty[w] * d->record[w * N_RECORD + RECORD_CURRENT];
  return total;
}

/* One wheel's part of the law's column, whose numbers are LANES apart. */
static void add_motor(const Drive *d, integer index, const double *next, System *system, double step[][2]) {
  const integer dof = d->wheel_dof[index], nx = d->n_motor_states;
  double by_state[MAX_STATES], rate_by_state[MAX_STATES][MAX_STATES], *record = d->record + index * N_RECORD;
#define NEXT (next += LANES, next[-LANES])
  double torque = NEXT, slope = NEXT; /* then current, supply, rate, its slope, torque by state, rate by state */
  record[RECORD_CURRENT] = NEXT;
  record[RECORD_SUPPLY] = NEXT;
  for (integer i = 0; i < nx; ++i) step[i][0] = d->dt * NEXT;
  for (integer i = 0; i < nx; ++i) step[i][1] = d->dt * NEXT;
  for (integer i = 0; i < nx; ++i) by_state[i] = NEXT;
  for (integer j = 0; j < nx; ++j)
    for (integer i = 0; i < nx; ++i) rate_by_state[i][j] = NEXT;
#undef NEXT
  implicit_states(0.5 * d->dt, nx, rate_by_state, &step[0][0], 2, 2);
  for (integer i = 0; i < nx; ++i) {
    torque += 0.5 * by_state[i] * step[i][0];
    slope += 0.5 * by_state[i] * step[i][1];
  }
  record[RECORD_TORQUE] = system->motor_torque[dof] = torque;
  system->motor_slope[dof] = slope;
}

/* Wheels held to a rate at the step's end: (M + J) du = J (rate - v), J so large that M hardly counts. */
static void hold_rates(const Drive *d, System *system) {
  for (integer w = 0; w < d->n_wheels; ++w) {
    const integer dof = d->wheel_dof[w];
    const double gain = d->hold_inertia[w] / (implicit_share(d) * d->dt);
    system->motor_torque[dof] = gain * (d->held_rate[w] - d->v[dof]);
    system->motor_slope[dof] = -gain;
  }
}

/* The torque that it took. */
static void end_held(const Drive *d, const System *system) {
  for (integer w = 0; w < d->n_wheels; ++w) {
    const integer dof = d->wheel_dof[w];
    d->record[w * N_RECORD + RECORD_TORQUE] = system->motor_torque[dof] + system->motor_slope[dof] * system->mean_du[dof];
  }
}

static void add_motors(const Drive *d, double bus, Step *s) {
  const integer nx = d->n_motor_states;
  for (integer first = 0; first < d->n_wheels; first += LANES) {
    _Alignas(64) double input[4 * LANES], states[(MAX_STATES + 1) * LANES], out[MAX_MOTOR_OUT * LANES];
    for (integer lane = 0; lane < LANES; ++lane) {
      const integer w = first + lane < d->n_wheels ? first + lane : first;
      const double own[4] = {d->duty[w], d->v[d->wheel_dof[w]], (double)w, bus};
      for (int i = 0; i < 4; ++i) input[i * LANES + lane] = own[i];
      for (integer i = 0; i < nx; ++i) states[i * LANES + lane] = d->motor_states[w * nx + i];
    }
    d->motor_law(input, states, d->motor_parameters, out);
    for (integer lane = 0; lane < LANES && first + lane < d->n_wheels; ++lane)
      add_motor(d, first + lane, out + lane, &s->system, s->motor_steps[first + lane]);
  }
}
