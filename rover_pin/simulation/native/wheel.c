/* Position, axes, Jacobian and motion of a wheel. */

/* Write one column of the Jacobian of the point p, for the k-th degree of freedom: 0 to 2 move the base along its
   axes, 3 to 5 turn it about them, the rest turn about the joints' axes (linear part: axis x arm). */
static void set_column(const Drive *d, integer k, const double *p, integer column, Wheel *wheel) {
  const double *axis = k < 6 ? d->rotation + 3 * (k % 3) : d->axes + 3 * (k - 6);
  const double *from = k < 6 ? d->q : d->points + 3 * (k - 6);
  const double arm[3] = {p[0] - from[0], p[1] - from[1], p[2] - from[2]};
  double way[3];
  cross(axis, arm, way);
  for (int c = 0; c < 3; ++c) {
    wheel->lin[c][column] = k < 3 ? axis[c] : way[c];
    wheel->ang[c][column] = k < 3 ? 0.0 : axis[c];
  }
}

/* Gather the entries of a vector of speeds that move this wheel; the rest of the last vector of 8 is zero. */
static void gather_columns(const Wheel *wheel, const double *speeds, double *taken) {
  for (integer j = 0; j < 8 * wheel->rows; ++j) taken[j] = 0.0;
  for (integer j = 0; j < wheel->n; ++j) taken[j] = speeds[wheel->cols[j]];
}

/* Work out position, axes, Jacobian and motion of wheel w at the present state. */
static void set_wheel(const Drive *d, integer w, Wheel *wheel) {
  const double *p = d->points + 3 * (d->wheel_dof[w] - 6), vertical[3] = {0.0, 0.0, 1.0};
  _Alignas(64) double speeds[MAX_COLS];
  memcpy(wheel->centre, p, sizeof wheel->centre);
  memcpy(wheel->axle, d->axes + 3 * (d->wheel_dof[w] - 6), sizeof wheel->axle);
  /* The wheel's plane is across the axle: `up` is the vertical without its part along the axle, `forward` lies
     across both. */
  for (int i = 0; i < 3; ++i) wheel->up[i] = vertical[i] - wheel->axle[2] * wheel->axle[i];
  unit(wheel->up);
  cross(wheel->axle, wheel->up, wheel->forward);
  /* The Jacobian has columns only for the degrees of freedom that move this wheel. */
  wheel->cols = d->cols + w * d->n_cols;
  wheel->n = d->col_count[w];
  wheel->rows = (wheel->n + 7) / 8;
  for (integer i = 0; i < wheel->n; ++i) set_column(d, wheel->cols[i], p, i, wheel);
  gather_columns(wheel, d->v, speeds);
  for (int c = 0; c < 3; ++c) {
    wheel->velocity[c] = along(wheel->lin[c], speeds, wheel->rows);
    wheel->rate[c] = along(wheel->ang[c], speeds, wheel->rows);
  }
  wheel->spin = dot(wheel->rate, wheel->axle);
  const double *axle = wheel->axle;
  for (integer i = 0; i < wheel->n; ++i)
    wheel->rim[i] = wheel->ang[0][i] * axle[0] + wheel->ang[1][i] * axle[1] + wheel->ang[2][i] * axle[2];
}
