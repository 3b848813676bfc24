/* A rover set down in one call: relaxation.py says how and why. */

enum { RESTS, SLIDES, NEVER };
#define AIM 1e-8       /* acceleration over gravity at which a rover is at rest: what is aimed at, */
#define AT_REST 1e-5   /* and what is still taken */
#define PITCH 4        /* the base's in v, */
#define NUDGE 1e-6     /* and a turn that no rest notices [rad] */
#define MOST_STEPS 300
#define FURTHEST 0.1   /* way of a wheel in a step over its radius: what was worked out at its begin hardly holds beyond */
#define SLOW 0.25      /* factors of the step's length after one that came no closer to rest, and after one that did */
#define FAST 2.0
#define LONGEST 100.0  /* longest step over the first, in which a wheel falls by FURTHEST: Newton's */
static const integer SLIDE[3] = {0, 1, 5}; /* the base's own x, y and yaw in v */

static double *keep_part(double *room, const double *from, integer n) {
  memcpy(room, from, n * sizeof(double));
  return room + n;
}

/* The state, without what is recorded of it. */
static void keep_state(const Drive *d, double *room) {
  room = keep_part(room, d->q, d->nq);
  room = keep_part(room, d->v, d->nv);
  room = keep_part(room, d->contact_states, d->n_wheels * d->n_contact_states);
  keep_part(room, d->motor_states, d->n_wheels * d->n_motor_states);
}

/* All of it but q. */
static void take_states(const Drive *d, const double *room) {
  const integer contact = d->n_wheels * d->n_contact_states;
  room += d->nq;
  memcpy(d->v, room, d->nv * sizeof(double));
  memcpy(d->contact_states, room + d->nv, contact * sizeof(double));
  memcpy(d->motor_states, room + d->nv + contact, d->n_wheels * d->n_motor_states * sizeof(double));
}

static void take_state(const Drive *d, const double *room) {
  memcpy(d->q, room, d->nq * sizeof(double));
  take_states(d, room);
}

static double greatest_way(const Drive *d, const Settling *s) {
  double most = 0.0;
  for (integer i = 0; i < d->nv; ++i) most = larger(most, fabs(s->lengths[i] * d->v[i]));
  return most;
}

/* The greatest acceleration of what is free to move, over gravity, with lengths for angles. */
static double unbalanced(Drive *d, const Settling *s) {
  keep_state(d, s->looked);
  d->dt = GLANCE; /* its speeds over its length are the accelerations */
  d->settling = DRIVING;
  const int failed = rover_pin_step(d);
  const double speed = greatest_way(d, s);
  take_state(d, s->looked);
  return failed ? INFINITY : speed / GLANCE / s->gravity;
}

/* Back to its x, y and heading, along the ground. */
static void put_back(Drive *d, const Settling *s) {
  double attitude[3];
  find_attitude(d->q, attitude);
  turn_base(d->q, remainder(s->yaw - attitude[2], 2.0 * PI));
  d->q[2] += s->rise[0] * (s->place[0] - d->q[0]) + s->rise[1] * (s->place[1] - d->q[1]);
  for (int c = 0; c < 2; ++c) d->q[c] = s->place[c];
}

/* The shear that a step has built up: its greatest change; then, of the state before, so much of it. */
static double most_sheared(const Drive *d, const Settling *s) {
  const double *before = s->before + d->nq + d->nv;
  double most = 0.0;
  for (integer w = 0; w < d->n_wheels; ++w)
    for (integer k = 0; k < s->n_slip; ++k) {
      const integer at = w * d->n_contact_states + s->slip[k];
      most = larger(most, fabs(d->contact_states[at] - before[at]));
    }
  return most;
}

static void shear(const Drive *d, const Settling *s, double share, const double *reached) {
  const double *before = s->before + d->nq + d->nv;
  for (integer w = 0; w < d->n_wheels; ++w)
    for (integer k = 0; k < s->n_slip; ++k) {
      const integer at = w * d->n_contact_states + s->slip[k];
      const double now = before[at] + share * (reached[at] - before[at]);
      d->contact_states[at] = smaller(s->most_shear[k], larger(-s->most_shear[k], now));
    }
}

/* Step once from s->before, at most as far as FURTHEST allows; 1: that was the whole step, 0: less of it, -1: no step. */
static int settle_step(Drive *d, const Settling *s, double dt, int how) {
  double reached[MAX_DOF * MAX_STATES];
  d->dt = dt;
  d->settling = how;
  if (rover_pin_step(d)) return -1;
  for (int i = 0; i < 3; ++i) d->v[SLIDE[i]] = 0.0;
  const double way = greatest_way(d, s) * 0.5 * dt / (FURTHEST * s->radius);
  const double slid = how == ON_THE_SOIL ? most_sheared(d, s) / s->most_slid : 0.0;
  const double share = 1.0 / larger(1.0, larger(way, slid));
  memcpy(d->q, s->before, d->nq * sizeof(double));
  d->dt = dt * share;
  drift(d);
  memcpy(reached, d->contact_states, d->n_wheels * d->n_contact_states * sizeof(double));
  take_states(d, s->before);
  if (how == ON_THE_SOIL) shear(d, s, share, reached);
  put_back(d, s);
  return share == 1.0;
}

/* Short steps follow the force, long ones are Newton's; return what is left. */
static double relax(Drive *d, const Settling *s, int how) {
  double dt = sqrt(FURTHEST * s->radius / s->gravity), left = unbalanced(d, s);
  const double longest = LONGEST * dt;
  for (int k = 0; k < MOST_STEPS && !(left <= AIM); ++k) {
    keep_state(d, s->before);
    const int whole = settle_step(d, s, dt, how);
    const double now = whole < 0 ? INFINITY : unbalanced(d, s);
    if (!isfinite(now)) {
      take_state(d, s->before);
      dt *= SLOW;
      continue;
    }
    dt = smaller(longest, dt * (whole && now < left ? FAST : now > FAST * left ? SLOW : 1.0));
    left = now;
  }
  return left;
}

/* At rest in hand; the second time from a slightly other pitch, so that it does not rest where it would tip over. */
static double rest_in_hand(Drive *d, const Settling *s) {
  relax(d, s, IN_HAND);
  d->v[PITCH] = NUDGE;
  d->dt = 2.0;
  drift(d);
  d->v[PITCH] = 0.0;
  return relax(d, s, IN_HAND);
}

/* Set the rover down; the wheels' rotors are locked, and so is its slide, until it is let go. */
int rover_pin_set_down(Drive *d, const Settling *s) {
  if (!(rest_in_hand(d, s) <= AT_REST)) return NEVER;
  keep_state(d, s->in_hand);
  for (int i = 0; i < 3; ++i) {
    d->armature[SLIDE[i]] = s->free_rotors[i];
    s->lengths[SLIDE[i]] = s->free_lengths[i];
  }
  if (unbalanced(d, s) <= AT_REST) return RESTS;
  if (s->n_slip && relax(d, s, ON_THE_SOIL) <= AT_REST) return RESTS;
  take_state(d, s->in_hand);
  return SLIDES;
}
