/* The patches of all wheels, pooled for the laws. */

static void add_spots(const Drive *d, Step *s);

static void add_spot(const Drive *d, Step *s, integer index, const Patch *patch, int airborne) {
  if (s->n_spots == MAX_SPOTS) add_spots(d, s);
  const Wheel *w = s->wheels + index;
  Spot *spot = s->spots + s->n_spots;
  spot->patch = *patch;
  spot->facet = *patch->facet;
  spot->wheel = index;
  spot->airborne = airborne;
  const double *N = spot->facet.normal, r = d->radius[index];
  cross(w->axle, N, spot->t);
  unit(spot->t);
  cross(N, spot->t, spot->l);
  const double contact[N_GEOMETRY] = {patch->sinkage, dot(w->velocity, spot->t), dot(w->velocity, spot->l),
                                      -dot(w->velocity, N), r * w->spin, w->centre[0], (double)d->axle[index]};
  memcpy(spot->contact, contact, sizeof contact);
  spot->held = d->held + d->n_held * (d->kind[index] * d->n_soils + spot->facet.ground);
  ask_about(d, s, s->n_spots++);
}

/* Add the patches of one strip of a wheel's width, which has this share of it; return how many touch. */
static integer add_strip(const Drive *d, Step *s, integer index, const Facet *facets, integer n, double share, double slope) {
  double radius = d->radius[index], deepest = 0.0;
  integer touching = 0;
  for (integer k = 0; k < n; ++k) {
    Patch patch;
    double n_soil = d->soils[N_SOIL * facets[k].ground + SOIL_N];
    if (!find_patch(facets, n, k, radius, n_soil, &patch)) continue;
    ++touching;
    deepest = fmax(deepest, patch.depth);
    patch.side = -slope * patch.share * patch.sinkage / (n_soil + 1.5);
    patch.share *= share;
    patch.tilt *= share;
    patch.turn *= share;
    add_spot(d, s, index, &patch, 0);
  }
  d->record[index * N_RECORD + RECORD_SINKAGE] += share * deepest;
  return touching;
}

static void find_spots(const Drive *d, Step *s, integer index) {
  Facet facets[MAX_FACETS + 1];
  const Wheel *wheel = s->wheels + index;
  double radius = d->radius[index];
  memset(s->loads + index, 0, sizeof(WheelLoad));
  memset(d->record + index * N_RECORD, 0, RECORD_TORQUE * sizeof(double)); /* the motor's stay */
  integer touching = d->n_lanes ? 0 : add_strip(d, s, index, facets, cut_grid(d, wheel, radius, facets), 1.0, 0.0);
  for (integer lane = 0; lane < d->n_lanes; ++lane) {
    double slope, share = lane_share(d, wheel, lane, radius, d->kinds[N_WHEEL * d->kind[index] + WHEEL_B], &slope);
    if (share > 0.0) touching += add_strip(d, s, index, facets, cut_lane(d, wheel, lane, radius, facets), share, slope);
  }
  if (touching || !d->n_contact_states) return;
  const Facet below = {0, -radius, 0, 1, {wheel->up[0], wheel->up[1], wheel->up[2]}, 0};
  const Patch patch = {1e-9, 0.0, 0.0, 0.0, 0.0, 0.0, &below};
  add_spot(d, s, index, &patch, 1); /* in the air: the states go on, nothing pushes */
}
