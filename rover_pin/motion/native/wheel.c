/* A wheel's place, axes and motion. */

static void look_at_wheel(const Drive *d, integer w, Wheel *wheel) {
  const double *p = d->centres[w];
  memcpy(wheel->centre, p, sizeof wheel->centre);
  memcpy(wheel->axle, d->J + 6 * d->wheel_dof[w] + 3, sizeof wheel->axle);
  const double vertical[3] = {0.0, 0.0, 1.0};
  for (int i = 0; i < 3; ++i) wheel->up[i] = vertical[i] - wheel->axle[2] * wheel->axle[i];
  unit(wheel->up);
  cross(wheel->axle, wheel->up, wheel->forward);
  wheel->cols = d->cols + w * d->n_cols;
  wheel->n = d->col_count[w];
  double rate[3] = {0.0, 0.0, 0.0};
  memset(wheel->velocity, 0, sizeof wheel->velocity);
  for (integer i = 0; i < wheel->n; ++i) {
    const double *column = d->J + 6 * wheel->cols[i];
    cross(column + 3, p, wheel->lin[i]);
    for (int c = 0; c < 3; ++c) {
      wheel->lin[i][c] += column[c];
      wheel->ang[i][c] = column[3 + c];
      wheel->velocity[c] += wheel->lin[i][c] * d->v[wheel->cols[i]];
      rate[c] += column[3 + c] * d->v[wheel->cols[i]];
    }
  }
  wheel->spin = dot(rate, wheel->axle);
}
