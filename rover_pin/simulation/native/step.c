/* One step of the drive: wheel-terrain patches, their loads, and a linearly implicit solve of Eq (8).
   The rigid body is a function generated from Pinocchio's model, the laws are functions generated from the effects.
   Twin of plain/step.py, which is slower, explains the scheme, and is the reference. */

/* For the caller to check that its mirror of the struct is this one, and to make room. */
void rover_pin_sizes(integer *sizes) {
  sizes[0] = sizeof(Drive);
  sizes[1] = sizeof(Step);
  sizes[2] = MAX_QUESTIONS;
  sizes[3] = LANES;
}

static void clear_forces(const Drive *d, System *system) {
  for (integer i = 0; i < d->nv; ++i) {
    system->force[i] = system->motor_torque[i] = system->motor_slope[i] = 0.0;
    system->other_Q[i] = system->other_slope[i] = 0.0;
  }
}

/* What the soil does to all wheels: their loads, and the equations' part of them. */
static void add_soil(Drive *d, Step *s) {
  const double implicit_dt = implicit_share(d) * d->dt;
  for (integer w = 0; w < d->n_wheels; ++w) {
    look_at_wheel(d, w, s->wheels + w);
    find_spots(d, s, w);
  }
  add_spots(d, s);
  d->misjudged = 0.0;
  for (integer w = 0; w < d->n_wheels; ++w) {
    finish_wheel(d, w, s->loads + w);
    d->misjudged = larger(d->misjudged, misjudged(d, w, s->loads + w));
    add_wheel(d, s->wheels + w, s->loads + w, implicit_dt, &s->system);
  }
}

static void end_motors(const Drive *d, const Step *s) {
  for (integer w = 0; w < d->n_wheels; ++w)
    for (integer i = 0; i < d->n_motor_states; ++i)
      d->motor_states[w * d->n_motor_states + i] += s->motor_steps[w][i][0] + s->motor_steps[w][i][1] * s->system.mean_du[d->wheel_dof[w]];
}

static int add_speeds(const Drive *d) {
  double total = 0.0;
  for (integer i = 0; i < d->nv; ++i) {
    d->v[i] += d->du[i];
    total += d->v[i];
  }
  return isfinite(total) ? OK : NOT_FINITE;
}

/* Half a step of the configuration, the speeds by the forces there, the other half. */
int rover_pin_step(Drive *d) {
  Step *s = d->step;
  const double bus = bus_current(d);
  drift(d);
  move_body(d);
  set_inertia(d, s->system.A);
  memcpy(s->system.mass, s->system.A, d->nv * sizeof s->system.A[0]);
  clear_forces(d, &s->system);
  add_soil(d, s);
  add_motors(d, bus, s);
  if (d->held_rate) hold_rates(d, &s->system);
  add_springs(d, &s->system);
  if (d->n_body) push_body(d, &s->push);
  complete_system(d, &s->system, &s->push);
  int status = solve_speeds(d, &s->system);
  if (status != OK) return status;
  for (integer w = 0; w < d->n_wheels; ++w) end_wheel(d, w, s->wheels + w, s->system.mean_du, s->loads + w);
  if (d->accounts) account(d, s);
  *d->differential = differential_torque(d, &s->system, &s->push);
  end_motors(d, s);
  if (d->held_rate) end_held(d, &s->system);
  status = add_speeds(d);
  if (status != OK) return status;
  if (d->symmetric) mirror_speeds(d);
  drift(d);
  if (d->history) d->history[(integer)++*d->history] = d->dt;
  return OK;
}
