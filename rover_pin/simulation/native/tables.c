/* What a slip control looks up: twins of control/slip_estimate.py and control/torque_check.py, which say what and why. */

#define SLOWEST_RIM 1e-3 /* as of control/slip_estimate.py */
#define LEAST_RATIO 0.05 /* as of control/slip_control.py */
#define LOCKED 1e-14 /* as of soil/slip.py */

/* Linear between the points (x, y), the end values beyond. */
static real between(real at, const real *x, const real *y, integer n) {
  if (at <= x[0]) return y[0];
  if (at >= x[n - 1]) return y[n - 1];
  integer k = 0;
  while (x[k + 1] <= at) ++k;
  return (y[k + 1] - y[k]) / (x[k + 1] - x[k]) * (at - x[k]) + y[k];
}

/* Speed at a duty, odd in it. */
static real signed_speed(real duty, const real *duties, const real *speeds, integer n) {
  const real way = (duty > 0.0) - (duty < 0.0);
  return way * between(fabs(duty), duties, speeds, n);
}

/* S_hat of Eq (9). */
static real slip_by_table(real r, real rate, real speed) {
  const real rim = r * rate, sense = rim < 0.0 ? -1.0 : 1.0;
  return fmin(1.0, fmax(-1.0, 1.0 - sense * speed / fmax(fabs(rim), SLOWEST_RIM)));
}

/* Travel of a wheel of this slip, Eq (1), its rim at the speed `rim`. */
static real slip_travel(real slip, real rim) {
  const real S = fmax(slip, LEAST_RATIO - 1.0);
  return rim * ((1.0 - fmax(S, 0.0)) / fmax(1.0 + fmin(S, 0.0), LOCKED));
}

/* Whether a rover that stands and digs stops for good: of late samples a share says that it stands. law: the weight of
   a sample, the share, the depth of the deepest hole over the radius. */
static int stops(real *late_share, int stands, real deepest, const real *law) {
  *late_share += law[0] * (stands - *late_share);
  return *late_share > law[1] && deepest > law[2];
}

/* The duty at which a motor has a torque, `back` of it taken up by its rate. */
static real duty_for(real torque, real stall_torque, real back) {
  return fmin(1.0, fmax(0.0, torque / stall_torque + back));
}
