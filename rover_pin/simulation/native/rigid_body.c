/* The rigid body: its matrices at the present configuration, and the motion of the configuration. */

/* Evaluate the function that rigid_body.py generates from Pinocchio's model: inertia, bias force (nle), joint axes
   and points, the base's rotation and the potential energy go to d->rigid, whose parts d->nle, d->axes ... point to. */
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

/* Write the joint-space inertia, with the motors' rotors on its diagonal, into A. Entries of bodies that do not
   support each other stay zero. */
static void set_inertia(const Drive *d, double A[][MAX_DOF]) {
  const integer *upper = d->inertia_place, *lower = upper + d->n_inertia;
  double *flat = &A[0][0];
  for (integer i = 0; i < d->nv; ++i)
    for (integer j = 0; j < (d->nv + 7) / 8; ++j) ((Row *)A[i])[j] = (Row){0};
  for (integer k = 0; k < d->n_inertia; ++k) flat[upper[k]] = flat[lower[k]] = d->rigid[k];
  for (integer i = 0; i < d->nv; ++i) A[i][i] += d->armature[i];
}

/* Write the kinetic and the potential energy [J] at the present state. */
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

/* Configurations. q of the base: position (3), then the quaternion x, y, z, w; v of the base: velocity (3) and
   angular velocity (3) in the base's own axes. */

/* Below this angle [rad] sine and cosine come from series: exact to the last digit, and faster. */
#define SMALL_ANGLE 0.1

/* Sine and cosine of an angle [rad]. */
static void turn(double angle, double *sine, double *cosine) {
  const double x = angle * angle;
  if (x < SMALL_ANGLE * SMALL_ANGLE) {
    *sine = angle * (1.0 - x * (1.0 / 6 - x * (1.0 / 120 - x * (1.0 / 5040 - x / 362880))));
    *cosine = 1.0 - x * (1.0 / 2 - x * (1.0 / 24 - x * (1.0 / 720 - x / 40320)));
  } else {
    *sine = sin(angle);
    *cosine = cos(angle);
  }
}

/* Move the base by a constant twist v for a time dt: the exponential map of SE(3), which Pinocchio's integrate uses
   too. */
static void advance_base(double *q, const double *v, double dt) {
  const double w[3] = {v[3] * dt, v[4] * dt, v[5] * dt}, u[3] = {v[0] * dt, v[1] * dt, v[2] * dt};
  const double x = dot(w, w), angle = sqrt(x);
  double a, b, s, c; /* (1 - cos)/angle^2, (angle - sin)/angle^3, sin(angle/2)/angle, cos(angle/2) */
  /* the usual case: series, exact to the last digit, without the cancellation of the differences below */
  if (angle < SMALL_ANGLE) {
    a = 1.0 / 2 - x * (1.0 / 24 - x * (1.0 / 720 - x * (1.0 / 40320 - x / 3628800)));
    b = 1.0 / 6 - x * (1.0 / 120 - x * (1.0 / 5040 - x / 362880));
    s = 1.0 / 2 - x * (1.0 / 48 - x * (1.0 / 3840 - x / 645120));
    c = 1.0 - x * (1.0 / 8 - x * (1.0 / 384 - x * (1.0 / 46080 - x / 10321920)));
  } else {
    a = (1.0 - cos(angle)) / x;
    b = (angle - sin(angle)) / (x * angle);
    s = sin(0.5 * angle) / angle;
    c = cos(0.5 * angle);
  }
  /* Translation in the base's axes: V(w) u = u + a (w x u) + b w x (w x u), Rodrigues' formula; then turned into the
     world. */
  double wu[3], wwu[3], move[3], turned[3], twice[3];
  cross(w, u, wu);
  cross(w, wu, wwu);
  for (int i = 0; i < 3; ++i) move[i] = u[i] + a * wu[i] + b * wwu[i];
  cross(q + 3, move, turned); /* R move = move + 2 qw (qv x move) + 2 qv x (qv x move) */
  cross(q + 3, turned, twice);
  for (int i = 0; i < 3; ++i) q[i] += move[i] + 2.0 * (q[6] * turned[i] + twice[i]);
  /* Rotation: the present quaternion times that of the turn w, then normalised. */
  double e[3] = {s * w[0], s * w[1], s * w[2]}, mixed[3], product[4];
  cross(q + 3, e, mixed);
  for (int i = 0; i < 3; ++i) product[i] = q[6] * e[i] + c * q[3 + i] + mixed[i];
  product[3] = q[6] * c - dot(q + 3, e);
  double scale = 1.0 / sqrt(dot(product, product) + product[3] * product[3]);
  for (int i = 0; i < 4; ++i) q[3 + i] = product[i] * scale;
}

/* Move the configuration by half a step at the present velocity. */
static void drift(const Drive *d) {
  const double half = 0.5 * d->dt;
  advance_base(d->q, d->v, half);
  for (integer k = 0; k < d->n_joints; ++k) {
    double step = d->v[d->joint_dof[k]] * half, *q = d->q + d->joint_q[k];
    /* A bounded joint adds its angle. A joint that turns freely stores cosine and sine, which are rotated and
       normalised. */
    if (!d->joint_unbounded[k]) { *q += step; continue; }
    double s, c;
    turn(step, &s, &c);
    double x = c * q[0] - s * q[1], y = s * q[0] + c * q[1];
    double scale = 1.0 / sqrt(x * x + y * y);
    q[0] = x * scale;
    q[1] = y * scale;
  }
}

/* Turn the base about the vertical through its origin by an angle [rad]. */
static void turn_base(double *q, double turn) {
  const double c = cos(0.5 * turn), s = sin(0.5 * turn), x = q[3], y = q[4], z = q[5], w = q[6];
  q[3] = c * x - s * y;
  q[4] = c * y + s * x;
  q[5] = c * z + s * w;
  q[6] = c * w - s * z;
}

/* Replace the velocity by the mean of itself and its mirror image about the x-z plane, so that round-off does not
   break a symmetric drive. */
static void mirror_speeds(const Drive *d) {
  double image[MAX_DOF];
  for (integer i = 0; i < d->nv; ++i) image[i] = d->mirror_sign[i] * d->v[d->mirror_index[i]];
  for (integer i = 0; i < d->nv; ++i) d->v[i] = 0.5 * (d->v[i] + image[i]);
}
