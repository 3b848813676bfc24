/* The new speeds. */

/* Gaussian elimination with row pivoting on A (n x n) and b. */
static int solve(integer n, double A[][MAX_DOF], double *b) {
  for (integer p = 0; p < n; ++p) {
    integer best = p;
    for (integer i = p + 1; i < n; ++i) if (fabs(A[i][p]) > fabs(A[best][p])) best = i;
    if (!(fabs(A[best][p]) > 1e-300)) return SINGULAR;
    if (best != p) {
      for (integer j = p; j < n; ++j) { double s = A[p][j]; A[p][j] = A[best][j]; A[best][j] = s; }
      double s = b[p]; b[p] = b[best]; b[best] = s;
    }
    double inverse = 1.0 / A[p][p];
    for (integer i = p + 1; i < n; ++i) {
      double factor = A[i][p] * inverse;
      if (factor == 0.0) continue;
      for (integer j = p + 1; j < n; ++j) A[i][j] -= factor * A[p][j];
      b[i] -= factor * b[p];
    }
  }
  for (integer p = n - 1; p >= 0; --p) {
    for (integer j = p + 1; j < n; ++j) b[p] -= A[p][j] * b[j];
    b[p] /= A[p][p];
  }
  return OK;
}

/* (M - dt/2 D) du = dt (Q - nle), with v_follower = ratio v_leader for joints that are coupled, as the rockers of a
   differential are; springs and the body's push fully implicit. */
static int solve_speeds(const Drive *d, System *system, const BodyPush *push) {
  integer nv = d->nv, n = 0, index[MAX_DOF], follows[MAX_DOF] = {0};
  double b[MAX_DOF], half = implicit_share(d) * d->dt;
  for (integer j = 0; j < nv; ++j)
    for (integer i = 0; i <= j; ++i) { /* M has its upper triangle */
      double m = d->M[i * nv + j];
      system->A[i][j] = m - half * system->soil_D[i][j];
      if (i != j) system->A[j][i] = m - half * system->soil_D[j][i];
    }
  for (integer i = 0; i < nv; ++i) {
    system->A[i][i] -= half * system->motor_slope[i] + d->dt * system->other_slope[i];
    b[i] = d->dt * (system->soil_Q[i] + system->motor_torque[i] + system->other_Q[i] - d->nle[i]);
  }
  for (integer j = 0; j < d->n_body; ++j) {
    b[d->body_dof[j]] += d->dt * push->Q[j];
    for (integer i = 0; i < d->n_body; ++i) system->A[d->body_dof[i]][d->body_dof[j]] -= d->dt * push->D[i + j * d->n_body];
  }
  for (integer c = 0; c < d->n_coupled; ++c) {
    integer follower = d->coupled_dof[2 * c], leader = d->coupled_dof[2 * c + 1];
    double ratio = d->coupled_ratio[c];
    for (integer j = 0; j < nv; ++j) system->A[leader][j] += ratio * system->A[follower][j];
    for (integer i = 0; i < nv; ++i) system->A[i][leader] += ratio * system->A[i][follower];
    b[leader] += ratio * b[follower];
    follows[follower] = 1;
  }
  for (integer i = 0; i < nv; ++i) if (!follows[i]) index[n++] = i;
  if (n < nv)
    for (integer i = 0; i < n; ++i) { /* in place: index[i] >= i */
      b[i] = b[index[i]];
      for (integer j = 0; j < n; ++j) system->A[i][j] = system->A[index[i]][index[j]];
    }
  int status = solve(n, system->A, b);
  for (integer i = 0; i < n; ++i) d->du[index[i]] = b[i];
  for (integer c = 0; c < d->n_coupled; ++c)
    d->du[d->coupled_dof[2 * c]] = d->coupled_ratio[c] * d->du[d->coupled_dof[2 * c + 1]];
  return status;
}
