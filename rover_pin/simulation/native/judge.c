/* What a step made of its wheels, and whether it took the forces to be what they became. */

/* By how much of its normal force a wheel's load now is not what the last step took it to become. */
static double misjudged(const Drive *d, integer index, const WheelLoad *now) {
  const double *before = d->foreseen + 4 * index;
  if (!(now->load[2] > 0.0 && before[2] > 0.0)) return 0.0;
  double most = 0.0;
  for (int a = 0; a < 4; ++a) {
    double arm = a == 3 ? d->radius[index] : 1.0;
    most = larger(most, fabs(now->load[a] / now->load[2] - before[a] / before[2]) / arm);
  }
  return most * smaller(1.0, now->load[2] / d->wheel_share);
}

static double by_moved(const double *slope, const double *moved) {
  return slope[0] * moved[0] + slope[1] * moved[1] + slope[2] * moved[2] + slope[3] * moved[3];
}

/* A wheel's velocity and spin by speeds of the rover. */
static void motion_by(const Wheel *wheel, const double *speeds, double *motion) {
  _Alignas(64) double own[MAX_COLS];
  take_columns(wheel, speeds, own);
  for (int c = 0; c < 3; ++c) motion[c] = along(wheel->lin[c], own, wheel->rows);
  motion[3] = along(wheel->rim, own, wheel->rows);
}

/* A wheel's change of motion, the load expected of it, and its states at the step's end. */
static void end_wheel(const Drive *d, integer index, const Wheel *wheel, const double *mean_du, WheelLoad *sum) {
  const integer nx = d->n_contact_states;
  motion_by(wheel, d->du, sum->moved);
  motion_by(wheel, mean_du, sum->mean_moved);
  for (int a = 0; a < 4; ++a) d->foreseen[4 * index + a] = sum->end[a] + by_moved(sum->end_slope[a], sum->moved);
  for (integer i = 0; i < nx; ++i)
    d->contact_states[index * nx + i] += sum->gain[i] + by_moved(sum->gain_slope[i], sum->mean_moved);
}

/* Power of the soil on a wheel half-way through the step, and what it pushes there. */
static double soil_power(const Drive *d, integer index, const Wheel *wheel, const WheelLoad *sum) {
  _Alignas(64) double du[MAX_COLS];
  double power = 0.0, *mean = d->mean_loads + 6 * index;
  take_columns(wheel, d->du, du);
  for (int i = 0; i < 6; ++i) mean[i] = sum->wrench[i] + by_moved(sum->slope[i], sum->mean_moved);
  for (int c = 0; c < 3; ++c) {
    power += mean[c] * (wheel->velocity[c] + 0.5 * sum->moved[c]);
    power += mean[3 + c] * (wheel->rate[c] + 0.5 * along(wheel->ang[c], du, wheel->rows));
  }
  return power;
}
