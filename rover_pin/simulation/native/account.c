/* Energies, and the differential's torque. */

static void account(const Drive *d, const Step *s) {
  const System *system = &s->system;
  double soil = 0, motor = 0, other = 0, servos = 0;
  for (integer i = 0; i < d->nv; ++i) {
    double speed = d->v[i] + 0.5 * d->du[i];
    motor += (system->motor_torque[i] + system->motor_slope[i] * system->mean_du[i]) * speed;
    other -= (system->other_Q[i] + system->other_slope[i] * d->du[i]) * speed;
  }
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

/* The differential's torque on the left rocker: what Eq (8) lacks in its row, or what stands for it on the body. */
static double differential_torque(const Drive *d, const System *system, const BodyPush *push) {
  if (d->differential_left >= 0) return system->differential;
  double torque = d->n_body ? push->torque : 0.0;
  for (integer j = 0; j < d->n_body; ++j) torque += push->torque_slope[j] * d->du[d->body_dof[j]];
  return torque;
}
