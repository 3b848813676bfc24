/* One step of the drive: patches between wheels and terrain, their loads, and a linearly implicit solve of Eq (8).
   The rigid body is a function generated from Pinocchio's model; the laws are functions generated from the effects.
   The twin in NumPy, plain/step.py, is slower, explains the scheme, and is the reference. */

/* Add the energies of this step to the drive's account: power at the mean speed v + du/2 times dt, with the forces
   that the solve used. The motors' work counts as given, all others as taken from the rover. */
static void account(const Drive *d, const Step *s) {
  const System *system = &s->system;
  double soil = 0, motor = 0, other = 0, servos = 0;
  for (integer i = 0; i < d->nv; ++i) {
    double speed = d->v[i] + 0.5 * d->du[i];
    motor += (system->motor_torque[i] + system->motor_slope[i] * system->mean_du[i]) * speed;
    other -= (system->other_Q[i] + system->other_slope[i] * d->du[i]) * speed;
  }
  /* Servos and end stops share one list of forces; the servos' part is counted by itself. */
  for (integer k = 0; k < d->n_servos; ++k) {
    integer i = d->servo_dof[k];
    servos -= (system->other_Q[i] + system->other_slope[i] * d->du[i]) * (d->v[i] + 0.5 * d->du[i]);
  }
  for (integer k = 0; k < d->n_body; ++k) {
    integer i = d->body_dof[k];
    d->energy[ENERGY_BODY] -= d->dt * body_force(d, &s->push, k) * (d->v[i] + 0.5 * d->du[i]);
  }
  for (integer w = 0; w < d->n_wheels; ++w) {
    const double *record = d->record + w * N_RECORD;
    soil -= soil_power(d, w, s->wheels + w, s->loads + w);
    for (int c = 0; c < 3; ++c) d->impulse[c] += d->dt * d->loads[6 * w + c];
    d->energy[ENERGY_ELECTRIC] += d->dt * record[RECORD_CURRENT] * record[RECORD_SUPPLY] * d->duty[w];
  }
  d->energy[ENERGY_MOTOR] += d->dt * motor;
  d->energy[ENERGY_SOIL] += d->dt * soil;
  d->energy[ENERGY_STOPS] += d->dt * (other - servos);
  d->energy[ENERGY_SERVOS] += d->dt * servos;
}

/* Torque of the differential on the left rocker [N m]: the constraint's where the differential is rigid, else that
   of the body effect in its place. */
static double differential_torque(const Drive *d, const System *system, const BodyPush *push) {
  if (d->differential_left >= 0) return system->differential;
  double torque = d->n_body ? push->torque : 0.0;
  for (integer j = 0; j < d->n_body; ++j) torque += push->torque_slope[j] * d->du[d->body_dof[j]];
  return torque;
}

/* Sizes that the caller needs: of the struct Drive, to check its own layout, and of the rooms that it allocates. */
void rover_pin_sizes(integer *sizes) {
  sizes[0] = sizeof(Drive);
  sizes[1] = sizeof(Step);
  sizes[2] = MAX_QUESTIONS;
  sizes[3] = LANES;
}

/* Set all generalised forces and their slopes to zero. */
static void clear_forces(const Drive *d, System *system) {
  for (integer i = 0; i < d->nv; ++i) {
    system->force[i] = system->motor_torque[i] = system->motor_slope[i] = 0.0;
    system->other_Q[i] = system->other_slope[i] = 0.0;
  }
}

/* Work out the soil's load on all wheels, add it to the equations, and note the worst forecast error. */
static void add_soil(Drive *d, Step *s) {
  const double implicit_dt = implicit_share(d) * d->dt;
  /* Motion of each wheel, and its patches; all patches together ask for their laws. */
  for (integer w = 0; w < d->n_wheels; ++w) {
    set_wheel(d, w, s->wheels + w);
    add_wheel_spots(d, s, w);
  }
  add_spots(d, s);
  /* Sum up each wheel's patches, and compare the load with the forecast of the step before. */
  d->misjudged = 0.0;
  for (integer w = 0; w < d->n_wheels; ++w) {
    finish_wheel(d, w, s->loads + w);
    d->misjudged = larger(d->misjudged, misjudged(d, w, s->loads + w));
    add_wheel(d, s->wheels + w, s->loads + w, implicit_dt, &s->system);
  }
}

/* Take the step of the motors' states. */
static void end_motors(const Drive *d, const Step *s) {
  const integer nx = d->n_motor_states;
  for (integer w = 0; w < d->n_wheels; ++w) {
    const double spin = s->system.mean_du[d->wheel_dof[w]];
    for (integer i = 0; i < nx; ++i)
      d->motor_states[w * nx + i] += s->motor_steps[w][i][0] + s->motor_steps[w][i][1] * spin;
  }
}

/* Add the change to the speeds. Return NOT_FINITE where a speed overflows or is NaN. */
static int add_speeds(const Drive *d) {
  double total = 0.0;
  for (integer i = 0; i < d->nv; ++i) {
    d->v[i] += d->du[i];
    total += d->v[i];
  }
  return isfinite(total) ? OK : NOT_FINITE;
}

/* Advance the drive by d->dt. The configuration moves by half a step at the old speeds, the forces there change the
   speeds, and the configuration moves by the other half at the new speeds: second order, time-symmetric in the
   configuration. Return OK, NOT_FINITE or SINGULAR; after an error the state is not to be used. */
int rover_pin_step(Drive *d) {
  Step *s = d->step;
  /* A sagging supply feels the currents of the step before: read them before they are overwritten. */
  const double bus = bus_current(d);
  drift(d);
  /* Rigid body: inertia with rotors. `mass` keeps it, A becomes the left side of the equations. */
  move_body(d);
  set_inertia(d, s->system.A);
  memcpy(s->system.mass, s->system.A, d->nv * sizeof s->system.A[0]);
  /* Forces and their slopes with the speeds: soil, motors (or wheels held to a rate), springs, body effects. */
  clear_forces(d, &s->system);
  add_soil(d, s);
  add_motors(d, bus, s);
  if (d->held_rate) hold_rates(d, &s->system);
  add_springs(d, &s->system);
  if (d->n_body) push_body(d, &s->push);
  /* Solve for the change of the speeds. */
  complete_system(d, &s->system, &s->push);
  int status = solve_speeds(d, &s->system);
  if (status != OK) return status;
  /* With du known: the wheels' states and expected loads, energies, the differential's torque, the motors' states. */
  for (integer w = 0; w < d->n_wheels; ++w) end_wheel(d, w, s->wheels + w, s->system.mean_du, s->loads + w);
  if (d->accounts) account(d, s);
  *d->differential = differential_torque(d, &s->system, &s->push);
  end_motors(d, s);
  if (d->held_rate) record_held_torque(d, &s->system);
  status = add_speeds(d);
  if (status != OK) return status;
  /* Second half of the configuration's step, at the new speeds. */
  if (d->symmetric) mirror_speeds(d);
  drift(d);
  if (d->history) d->history[(integer)++*d->history] = d->dt;
  return OK;
}
