/* The part of a wheel's contact arc that belongs to each facet. */

typedef struct { /* between two facets */
  double ahead;  /* how far the centre is ahead of the bisector */
  double edge;   /* where the rim crosses it */
  double half;   /* half the turn of the normals there */
} Corner;

static Corner corner_between(const Facet *behind, const Facet *ahead, double r) {
  double m_s = behind->n_s + ahead->n_s, m_t = behind->n_t + ahead->n_t, scale = 1.0 / sqrt(m_s * m_s + m_t * m_t);
  double f_s = m_t * scale, f_t = -m_s * scale; /* across the bisector, forwards */
  Corner corner = {-(ahead->s * f_s + ahead->t * f_t), 0.0, 0.0};
  if (fabs(corner.ahead) >= r) return corner;
  corner.edge = asin(-corner.ahead / r);
  corner.half = asin(smaller(1.0, larger(-1.0, ahead->n_s * f_s + ahead->n_t * f_t)));
  return corner;
}

/* Clip [*low, *high] to where the rim is ahead of the bisector (side +1) or behind it (side -1). */
static int clip_at(const Corner *corner, double r, double side, double *low, double *high) {
  if (side * corner->ahead >= r) return 1;
  if (side * corner->ahead <= -r) return 0;
  double turn = side > 0 ? PI : -PI, half = side * corner->half;
  *low = larger(*low, smaller(corner->edge, turn - corner->edge) + half);
  *high = smaller(*high, larger(corner->edge, turn - corner->edge) + half);
  return *low < *high;
}

/* What share of a facet's plane lies between the angles low and high; the integrand is even. */
static void share_out(double low, double high, const Arc *arc, double h, double radius, double n, Patch *patch) {
  double of[N_ENDS][2], *half = of[0], *lower = of[1], *upper = of[2], whole[2];
  const double ends[N_ENDS] = {0.0, smaller(fabs(low), arc->theta), smaller(fabs(high), arc->theta)};
  depth_integrals(ends, arc, n, of);
  memcpy(whole, half, sizeof whole);
  if (patch->sinkage < h) {
    const Arc held = arc_of(patch->sinkage, radius);
    const double from_0[N_ENDS] = {0.0, held.theta, held.theta};
    double sunk[N_ENDS][2];
    depth_integrals(from_0, &held, n, sunk);
    memcpy(whole, sunk[0], sizeof whole);
  }
  for (int i = 0; i < 2; ++i) {
    if (low < 0.0) lower[i] = 2.0 * half[i] - lower[i];
    if (high < 0.0) upper[i] = 2.0 * half[i] - upper[i];
  }
  patch->share = 0.5 * (lower[0] - upper[0]) / whole[0];
  patch->turn = 0.5 * (lower[1] - upper[1]) / whole[1];
  double from = larger(cos(low) - arc->cosine, 0.0), to = larger(cos(high) - arc->cosine, 0.0);
  patch->tilt = 0.5 * (from * power(from, n) - to * power(to, n)) / ((n + 1.0) * whole[0]);
}

/* How deep the rim would be under the line of a facet, with no end; not positive where it does not touch. */
static double depth_under(const Facet *f, double radius) {
  double reaches = larger(f[1].s, f->s) >= -radius && smaller(f[1].s, f->s) <= radius;
  return reaches ? smaller(radius + f->s * f->n_s + f->t * f->n_t, 1.999 * radius) : 0.0;
}

/* The part between the corners to a facet's neighbours, null at the ends. Parts of one plane share the plane's sinkage,
   and their shares add up to 1. Returns the greatest depth within the part, below 0 where there is none. */
static double find_patch(const Facet *f, const Corner *behind, const Corner *ahead, double h, double radius, double n, Patch *patch) {
  const Arc arc = arc_of(h, radius);
  double low = -arc.theta, high = arc.theta;
  if (behind && !clip_at(behind, radius, 1.0, &low, &high)) return -1.0;
  if (ahead && !clip_at(ahead, radius, -1.0, &low, &high)) return -1.0;
  double deepest = (low > 0.0 ? cos(low) : high < 0.0 ? cos(high) : 1.0) - arc.cosine;
  *patch = (Patch){.sinkage = smaller(h, DEEPEST * radius), .share = 1.0, .turn = 1.0, .n_s = f->n_s, .n_t = f->n_t, .ground = f->ground};
  memcpy(patch->normal, f->normal, sizeof patch->normal);
  if (low > -arc.theta || high < arc.theta) {
    if (deepest <= 1e-12) return -1.0;
    share_out(low, high, &arc, h, radius, n, patch);
  }
  return radius * deepest;
}

static void face_up(Facet *facets, integer n) {
  for (integer k = 0; k < n; ++k) {
    double ds = facets[k + 1].s - facets[k].s, dt = facets[k + 1].t - facets[k].t;
    double scale = 1.0 / sqrt(ds * ds + dt * dt);
    facets[k].n_s = -dt * scale;
    facets[k].n_t = ds * scale;
  }
}

/* The patches of one strip of a wheel's width, which has this share of it; *sinkage grows by its greatest depth. */
static integer strip_patches(const Drive *d, integer n, double radius, double share, double slope, Patch *out, double *sinkage) {
  Facet *facets = (Facet *)d->facets;
  double deepest = 0.0;
  integer found = 0, known = 0; /* known: the corner ahead of the facet before, where that was wanted */
  Corner behind, ahead;
  face_up(facets, n);
  for (integer k = 0; k < n; ++k) {
    double h = depth_under(facets + k, radius);
    if (h <= 0.0) { known = 0; continue; }
    if (known) behind = ahead; else if (k > 0) behind = corner_between(facets + k - 1, facets + k, radius);
    if (k < n - 1) ahead = corner_between(facets + k, facets + k + 1, radius);
    known = 1;
    double n_soil = d->soils[N_SOIL * facets[k].ground + SOIL_N];
    Patch *patch = out + found;
    double depth = find_patch(facets + k, k > 0 ? &behind : 0, k < n - 1 ? &ahead : 0, h, radius, n_soil, patch);
    if (depth < 0.0) continue;
    ++found;
    deepest = larger(deepest, depth);
    patch->side = -slope * patch->share * patch->sinkage / (n_soil + 1.5);
    patch->share *= share;
    patch->tilt *= share;
    patch->turn *= share;
  }
  *sinkage += share * deepest;
  return found;
}

/* All patches of a wheel, into d->patches, and its sinkage: the greatest depth, its mean over the width. */
static integer wheel_patches(const Drive *d, const Wheel *w, integer index, double *sinkage) {
  const double radius = d->radius[index], width = d->kinds[N_WHEEL * d->kind[index] + WHEEL_B];
  Facet *facets = (Facet *)d->facets;
  Patch *out = (Patch *)d->patches;
  integer found = 0;
  *sinkage = 0.0;
  if (!d->n_lanes) return strip_patches(d, cut_grid(d, w, radius, facets), radius, 1.0, 0.0, out, sinkage);
  for (integer lane = 0; lane < d->n_lanes; ++lane) {
    double slope, share = lane_share(d, w, lane, radius, width, &slope);
    if (share > 0.0)
      found += strip_patches(d, cut_lane(d, w, lane, radius, facets), radius, share, slope, out + found, sinkage);
  }
  return found;
}

/* For tests: the patches of a wheel in this frame (centre, axle, forward, up) go to d->patches. */
integer rover_pin_patches(const Drive *d, integer index, const double *frame, double *sinkage) {
  Wheel wheel;
  double *parts[4] = {wheel.centre, wheel.axle, wheel.forward, wheel.up};
  for (int i = 0; i < 4; ++i) memcpy(parts[i], frame + 3 * i, 3 * sizeof(double));
  return wheel_patches(d, &wheel, index, sinkage);
}
