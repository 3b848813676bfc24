/* A wheel's place, axes and motion. */

/* Column of the Jacobian of point p by the k-th degree of freedom: base along, base about, then the joints. */
static void jacobian_column(const Drive *d, integer k, const double *p, double *lin, double *ang) {
  const double *axis = k < 6 ? d->rotation + 3 * (k % 3) : d->axes + 3 * (k - 6);
  const double *from = k < 6 ? d->q : d->points + 3 * (k - 6);
  if (k < 3) {
    memcpy(lin, axis, 3 * sizeof(double));
    memset(ang, 0, 3 * sizeof(double));
    return;
  }
  const double arm[3] = {p[0] - from[0], p[1] - from[1], p[2] - from[2]};
  cross(axis, arm, lin);
  memcpy(ang, axis, 3 * sizeof(double));
}

static void look_at_wheel(const Drive *d, integer w, Wheel *wheel) {
  const double *p = d->points + 3 * (d->wheel_dof[w] - 6);
  memcpy(wheel->centre, p, sizeof wheel->centre);
  memcpy(wheel->axle, d->axes + 3 * (d->wheel_dof[w] - 6), sizeof wheel->axle);
  const double vertical[3] = {0.0, 0.0, 1.0};
  for (int i = 0; i < 3; ++i) wheel->up[i] = vertical[i] - wheel->axle[2] * wheel->axle[i];
  unit(wheel->up);
  cross(wheel->axle, wheel->up, wheel->forward);
  wheel->cols = d->cols + w * d->n_cols;
  wheel->n = d->col_count[w];
  double rate[3] = {0.0, 0.0, 0.0};
  memset(wheel->velocity, 0, sizeof wheel->velocity);
  for (integer i = 0; i < wheel->n; ++i) {
    jacobian_column(d, wheel->cols[i], p, wheel->lin[i], wheel->ang[i]);
    for (int c = 0; c < 3; ++c) {
      wheel->velocity[c] += wheel->lin[i][c] * d->v[wheel->cols[i]];
      rate[c] += wheel->ang[i][c] * d->v[wheel->cols[i]];
    }
  }
  wheel->spin = dot(rate, wheel->axle);
}
