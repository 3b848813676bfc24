/* One step of the drive: wheel-terrain patches, their loads, and a linearly implicit solve of Eq (8).
   The rigid body is a function generated from Pinocchio's model, the laws are functions generated from the effects.
   Twin of plain.py, which is slower, explains the scheme, and is the reference. */

/* Work out what the contact law holds; again after every change of the soils. */
void rover_pin_hold(const Drive *d) {
  double constants[N_WHEEL + N_SOIL], *row = d->held;
  const double *arguments[2] = {constants, d->contact_parameters};
  for (integer kind = 0; kind < d->n_kinds; ++kind)
    for (integer soil = 0; soil < d->n_soils; ++soil, row += d->n_held) {
      memcpy(constants, d->kinds + N_WHEEL * kind, N_WHEEL * sizeof(double));
      memcpy(constants + N_WHEEL, d->soils + N_SOIL * soil, N_SOIL * sizeof(double));
      double *results[1] = {row};
      d->contact_before(arguments, results, d->work_i, d->work_w, 0);
    }
}

/* For the caller to check that its mirror of the struct is this one. */
integer rover_pin_size(void) { return (integer)sizeof(Drive); }

/* Half a step of the configuration, the speeds by the forces there, the other half. */
int rover_pin_step(Drive *d) {
  System system;
  BodyPush push;
  Wheel wheels[MAX_DOF];
  WheelUpdate updates[MAX_DOF];
  double motor_steps[MAX_DOF][MAX_STATES][2];
  integer nv = d->nv, nx = d->n_contact_states;
  drift(d);
  move_body(d);
  for (integer i = 0; i < nv; ++i) memset(system.soil_D[i], 0, nv * sizeof(double));
  memset(system.soil_Q, 0, sizeof(System) - offsetof(System, soil_Q));
  d->misjudged = 0.0;
  const double bus = bus_current(d), share_of_end = implicit_share(d);
  for (integer w = 0; w < d->n_wheels; ++w) {
    add_wheel(d, w, &wheels[w], &system, &updates[w]);
    d->misjudged = fmax(d->misjudged, misjudged(d, w, &updates[w]));
    add_motor(d, w, bus, &system, motor_steps[w]);
    d->record[w * N_RECORD + RECORD_TORQUE] = system.motor_torque[d->wheel_dof[w]];
  }
  add_springs(d, &system);
  if (d->n_body) push_body(d, &push);
  int status = solve_speeds(d, &system, &push);
  if (status != OK) return status;
  account(d, &system, &push);
  *d->differential = differential_torque(d, &system, &push);
  for (integer w = 0; w < d->n_wheels; ++w) {
    foresee(d, w, &wheels[w], &updates[w]);
    for (integer i = 0; i < nx; ++i) {
      double change = updates[w].gain[i];
      for (integer j = 0; j < d->col_count[w]; ++j) change += share_of_end * updates[w].by_col[i][j] * d->du[d->cols[w * d->n_cols + j]];
      d->contact_states[w * nx + i] += change;
    }
    for (integer i = 0; i < d->n_motor_states; ++i)
      d->motor_states[w * d->n_motor_states + i] += motor_steps[w][i][0] + 0.5 * motor_steps[w][i][1] * d->du[d->wheel_dof[w]];
  }
  double total = 0.0;
  for (integer i = 0; i < nv; ++i) {
    d->v[i] += d->du[i];
    total += d->v[i];
  }
  if (!isfinite(total)) return NOT_FINITE;
  if (d->symmetric) mirror_speeds(d);
  drift(d);
  return OK;
}
