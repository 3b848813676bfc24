/* All other forces on the rover: motors (LANES wheels at a time), wheels held to a rate, steering servos, end stops,
   and the effects that push the body. */

/* Current of the supply at the last step [A]: the sum of duty times motor current, which a sagging
   supply feels. */
static double bus_current(const Drive *d) {
  double total = 0.0;
  for (integer w = 0; w < d->n_wheels; ++w) total += d->duty[w] * d->record[w * N_RECORD + RECORD_CURRENT];
  return total;
}

/* Read one wheel's answer of the motor law, whose numbers lie LANES apart: torque and its slope, current, supply
   voltage, then the states' rates and slopes. Half of the states' step acts on the mean torque, as in loads.c. */
static void add_motor(const Drive *d, integer index, const double *next, System *system, double step[][2]) {
  const integer dof = d->wheel_dof[index], nx = d->n_motor_states;
  double by_state[MAX_STATES], rate_by_state[MAX_STATES][MAX_STATES], *record = d->record + index * N_RECORD;
#define NEXT (next += LANES, next[-LANES])
  /* in the order of laws.py: then current, supply, rate, its slope, torque by state, rate by state */
  double torque = NEXT, slope = NEXT;
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

/* Hold the wheels to given rates at the step's end: (M + J) du = J (rate - v) with an inertia J so large that M
   hardly counts. */
static void hold_rates(const Drive *d, System *system) {
  for (integer w = 0; w < d->n_wheels; ++w) {
    const integer dof = d->wheel_dof[w];
    const double gain = d->hold_inertia[w] / (implicit_share(d) * d->dt);
    system->motor_torque[dof] = gain * (d->held_rate[w] - d->v[dof]);
    system->motor_slope[dof] = -gain;
  }
}

/* Record the torque that holding a wheel took over the step. */
static void record_held_torque(const Drive *d, const System *system) {
  for (integer w = 0; w < d->n_wheels; ++w) {
    const integer dof = d->wheel_dof[w];
    d->record[w * N_RECORD + RECORD_TORQUE] = system->motor_torque[dof] + system->motor_slope[dof] * system->mean_du[dof];
  }
}

/* Evaluate the motor law for all wheels. `bus`: current of the supply [A]. */
static void add_motors(const Drive *d, double bus, Step *s) {
  const integer nx = d->n_motor_states;
  for (integer first = 0; first < d->n_wheels; first += LANES) {
    /* Lanes without a wheel repeat the first of this group. */
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

/* Springs at the joints. */

/* Add steering servos and end stops: stiff, damped springs whose force is taken at the end of the step. */
static void add_springs(const Drive *d, System *system) {
  for (integer i = 0; i < d->n_servos; ++i) { /* a servo is a spring between the joint and its target */
    integer dof = d->servo_dof[i];
    double error = d->q[d->servo_q[i]] + 0.5 * d->dt * d->v[dof] - d->servo_target[i];
    system->other_Q[dof] = -d->servo_gain[0] * error - d->servo_gain[1] * d->v[dof];
    system->other_slope[dof] = -0.5 * d->servo_gain[0] * d->dt - d->servo_gain[1];
  }
  for (integer i = 0; i < d->n_stops; ++i) {
    integer dof = d->stop_dof[i];
    /* An end stop acts only on the part of the angle beyond its limits. */
    double angle = d->q[d->stop_q[i]], over = 0.0;
    if (angle > d->stop_limits[2 * i + 1]) over = angle - d->stop_limits[2 * i + 1];
    if (angle < d->stop_limits[2 * i]) over = angle - d->stop_limits[2 * i];
    if (over == 0.0) continue;
    /* Spring and damper at the end of the step: the excess there is over + dt/2 v. */
    double push = -d->stop_gain[0] * (over + 0.5 * d->dt * d->v[dof]) - d->stop_gain[1] * d->v[dof];
    if (push * over > 0.0) continue; /* the joint leaves faster than the damper lets it: a stop does not pull */
    system->other_Q[dof] = push;
    system->other_slope[dof] = -0.5 * d->stop_gain[0] * d->dt - d->stop_gain[1];
  }
}

/* Effects that push the body. */

/* Evaluate the body law: inputs as compiled/body_law.py lists them, outputs Q, D, the differential's torque and its
   slopes. */
static void push_body(const Drive *d, BodyPush *push) {
  const integer n = d->n_body, joints = n - 6;
  double input[14 + 2 * MAX_DOF], out[MAX_DOF * (MAX_DOF + 2) + 1], *next = input;
  /* Inputs: q and v of the base, angles and rates of the suspension, half the time step. */
  memcpy(next, d->q, 7 * sizeof(double));
  memcpy(next + 7, d->v, 6 * sizeof(double));
  next += 13;
  for (integer i = 0; i < joints; ++i) *next++ = d->q[d->body_q[i]];
  for (integer i = 0; i < joints; ++i) *next++ = d->v[d->body_dof[6 + i]];
  *next = 0.5 * d->dt;
  const double *arguments[3] = {input, 0, d->body_parameters};
  double *results[1] = {out};
  d->body_law(arguments, results, d->work_i, d->work_w, 0);
  memcpy(push->Q, out, n * sizeof(double));
  memcpy(push->D, out + n, n * n * sizeof(double));
  push->torque = out[n + n * n];
  memcpy(push->torque_slope, out + n + n * n + 1, n * sizeof(double));
}

/* Component i of the push at the end of the step. */
static double body_force(const Drive *d, const BodyPush *push, integer i) {
  double force = push->Q[i];
  for (integer j = 0; j < d->n_body; ++j) force += push->D[i + j * d->n_body] * d->du[d->body_dof[j]];
  return force;
}
