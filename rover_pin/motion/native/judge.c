/* Whether a step took the forces to be what they became. */

/* By how much of its normal force a wheel's load now is not what the last step took it to become. */
static double misjudged(const Drive *d, integer index, const WheelUpdate *now) {
  const double *before = d->foreseen + 4 * index;
  if (!(now->load[2] > 0.0 && before[2] > 0.0)) return 0.0;
  double most = 0.0;
  for (int a = 0; a < 4; ++a) {
    double arm = a == 3 ? d->radius[index] : 1.0;
    most = fmax(most, fabs(now->load[a] / now->load[2] - before[a] / before[2]) / arm);
  }
  return most * fmin(1.0, now->load[2] / d->wheel_share);
}

static void foresee(const Drive *d, integer index, const Wheel *wheel, const WheelUpdate *update) {
  double velocity[3] = {0.0, 0.0, 0.0}, spin = 0.0;
  for (integer i = 0; i < wheel->n; ++i) {
    double du = d->du[wheel->cols[i]];
    for (int c = 0; c < 3; ++c) velocity[c] += wheel->lin[i][c] * du;
    spin += dot(wheel->ang[i], wheel->axle) * du;
  }
  for (int a = 0; a < 4; ++a)
    d->foreseen[4 * index + a] = update->end[a] + dot(update->end_by_velocity[a], velocity) + update->end_by_spin[a] * spin;
}
