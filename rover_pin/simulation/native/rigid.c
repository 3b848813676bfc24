/* The rigid body where it is now, by the function that rigid_body.py generates from Pinocchio's model. */

static void move_body(const Drive *d) {
  const integer nv = d->nv, nq = d->nq;
  double moving[3 * MAX_DOF + 16];
  memcpy(moving, d->q, nq * sizeof(double));
  memcpy(moving + nq, d->v, nv * sizeof(double));
  memcpy(moving + nq + nv, d->gravity, 3 * sizeof(double));
  const double *arguments[3] = {moving, 0, d->rigid_held};
  double *results[1] = {d->rigid};
  d->rigid_body(arguments, results, d->work_i, d->work_w, 0);
}

/* The joint-space inertia with rotors, into a matrix that is zero where bodies do not bear each other. */
static void set_inertia(const Drive *d, double A[][MAX_DOF]) {
  const integer *upper = d->inertia_place, *lower = upper + d->n_inertia;
  double *flat = &A[0][0];
  for (integer i = 0; i < d->nv; ++i)
    for (integer j = 0; j < (d->nv + 7) / 8; ++j) ((Row *)A[i])[j] = (Row){0};
  for (integer k = 0; k < d->n_inertia; ++k) flat[upper[k]] = flat[lower[k]] = d->rigid[k];
  for (integer i = 0; i < d->nv; ++i) A[i][i] += d->armature[i];
}

/* Kinetic and potential energy at the present state. */
void rover_pin_energies(const Drive *d, double *energies) {
  _Alignas(64) double A[MAX_DOF][MAX_DOF];
  double twice = 0.0;
  move_body(d);
  set_inertia(d, A);
  for (integer i = 0; i < d->nv; ++i)
    for (integer j = 0; j < d->nv; ++j) twice += d->v[i] * A[i][j] * d->v[j];
  energies[0] = 0.5 * twice;
  energies[1] = *d->potential;
}
