/* What acts on the base and the suspension. */

static void push_body(const Drive *d, BodyPush *push) {
  const integer n = d->n_body, joints = n - 6;
  double input[14 + 2 * MAX_DOF], out[MAX_DOF * (MAX_DOF + 2) + 1], *next = input;
  memcpy(next, d->q, 7 * sizeof(double));
  memcpy(next + 7, d->v, 6 * sizeof(double));
  next += 13;
  for (integer i = 0; i < joints; ++i) *next++ = d->q[d->body_q[i]];
  for (integer i = 0; i < joints; ++i) *next++ = d->v[d->body_dof[6 + i]];
  *next = 0.5 * d->dt;
  const double *arguments[3] = {input, 0, d->body_parameters};
  double *results[1] = {out};
  d->body_law(arguments, results, d->work_i, d->work_w, 0);
  memcpy(push->Q, out, n * sizeof(double));
  memcpy(push->D, out + n, n * n * sizeof(double));
  push->torque = out[n + n * n];
  memcpy(push->torque_slope, out + n + n * n + 1, n * sizeof(double));
}

/* Component i of the body's push at the end of the step. */
static double body_force(const Drive *d, const BodyPush *push, integer i) {
  double force = push->Q[i];
  for (integer j = 0; j < d->n_body; ++j) force += push->D[i + j * d->n_body] * d->du[d->body_dof[j]];
  return force;
}
