/* Formulas of the slip control, twins of control/slip_estimate.py and control/torque_check.py, which explain them. */

#define MIN_RIM_SPEED 1e-3 /* [m/s] rim speed below which the estimate divides by this: control/slip_estimate.py */
#define LEAST_RATIO 0.05 /* least 1 + S of a braked wheel: control/slip_control.py */
#define LOCKED 1e-14 /* least denominator of a locked wheel: soil/slip.py */

/* Linear interpolation between the points (x, y), with the end values beyond them. */
static real between(real at, const real *x, const real *y, integer n) {
  if (at <= x[0]) return y[0];
  if (at >= x[n - 1]) return y[n - 1];
  integer k = 0;
  while (x[k + 1] <= at) ++k;
  return (y[k + 1] - y[k]) / (x[k + 1] - x[k]) * (at - x[k]) + y[k];
}

/* Speed at a duty from a table of positive duties; odd in the duty. */
static real signed_speed(real duty, const real *duties, const real *speeds, integer n) {
  const real sign = (duty > 0.0) - (duty < 0.0);
  return sign * between(fabs(duty), duties, speeds, n);
}

/* Slip estimate S_hat of Eq (9) from the wheel's rate [rad/s] and the speed of the table [m/s]. */
static real slip_by_table(real r, real rate, real speed) {
  const real rim = r * rate, sense = rim < 0.0 ? -1.0 : 1.0;
  return fmin(1.0, fmax(-1.0, 1.0 - sense * speed / fmax(fabs(rim), MIN_RIM_SPEED)));
}

/* Travel speed of a wheel of this slip whose rim moves at `rim`, Eq (1) solved for v. */
static real slip_travel(real slip, real rim) {
  const real S = fmax(slip, LEAST_RATIO - 1.0);
  return rim * ((1.0 - fmax(S, 0.0)) / fmax(1.0 + fmin(S, 0.0), LOCKED));
}

/* Whether a rover that digs itself in stops for good: a late share of the samples reports standing, and the deepest
   hole is deep enough. law: weight of a sample, threshold of the share, threshold of the depth over the radius. */
static int stops(real *late_share, int stands, real deepest, const real *law) {
  *late_share += law[0] * (stands - *late_share);
  return *late_share > law[1] && deepest > law[2];
}

/* Duty at which a motor gives a torque; `back` is the part of the duty that back-EMF takes up. */
static real duty_for(real torque, real stall_torque, real back) {
  return fmin(1.0, fmax(0.0, torque / stall_torque + back));
}
