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

#define N_ENDS 3 /* integrals that are worked out together */

/* int_theta^theta_0 (cos t - cos theta_0)^n {cos t, 1} dt for some ends theta in [0, theta_0], nodes graded by u^2 towards
   the singular end theta_0. */
static void depth_integrals(const double theta[N_ENDS], const Arc *arc, double n, double out[N_ENDS][2]) {
  double back[N_ENDS * N_GAUSS], depth[N_ENDS * N_GAUSS];
  for (int k = 0; k < N_ENDS; ++k)
    for (int i = 0; i < N_GAUSS; ++i) back[k * N_GAUSS + i] = 0.5 * (arc->theta - theta[k]) * GAUSS_NODE[i] * GAUSS_NODE[i];
  for (int i = 0; i < N_ENDS * N_GAUSS; ++i) {
    double s, c;
    sine_cosine(back[i], &s, &c);
    depth[i] = 2.0 * (arc->sine * c - arc->cosine * s) * s; /* cos(theta_0 - 2 back) - cos(theta_0), without the loss */
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
