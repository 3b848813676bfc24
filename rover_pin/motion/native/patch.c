/* The part of a wheel's contact arc that belongs to each facet. */

/* Clip [*low, *high] to where a + r sin(theta - delta / 2) has the sign `side` (+1: at least 0, -1: at most 0). */
static int clip_at_bisector(double a, double r, double delta, double side, double *low, double *high) {
  if (side * a >= r) return 1;
  if (side * a <= -r) return 0;
  double edge = asin(-a / r), turn = side > 0 ? PI : -PI;
  double from = fmin(edge, turn - edge) + 0.5 * delta, to = fmax(edge, turn - edge) + 0.5 * delta;
  *low = fmax(*low, from);
  *high = fmin(*high, to);
  return *low < *high;
}

#define N_GAUSS 10
static const double GAUSS_NODE[N_GAUSS] = {
    0.013046735741414128, 0.067468316655507732, 0.16029521585048778, 0.28330230293537639, 0.42556283050918442,
    0.57443716949081558, 0.71669769706462361, 0.83970478414951222, 0.93253168334449232, 0.98695326425858587};
static const double GAUSS_WEIGHT[N_GAUSS] = {
    0.033335672154344069, 0.074725674575290293, 0.10954318125799102, 0.13463335965499817, 0.14776211235737644,
    0.14776211235737644, 0.13463335965499817, 0.10954318125799102, 0.074725674575290293, 0.033335672154344069};

/* int_theta^theta_0 (cos t - cos theta_0)^n {cos t, 1} dt, nodes graded by u^2 towards the singular end theta_0. */
static void depth_integrals(double theta, double theta_0, double n, double out[2]) {
  double length = theta_0 - theta, cosine = cos(theta_0), sine = sin(theta_0);
  out[0] = out[1] = 0.0;
  if (length <= 0.0) return;
  for (int i = 0; i < N_GAUSS; ++i) {
    double u = GAUSS_NODE[i], half = 0.5 * length * u * u, c = cos(half), s = sin(half);
    double depth = 2.0 * (sine * c - cosine * s) * s; /* cos(theta_0 - 2 half) - cos(theta_0), without the loss */
    double part = GAUSS_WEIGHT[i] * 2.0 * length * u * (n == 1.0 ? depth : pow(depth, n));
    out[0] += part * (cosine + depth);
    out[1] += part;
  }
}

/* The same from any theta >= -theta_0, given the integrals from 0: the integrand is even. */
static void integrals_from(double theta, double theta_0, double n, const double half[2], double out[2]) {
  depth_integrals(fabs(theta), theta_0, n, out);
  if (theta < 0.0) for (int i = 0; i < 2; ++i) out[i] = 2.0 * half[i] - out[i];
}

/* The part of facet k's contact arc that belongs to it: theta from its normal, between the bisectors to its neighbours.
   Parts of one plane share the plane's sinkage, and their shares add up to 1. */
static int find_patch(const Facet *facets, integer n, integer k, double radius, double n_soil, Patch *patch) {
  const Facet *f = facets + k;
  double distance = -(f->s * f->n_s + f->t * f->n_t);
  double h = radius - distance;
  if (h <= 0.0) return 0;
  if (h > 1.999 * radius) h = 1.999 * radius;
  double theta = acos(1.0 - h / radius), low = -theta, high = theta;
  if (fmax(f[1].s, f->s) < -radius || fmin(f[1].s, f->s) > radius) return 0;
  for (int side = -1; side <= 1; side += 2) {
    integer other = k - side; /* side +1: the lower bound, set by the facet behind */
    if (other < 0 || other >= n) continue;
    const Facet *g = facets + other, *corner = side > 0 ? f : f + 1;
    double m_s = f->n_s + g->n_s, m_t = f->n_t + g->n_t, scale = 1.0 / sqrt(m_s * m_s + m_t * m_t);
    double ahead_s = m_t * scale, ahead_t = -m_s * scale; /* across the bisector, forwards */
    double a = -(corner->s * ahead_s + corner->t * ahead_t);
    double tilt = asin(fmin(1.0, fmax(-1.0, f->n_s * ahead_s + f->n_t * ahead_t)));
    if (!clip_at_bisector(a, radius, 2.0 * tilt, side, &low, &high)) return 0;
  }
  double cosine = cos(theta), deepest = cos(fmin(fmax(0.0, low), high)) - cosine;
  patch->facet = f;
  patch->sinkage = fmin(h, DEEPEST * radius);
  patch->depth = radius * deepest;
  patch->share = patch->turn = 1.0;
  patch->tilt = patch->side = 0.0;
  if (low > -theta || high < theta) {
    if (deepest <= 1e-12) return 0;
    double own[2], whole[2], upper[2], lower[2];
    depth_integrals(0.0, theta, n_soil, own);
    memcpy(whole, own, sizeof whole);
    if (patch->sinkage < h) depth_integrals(0.0, acos(1.0 - patch->sinkage / radius), n_soil, whole);
    integrals_from(low, theta, n_soil, own, lower);
    integrals_from(high, theta, n_soil, own, upper);
    patch->share = 0.5 * (lower[0] - upper[0]) / whole[0];
    patch->turn = 0.5 * (lower[1] - upper[1]) / whole[1];
    double from = fmax(cos(low) - cosine, 0.0), to = fmax(cos(high) - cosine, 0.0);
    patch->tilt = 0.5 * (pow(from, n_soil + 1.0) - pow(to, n_soil + 1.0)) / ((n_soil + 1.0) * whole[0]);
  }
  return 1;
}
