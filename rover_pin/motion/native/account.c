/* Energies, and the differential's torque. */

static void account(const Drive *d, const System *system, const BodyPush *push) {
  double soil = 0, motor = 0, other = 0, servos = 0;
  for (integer i = 0; i < d->nv; ++i) {
    double speed = d->v[i] + 0.5 * d->du[i], force = system->soil_Q[i];
    for (integer j = 0; j < d->nv; ++j) force += 0.5 * system->soil_D[i][j] * d->du[j];
    soil -= force * speed;
    motor += (system->motor_torque[i] + 0.5 * system->motor_slope[i] * d->du[i]) * speed;
    other -= (system->other_Q[i] + system->other_slope[i] * d->du[i]) * speed;
  }
  for (integer k = 0; k < d->n_servos; ++k) {
    integer i = d->servo_dof[k];
    servos -= (system->other_Q[i] + system->other_slope[i] * d->du[i]) * (d->v[i] + 0.5 * d->du[i]);
  }
  for (integer k = 0; k < d->n_body; ++k) {
    integer i = d->body_dof[k];
    d->energy[ENERGY_BODY] -= d->dt * body_force(d, push, k) * (d->v[i] + 0.5 * d->du[i]);
  }
  d->energy[ENERGY_MOTOR] += d->dt * motor;
  d->energy[ENERGY_SOIL] += d->dt * soil;
  d->energy[ENERGY_STOPS] += d->dt * (other - servos);
  d->energy[ENERGY_SERVOS] += d->dt * servos;
  for (integer w = 0; w < d->n_wheels; ++w)
    for (int c = 0; c < 3; ++c) d->impulse[c] += d->dt * d->loads[6 * w + c];
  for (integer w = 0; w < d->n_wheels; ++w)
    d->energy[ENERGY_ELECTRIC] += d->dt * d->record[w * N_RECORD + RECORD_CURRENT] * d->record[w * N_RECORD + RECORD_SUPPLY] * d->duty[w];
}

/* The differential's torque on the left rocker: what Eq (8) lacks in its row, or what stands for it on the body. */
static double differential_torque(const Drive *d, const System *system, const BodyPush *push) {
  integer i = d->differential_left;
  if (i < 0) {
    double torque = d->n_body ? push->torque : 0.0;
    for (integer j = 0; j < d->n_body; ++j) torque += push->torque_slope[j] * d->du[d->body_dof[j]];
    return torque;
  }
  double torque = d->nle[i] - system->soil_Q[i] - system->other_Q[i] - system->other_slope[i] * d->du[i];
  for (integer j = 0; j < d->nv; ++j)
    torque += (d->M[i < j ? i * d->nv + j : j * d->nv + i] / d->dt - 0.5 * system->soil_D[i][j]) * d->du[j];
  for (integer k = 6; k < d->n_body; ++k) if (d->body_dof[k] == i) torque -= body_force(d, push, k);
  return torque;
}
