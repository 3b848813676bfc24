/* The patches of all wheels, pooled for the laws. */

static void add_spots(const Drive *d, Step *s);

static void add_spot(const Drive *d, Step *s, integer index, const Patch *patch, int airborne) {
  if (s->n_spots == MAX_SPOTS) add_spots(d, s);
  const Wheel *w = s->wheels + index;
  Spot *spot = s->spots + s->n_spots;
  spot->patch = *patch;
  spot->wheel = index;
  spot->airborne = airborne;
  const double *N = spot->patch.normal, r = d->radius[index];
  cross(w->axle, N, spot->t);
  unit(spot->t);
  cross(N, spot->t, spot->l);
  const double contact[N_GEOMETRY] = {patch->sinkage, dot(w->velocity, spot->t), dot(w->velocity, spot->l),
                                      -dot(w->velocity, N), r * w->spin, w->centre[0], (double)d->axle[index]};
  memcpy(spot->contact, contact, sizeof contact);
  spot->held = d->held + d->n_held * (d->kind[index] * d->n_soils + spot->patch.ground);
  ask_about(d, s, s->n_spots++);
}

static void clear_load(const Drive *d, WheelLoad *sum) {
  memset(sum, 0, offsetof(WheelLoad, gain));
  for (integer i = 0; i < d->n_contact_states; ++i) {
    sum->gain[i] = 0.0;
    for (int c = 0; c < 4; ++c) sum->gain_slope[i][c] = 0.0;
  }
  if (d->settling) memset(sum->spring, 0, sizeof sum->spring);
}

static void find_spots(const Drive *d, Step *s, integer index) {
  const Wheel *wheel = s->wheels + index;
  const Patch *patches = (const Patch *)d->patches;
  clear_load(d, s->loads + index);
  memset(d->record + index * N_RECORD, 0, RECORD_TORQUE * sizeof(double)); /* the motor's stay */
  integer touching = wheel_patches(d, wheel, index, d->record + index * N_RECORD + RECORD_SINKAGE);
  for (integer k = 0; k < touching; ++k) add_spot(d, s, index, patches + k, 0);
  if (touching || !d->n_contact_states) return;
  const Patch patch = {.sinkage = 1e-9, .n_t = 1.0, .normal = {wheel->up[0], wheel->up[1], wheel->up[2]}};
  add_spot(d, s, index, &patch, 1); /* in the air: the states go on, nothing pushes */
}
