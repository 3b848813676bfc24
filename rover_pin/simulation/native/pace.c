/* Steps as fine as the forces need: twin of pace.py, which explains it. */

/* All that a step changes, into a place of its own, or back from there. */
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

static void change_size(Drive *d, Loop *l, integer size) {
  l->size = size;
  d->dt = size * (l->dt / FINEST);
}

/* Go back to where a step of this size began, to take it in quarters. */
static void take_again(Drive *d, Loop *l, integer slot, integer size) {
  restore(l, slot);
  l->before_size = 0;
  change_size(d, l, size / 4 > 1 ? size / 4 : 1);
}

/* Choose the size of the steps that follow by what the one before misjudged. */
static void keep(Drive *d, Loop *l, integer left) {
  if (d->misjudged > l->rough * ROUGH) {
    change_size(d, l, l->size / 4 > 1 ? l->size / 4 : 1);
  } else if (d->misjudged < l->rough * CALM && l->size < FINEST && left % (2 * l->size) == 0) {
    change_size(d, l, 2 * l->size);
  }
}

static void keep_now(const Drive *d, const Loop *l) {
  const integer n = d->n_wheels * N_RECORD;
  memcpy(l->now, d->record, n * sizeof(double));
  l->now[n] = *d->differential;
}

/* Let `now` be of this instant, by a step in which nothing moves; the slot is written over. */
static void look(Drive *d, Loop *l, integer slot) {
  const double dt = d->dt;
  const integer accounts = d->accounts;
  save(l, slot);
  d->dt = GLANCE;
  d->accounts = 0;
  rover_pin_step(d);
  keep_now(d, l);
  restore(l, slot);
  d->dt = dt;
  d->accounts = accounts;
  l->before_size = 0; /* its place may be taken */
}

/* Look at the end of the last step, which began in this slot: 1 if it is to be taken again. */
static int misjudged_at_end(Drive *d, Loop *l, integer slot, integer size) {
  look(d, l, 1 - slot);
  if (size == 1 || !(d->misjudged > l->rough * ROUGH)) return 0;
  take_again(d, l, slot, size);
  return 1;
}

/* Advance by dt, in parts where it takes them. `commanded`: the step before cannot be taken again; `looks`: nor can the
   last of these later, whose end is looked at. */
static int advance(Drive *d, Loop *l, int commanded, int looks) {
  if (commanded) l->before_size = 0;
  for (integer left = FINEST; left;) {
    const integer here = 1 - l->before, size = l->size;
    save(l, here);
    const int status = rover_pin_step(d);
    if (status && size == 1) return status;
    if (status || (d->growth > 0.0 && size > 1)) {
      take_again(d, l, here, size);
    } else if (d->misjudged > l->rough * ROUGH && l->before_size > 1) {
      left += l->before_size;
      take_again(d, l, l->before, l->before_size);
    } else {
      left -= size;
      keep(d, l, left);
      l->before = here;
      l->before_size = size;
      if (!left && looks && misjudged_at_end(d, l, here, size)) left = size;
    }
  }
  return OK;
}
