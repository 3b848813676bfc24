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
  for (integer k = 0; k < d->n_inertia; ++k) d->M[d->inertia_place[k]] = d->rigid[k];
  for (integer i = 0; i < nv; ++i) d->M[i * nv + i] += d->armature[i];
}

/* Kinetic and potential energy at the present state. */
void rover_pin_energies(const Drive *d, double *energies) {
  double momentum, kinetic = 0.0;
  move_body(d);
  for (integer i = 0; i < d->nv; ++i) {
    momentum = 0.5 * d->M[i * d->nv + i] * d->v[i];
    for (integer j = i + 1; j < d->nv; ++j) momentum += d->M[i * d->nv + j] * d->v[j];
    kinetic += d->v[i] * momentum;
  }
  energies[0] = kinetic;
  energies[1] = *d->potential;
}
