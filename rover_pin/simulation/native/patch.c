/* The patches of a wheel: the part of its contact arc that belongs to each facet, and the share of the load that
   this part carries. Angles theta are from a facet's normal, positive forwards. */

/* Gauss-Legendre nodes and weights on [0, 1]. */
#define N_GAUSS 10
static const double GAUSS_NODE[N_GAUSS] = {
    0.013046735741414128, 0.067468316655507732, 0.16029521585048778, 0.28330230293537639, 0.42556283050918442,
    0.57443716949081558, 0.71669769706462361, 0.83970478414951222, 0.93253168334449232, 0.98695326425858587};
static const double GAUSS_WEIGHT[N_GAUSS] = {
    0.033335672154344069, 0.074725674575290293, 0.10954318125799102, 0.13463335965499817, 0.14776211235737644,
    0.14776211235737644, 0.13463335965499817, 0.10954318125799102, 0.074725674575290293, 0.033335672154344069};

#define N_SERIES 10 /* terms of the series below */

/* Sine and cosine of x in [0, 1.6], exact to the last digit, as series: a loop over them runs in SIMD vectors. */
static inline void sine_cosine(double x, double *sine, double *cosine) {
  const double x_2 = x * x;
  double s = 1.0, c = 1.0;
  for (int k = N_SERIES; k >= 1; --k) {
    s = 1.0 - x_2 * s * (1.0 / ((2 * k) * (2 * k + 1)));
    c = 1.0 - x_2 * c * (1.0 / ((2 * k - 1) * (2 * k)));
  }
  *sine = x * s;
  *cosine = c;
}

/* x^n, without the call of pow for the usual exponent 1. */
static double power(double x, double n) { return n == 1.0 ? x : pow(x, n); }

/* the entry angle of a contact that reaches the depth h under a facet: cos(theta_0) = 1 - h / r, Fig 2 */
typedef struct { double theta, cosine, sine; } Arc;

/* The arc of a rim that reaches the depth h [m] under the facet's line. */
static Arc arc_of(double h, double radius) {
  const double depth = h / radius;
  return (Arc){acos(1.0 - depth), 1.0 - depth, sqrt(depth * (2.0 - depth))};
}

#define N_ENDS 3 /* integrals that are evaluated together */

/* Integrals over the arc of the depth to the power n, which is the normal stress but for a factor: int_theta^theta_0
   (cos t - cos theta_0)^n {cos t, 1} dt, for several lower ends theta in [0, theta_0]. The first weights the normal
   force, the second the torque. The integrand is singular at theta_0; nodes that crowd there as u^2 keep the
   quadrature exact. */
static void depth_integrals(const double theta[N_ENDS], const Arc *arc, double n, double out[N_ENDS][2]) {
  double back[N_ENDS * N_GAUSS], depth[N_ENDS * N_GAUSS];
  for (int k = 0; k < N_ENDS; ++k)
    for (int i = 0; i < N_GAUSS; ++i) back[k * N_GAUSS + i] = 0.5 * (arc->theta - theta[k]) * GAUSS_NODE[i] * GAUSS_NODE[i];
  for (int i = 0; i < N_ENDS * N_GAUSS; ++i) {
    double s, c;
    sine_cosine(back[i], &s, &c);
    /* cos(theta_0 - 2 back) - cos(theta_0) as a product, without cancellation */
    depth[i] = 2.0 * (arc->sine * c - arc->cosine * s) * s;
  }
  for (int k = 0; k < N_ENDS; ++k) {
    out[k][0] = out[k][1] = 0.0;
    for (int i = 0; i < N_GAUSS; ++i) {
      const double here = depth[k * N_GAUSS + i];
      const double part = GAUSS_WEIGHT[i] * 2.0 * (arc->theta - theta[k]) * GAUSS_NODE[i] * power(here, n);
      out[k][0] += part * (arc->cosine + here);
      out[k][1] += part;
    }
  }
}

/* Two facets meet at a corner. The rim on one side of the bisector belongs to the facet behind, the rim on the other
   side to the facet ahead. */

typedef struct { /* the corner between two facets, seen from the wheel's centre */
  double ahead;  /* distance of the centre ahead of the bisector [m] */
  double edge;   /* angle at which the rim crosses the bisector */
  double half;   /* half the angle between the facets' normals */
} Corner;

/* The corner between two facets of a wheel of radius r. */
static Corner corner_between(const Facet *behind, const Facet *ahead, double r) {
  double m_s = behind->n_s + ahead->n_s, m_t = behind->n_t + ahead->n_t, scale = 1.0 / sqrt(m_s * m_s + m_t * m_t);
  double f_s = m_t * scale, f_t = -m_s * scale; /* unit vector across the bisector, forwards */
  Corner corner = {-(ahead->s * f_s + ahead->t * f_t), 0.0, 0.0};
  if (fabs(corner.ahead) >= r) return corner;
  corner.edge = asin(-corner.ahead / r);
  corner.half = asin(smaller(1.0, larger(-1.0, ahead->n_s * f_s + ahead->n_t * f_t)));
  return corner;
}

/* Clip the arc [*low, *high] to the part of the rim ahead of the bisector (side +1) or behind it (side -1). Return 0
   where nothing remains. */
static int clip_at(const Corner *corner, double r, double side, double *low, double *high) {
  if (side * corner->ahead >= r) return 1;
  if (side * corner->ahead <= -r) return 0;
  double turn = side > 0 ? PI : -PI, half = side * corner->half;
  *low = larger(*low, smaller(corner->edge, turn - corner->edge) + half);
  *high = smaller(*high, larger(corner->edge, turn - corner->edge) + half);
  return *low < *high;
}

/* Write the shares of the facet's whole plane that the arc between the angles low and high carries. The integrands
   are even in theta, so that a negative end uses 2 int_0 - int_|end|. */
static void set_shares(double low, double high, const Arc *arc, double h, double radius, double n, Patch *patch) {
  double of[N_ENDS][2], *half = of[0], *lower = of[1], *upper = of[2], whole[2];
  const double ends[N_ENDS] = {0.0, smaller(fabs(low), arc->theta), smaller(fabs(high), arc->theta)};
  depth_integrals(ends, arc, n, of);
  memcpy(whole, half, sizeof whole);
  /* Beyond DEEPEST the law is evaluated at a smaller sinkage than h, so that the whole is that of the smaller arc. */
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
  /* The part of an arc pushes along its own mean normal, not the facet's: `tilt` is its component along the tangent. */
  double from = larger(cos(low) - arc->cosine, 0.0), to = larger(cos(high) - arc->cosine, 0.0);
  patch->tilt = 0.5 * (from * power(from, n) - to * power(to, n)) / ((n + 1.0) * whole[0]);
}

/* Depth of the rim under a facet's unbounded line [m]; not positive where the facet is out of reach or does not
   touch. */
static double depth_under(const Facet *f, double radius) {
  double reaches = larger(f[1].s, f->s) >= -radius && smaller(f[1].s, f->s) <= radius;
  return reaches ? smaller(radius + f->s * f->n_s + f->t * f->n_t, 1.999 * radius) : 0.0;
}

/* Write the patch of a facet between the corners to its neighbours (null at the ends). All patches of one plane have
   the plane's sinkage, and their shares add up to 1. Return the greatest depth within the patch [m], below 0 where
   there is none. */
static double find_patch(const Facet *f, const Corner *behind, const Corner *ahead, double h, double radius, double n,
                         Patch *patch) {
  const Arc arc = arc_of(h, radius);
  double low = -arc.theta, high = arc.theta;
  if (behind && !clip_at(behind, radius, 1.0, &low, &high)) return -1.0;
  if (ahead && !clip_at(ahead, radius, -1.0, &low, &high)) return -1.0;
  /* The deepest point of the arc is at the normal, or at the end that is nearer to it. */
  double deepest = (low > 0.0 ? cos(low) : high < 0.0 ? cos(high) : 1.0) - arc.cosine;
  *patch = (Patch){.sinkage = smaller(h, DEEPEST * radius), .share = 1.0, .turn = 1.0,
                   .n_s = f->n_s, .n_t = f->n_t, .ground = f->ground};
  memcpy(patch->normal, f->normal, sizeof patch->normal);
  /* A patch that is the whole arc keeps the shares 1, 0, 1. */
  if (low > -arc.theta || high < arc.theta) {
    if (deepest <= 1e-12) return -1.0;
    set_shares(low, high, &arc, h, radius, n, patch);
  }
  return radius * deepest;
}

/* Set the in-plane normals of facets from their end points. */
static void set_normals(Facet *facets, integer n) {
  for (integer k = 0; k < n; ++k) {
    double ds = facets[k + 1].s - facets[k].s, dt = facets[k + 1].t - facets[k].t;
    double scale = 1.0 / sqrt(ds * ds + dt * dt);
    facets[k].n_s = -dt * scale;
    facets[k].n_t = ds * scale;
  }
}

/* Write the patches of the n facets under one strip of the wheel's width, and return their number. `share`: load
   share of the strip, `slope`: its slope with y. *sinkage grows by the strip's greatest depth times the share. */
static integer strip_patches(const Drive *d, integer n, double radius, double share, double slope, Patch *out,
                             double *sinkage) {
  Facet *facets = (Facet *)d->facets;
  double deepest = 0.0;
  integer found = 0, known = 0; /* known: whether `ahead` is the corner between the facet before and this one */
  Corner behind, ahead;
  set_normals(facets, n);
  for (integer k = 0; k < n; ++k) {
    /* Facets that the rim does not reach have no patch. */
    double h = depth_under(facets + k, radius);
    if (h <= 0.0) { known = 0; continue; }
    /* The corner ahead of one facet is the corner behind the next. */
    if (known) behind = ahead; else if (k > 0) behind = corner_between(facets + k - 1, facets + k, radius);
    if (k < n - 1) ahead = corner_between(facets + k, facets + k + 1, radius);
    known = 1;
    double n_soil = d->soils[N_SOIL * facets[k].ground + SOIL_N];
    Patch *patch = out + found;
    double depth = find_patch(facets + k, k > 0 ? &behind : 0, k < n - 1 ? &ahead : 0, h, radius, n_soil, patch);
    if (depth < 0.0) continue;
    ++found;
    deepest = larger(deepest, depth);
    /* Moving a wheel sideways moves load to another strip. The normal force is the derivative of an energy f_n h /
       (n + 3/2), so this costs energy where the strips' depths differ, and pushes back. */
    patch->side = -slope * patch->share * patch->sinkage / (n_soil + 1.5);
    patch->share *= share;
    patch->tilt *= share;
    patch->turn *= share;
  }
  *sinkage += share * deepest;
  return found;
}

/* Write all patches of a wheel into d->patches and return their number. *sinkage: the greatest depth of each strip,
   averaged over the width [m]. */
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

/* For tests: write the patches of a wheel whose frame (centre, axle, forward, up) is given. */
integer rover_pin_patches(const Drive *d, integer index, const double *frame, double *sinkage) {
  Wheel wheel;
  double *parts[4] = {wheel.centre, wheel.axle, wheel.forward, wheel.up};
  for (int i = 0; i < 4; ++i) memcpy(parts[i], frame + 3 * i, 3 * sizeof(double));
  return wheel_patches(d, &wheel, index, sinkage);
}
