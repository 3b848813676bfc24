/* Control of the step size: twin of stepping/pace.py, which explains it. */

/* Save all arrays that a step changes into slot 0 or 1, or restore them from there. */
static void save(const Loop *l, integer slot) {
  double *to = l->saved + slot * l->moving_size;
  for (integer i = 0; i < l->n_moving; to += l->moving_sizes[i++])
    memcpy(to, l->moving[i], l->moving_sizes[i] * sizeof(double));
}

static void restore(const Loop *l, integer slot) {
  const double *from = l->saved + slot * l->moving_size;
  for (integer i = 0; i < l->n_moving; from += l->moving_sizes[i++])
    memcpy(l->moving[i], from, l->moving_sizes[i] * sizeof(double));
}

/* Set the step size, in FINEST parts of dt. */
static void change_size(Drive *d, Loop *l, integer size) {
  l->size = size;
  d->dt = size * (l->dt / FINEST);
}

/* Return to the beginning of a step of this size, and go on with a quarter of it. */
static void retry_in_quarters(Drive *d, Loop *l, integer slot, integer size) {
  restore(l, slot);
  l->before_size = 0;
  change_size(d, l, size / 4 > 1 ? size / 4 : 1);
}

/* Choose the size of the next step by the forecast error of the last: a quarter above ROUGH, twice the size below
   CALM. `left` parts of dt remain; a larger step must fit into them. */
static void choose_size(Drive *d, Loop *l, integer left) {
  if (d->misjudged > l->rough * ROUGH) {
    change_size(d, l, l->size / 4 > 1 ? l->size / 4 : 1);
  } else if (d->misjudged < l->rough * CALM && l->size < FINEST && left % (2 * l->size) == 0) {
    change_size(d, l, 2 * l->size);
  }
}

/* Copy the wheels' record and the differential's torque to `now`, for rows and controllers. */
static void copy_to_now(const Drive *d, const Loop *l) {
  const integer n = d->n_wheels * N_RECORD;
  memcpy(l->now, d->record, n * sizeof(double));
  l->now[n] = *d->differential;
}

/* Evaluate the forces at this instant for `now`: a step of GLANCE seconds, in which nothing moves, after which all
   is restored. A normal step records the forces at its beginning, so that the record would be one step old. The slot
   is overwritten. */
static void look(Drive *d, Loop *l, integer slot) {
  const double dt = d->dt;
  const integer accounts = d->accounts;
  save(l, slot);
  d->dt = GLANCE;
  d->accounts = 0;
  rover_pin_step(d);
  copy_to_now(d, l);
  restore(l, slot);
  d->dt = dt;
  d->accounts = accounts;
  l->before_size = 0; /* the step before may have been saved in this slot */
}

/* Evaluate the forces at the end of the last step, which began in this slot. Where its forecast error is too large,
   return to its beginning and return 1. */
static int misjudged_at_end(Drive *d, Loop *l, integer slot, integer size) {
  look(d, l, 1 - slot);
  if (size == 1 || !(d->misjudged > l->rough * ROUGH)) return 0;
  retry_in_quarters(d, l, slot, size);
  return 1;
}

/* Advance by dt, in parts where the forces need them. `commanded`: the motors' commands have changed since the step
   before, which therefore cannot be taken again. `looks`: the commands change after this dt, so that the end of its
   last part is evaluated now. Return OK, or the status of a step of the smallest size that fails. */
static int advance(Drive *d, Loop *l, int commanded, int looks) {
  if (commanded) l->before_size = 0;
  for (integer left = FINEST; left;) {
    const integer here = 1 - l->before, size = l->size;
    save(l, here);
    const int status = rover_pin_step(d);
    if (status && size == 1) return status;
    /* Three cases: this step failed or enlarged a speed without bound: take it again. The step before misjudged the
       forces that this one began with: take that again. Else this step stands. */
    if (status || (d->growth > 0.0 && size > 1)) {
      retry_in_quarters(d, l, here, size);
    } else if (d->misjudged > l->rough * ROUGH && l->before_size > 1) {
      left += l->before_size;
      retry_in_quarters(d, l, l->before, l->before_size);
    } else {
      left -= size;
      choose_size(d, l, left);
      l->before = here;
      l->before_size = size;
      if (!left && looks && misjudged_at_end(d, l, here, size)) left = size;
    }
  }
  return OK;
}
