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

/* Advance by dt, in parts where it takes them; `commanded`: the step before cannot be taken again. */
static int advance(Drive *d, Loop *l, int commanded) {
  if (commanded) l->before_size = 0;
  for (integer left = FINEST; left;) {
    const integer here = 1 - l->before, size = l->size;
    save(l, here);
    const int status = rover_pin_step(d);
    if (status && size == 1) return status;
    if (status) {
      take_again(d, l, here, size);
    } else if (d->misjudged > l->rough * ROUGH && l->before_size > 1) {
      left += l->before_size;
      take_again(d, l, l->before, l->before_size);
    } else {
      left -= size;
      keep(d, l, left);
      l->before = here;
      l->before_size = size;
    }
  }
  return OK;
}
