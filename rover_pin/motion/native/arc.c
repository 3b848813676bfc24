/* What a part of a contact arc carries: integrals of the depth's power over its angle. */

#define N_GAUSS 10
static const double GAUSS_NODE[N_GAUSS] = {
    0.013046735741414128, 0.067468316655507732, 0.16029521585048778, 0.28330230293537639, 0.42556283050918442,
    0.57443716949081558, 0.71669769706462361, 0.83970478414951222, 0.93253168334449232, 0.98695326425858587};
static const double GAUSS_WEIGHT[N_GAUSS] = {
    0.033335672154344069, 0.074725674575290293, 0.10954318125799102, 0.13463335965499817, 0.14776211235737644,
    0.14776211235737644, 0.13463335965499817, 0.10954318125799102, 0.074725674575290293, 0.033335672154344069};

#define N_SERIES 10

/* sin and cos of x in [0, 1.6] to the last digit, as series: a loop over them runs in vector lanes. */
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

static double power(double x, double n) { return n == 1.0 ? x : pow(x, n); }

typedef struct { double theta, cosine, sine; } Arc; /* the contact's end under a facet's line */

/* The arc of a rim that is h below the line. */
static Arc arc_of(double h, double radius) {
  const double depth = h / radius;
  return (Arc){acos(1.0 - depth), 1.0 - depth, sqrt(depth * (2.0 - depth))};
}

/* int_theta^theta_0 (cos t - cos theta_0)^n {cos t, 1} dt, nodes graded by u^2 towards the singular end theta_0. */
static void depth_integrals(double theta, const Arc *arc, double n, double out[2]) {
  const double length = arc->theta - theta;
  double depth[N_GAUSS];
  out[0] = out[1] = 0.0;
  if (length <= 0.0) return;
  for (int i = 0; i < N_GAUSS; ++i) {
    double u = GAUSS_NODE[i], s, c;
    sine_cosine(0.5 * length * u * u, &s, &c);
    depth[i] = 2.0 * (arc->sine * c - arc->cosine * s) * s; /* cos(theta_0 - 2 half) - cos(theta_0), without the loss */
  }
  for (int i = 0; i < N_GAUSS; ++i) {
    double part = GAUSS_WEIGHT[i] * 2.0 * length * GAUSS_NODE[i] * power(depth[i], n);
    out[0] += part * (arc->cosine + depth[i]);
    out[1] += part;
  }
}

/* The same from any theta >= -theta_0, given the integrals from 0: the integrand is even. */
static void integrals_from(double theta, const Arc *arc, double n, const double half[2], double out[2]) {
  depth_integrals(fabs(theta), arc, n, out);
  if (theta < 0.0) for (int i = 0; i < 2; ++i) out[i] = 2.0 * half[i] - out[i];
}
