/* A rover on its ground as a Unit for fmi3.c: a step is one control period of the compiled simulation. */

/* Copy the readings at the end of the step to the outputs of the unit. */
static void read_out(Unit *u) {
  rover_pin_row(&u->drive, &u->loop, u->loop.log);
  for (int i = 0; i < N_OUT; ++i) u->values[FIRST_OUT + i] = u->loop.log[ROW_PLACES[i]];
}

/* Set the rover down: the memory that `plant.py` has written, and the constants of the soil computed from it. */
static void unit_begin(Unit *u) {
  unit_fill(u);
  unit_bind(u);
  rover_pin_hold(&u->drive);
  read_out(u);
}

/* Simulate one control period. Return the reason if the drive has ended, else 0. */
static const char *unit_step(Unit *u) {
  Drive *d = &u->drive;
  memcpy(d->duty, u->values + FIRST_DUTY, d->n_wheels * sizeof(double));
  memcpy(d->servo_target, u->values + FIRST_STEER, d->n_servos * sizeof(double));
  /* Constants of the contact law depend on the soil; they are computed again if a soil parameter has changed. */
  if (memcmp(d->soils, u->values + FIRST_SOIL, N_SOIL * sizeof(double))) {
    memcpy(d->soils, u->values + FIRST_SOIL, N_SOIL * sizeof(double));
    rover_pin_hold(d);
  }
  u->loop.row = 0;
  const int status = rover_pin_run(d, &u->loop, 1);
  read_out(u);
  if (status == FAILS) return "the rover has capsized, is buried, or its suspension has folded";
  return status ? "the drive has diverged" : 0;
}
