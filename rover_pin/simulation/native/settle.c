/* Setting a rover down in one call. start.py (relax_state) gives the equations and the source. */

/* Results; start.py has the same numbers in the enum Rest. */
enum { RESTS, SLIDES, NEVER };
#define AIM 1e-8       /* acceleration over gravity at which the rover counts as at rest, and the search ends */
#define AT_REST 1e-5   /* largest remaining acceleration over gravity that is accepted as rest */
#define PITCH 4        /* degree of freedom of the base's pitch */
#define NUDGE 1e-6     /* [rad] turn that does not disturb a stable rest, but leaves an unstable one */
#define MAX_STEPS 300          /* of one search */
#define MAX_DISPLACEMENT 0.1   /* largest displacement of a wheel in one step, over its radius */
#define SHORTER 0.25           /* factor of the step's length after a step that did not come closer to rest */
#define LONGER 2.0             /* factor after a step that did */
#define MAX_LENGTH 100.0       /* longest step over the first one: so long that it is a step of Newton's method */
static const integer SLIDE[3] = {0, 1, 5}; /* degrees of freedom that slide the base along the ground: x, y and yaw */

/* Copy n numbers into a room; return the place behind them. */
static double *keep_part(double *room, const double *from, integer n) {
  memcpy(room, from, n * sizeof(double));
  return room + n;
}

/* Save the state: q, v, and the states of contacts and motors. */
static void keep_state(const Drive *d, double *room) {
  room = keep_part(room, d->q, d->nq);
  room = keep_part(room, d->v, d->nv);
  room = keep_part(room, d->contact_states, d->n_wheels * d->n_contact_states);
  keep_part(room, d->motor_states, d->n_wheels * d->n_motor_states);
}

/* Restore all of a saved state but q. */
static void take_states(const Drive *d, const double *room) {
  const integer contact = d->n_wheels * d->n_contact_states;
  room += d->nq;
  memcpy(d->v, room, d->nv * sizeof(double));
  memcpy(d->contact_states, room + d->nv, contact * sizeof(double));
  memcpy(d->motor_states, room + d->nv + contact, d->n_wheels * d->n_motor_states * sizeof(double));
}

/* Restore a saved state. */
static void take_state(const Drive *d, const double *room) {
  memcpy(d->q, room, d->nq * sizeof(double));
  take_states(d, room);
}

/* Return the largest speed, with angular speeds times a length [m/s]; locked speeds have the length 0. */
static double largest_speed(const Drive *d, const Settling *s) {
  double largest = 0.0;
  for (integer i = 0; i < d->nv; ++i) largest = larger(largest, fabs(s->lengths[i] * d->v[i]));
  return largest;
}

/* Return the largest acceleration of the free speeds over gravity; angular accelerations count times a length. It is
   found by a step of GLANCE seconds from rest. */
static double remaining_acceleration(Drive *d, const Settling *s) {
  keep_state(d, s->looked);
  d->dt = GLANCE; /* from no speed, the speeds after the step over its length are the accelerations */
  d->settling = DRIVING;
  const int failed = rover_pin_step(d);
  const double speed = largest_speed(d, s);
  take_state(d, s->looked);
  return failed ? INFINITY : speed / GLANCE / s->gravity;
}

/* Put the base back to its x, y and heading, along the slope of the ground. */
static void put_base_back(Drive *d, const Settling *s) {
  double attitude[3];
  find_attitude(d->q, attitude);
  turn_base(d->q, remainder(s->yaw - attitude[2], 2.0 * PI));
  d->q[2] += s->rise[0] * (s->place[0] - d->q[0]) + s->rise[1] * (s->place[1] - d->q[1]);
  for (int c = 0; c < 2; ++c) d->q[c] = s->place[c];
}

/* Return the largest change of a shear state in a step. */
static double largest_shear(const Drive *d, const Settling *s) {
  const double *before = s->before + d->nq + d->nv;
  double largest = 0.0;
  for (integer w = 0; w < d->n_wheels; ++w)
    for (integer k = 0; k < s->n_slip; ++k) {
      const integer at = w * d->n_contact_states + s->slip[k];
      largest = larger(largest, fabs(d->contact_states[at] - before[at]));
    }
  return largest;
}

/* Set the shear states to a share of the step's change, within the shear of a wheel that only slides. */
static void shear(const Drive *d, const Settling *s, double share, const double *reached) {
  const double *before = s->before + d->nq + d->nv;
  for (integer w = 0; w < d->n_wheels; ++w)
    for (integer k = 0; k < s->n_slip; ++k) {
      const integer at = w * d->n_contact_states + s->slip[k];
      const double now = before[at] + share * (reached[at] - before[at]);
      d->contact_states[at] = smaller(s->most_shear[k], larger(-s->most_shear[k], now));
    }
}

/* Take one implicit step from s->before, shortened so that no wheel moves further than MAX_DISPLACEMENT. Return 1
   for a whole step, 0 for a shortened one, -1 where the step failed. */
static int settle_step(Drive *d, const Settling *s, double dt, int how) {
  double reached[MAX_DOF * MAX_STATES];
  d->dt = dt;
  d->settling = how;
  if (rover_pin_step(d)) return -1;
  /* Shorten the step where a wheel would move, or the soil be sheared, too far. */
  for (int i = 0; i < 3; ++i) d->v[SLIDE[i]] = 0.0;
  const double moved = largest_speed(d, s) * 0.5 * dt / (MAX_DISPLACEMENT * s->radius);
  const double slid = how == ON_THE_SOIL ? largest_shear(d, s) / s->most_slid : 0.0;
  const double share = 1.0 / larger(1.0, larger(moved, slid));
  /* Move from the old configuration at the new speeds for the shortened step, then take the speeds away again. */
  memcpy(d->q, s->before, d->nq * sizeof(double));
  d->dt = dt * share;
  drift(d);
  memcpy(reached, d->contact_states, d->n_wheels * d->n_contact_states * sizeof(double));
  take_states(d, s->before);
  if (how == ON_THE_SOIL) shear(d, s, share, reached);
  put_base_back(d, s);
  return share == 1.0;
}

/* Search for the rest: short steps follow the force, long ones are Newton's. The step grows while the rest comes
   nearer. Return the remaining acceleration over gravity. */
static double relax(Drive *d, const Settling *s, int how) {
  double dt = sqrt(MAX_DISPLACEMENT * s->radius / s->gravity), remaining = remaining_acceleration(d, s);
  const double longest = MAX_LENGTH * dt;
  for (int k = 0; k < MAX_STEPS && !(remaining <= AIM); ++k) {
    keep_state(d, s->before);
    const int whole = settle_step(d, s, dt, how);
    const double now = whole < 0 ? INFINITY : remaining_acceleration(d, s);
    /* A step that failed is repeated with a shorter one. */
    if (!isfinite(now)) {
      take_state(d, s->before);
      dt *= SHORTER;
      continue;
    }
    dt = smaller(longest, dt * (whole && now < remaining ? LONGER : now > LONGER * remaining ? SHORTER : 1.0));
    remaining = now;
  }
  return remaining;
}

/* Find the rest of a rover that is held in hand. The second search starts from a slightly different pitch, so that
   an unstable rest, from which the rover would tip over, is remaining. */
static double rest_in_hand(Drive *d, const Settling *s) {
  relax(d, s, IN_HAND);
  d->v[PITCH] = NUDGE;
  d->dt = 2.0;
  drift(d);
  d->v[PITCH] = 0.0;
  return relax(d, s, IN_HAND);
}

/* Set the rover down. The caller has locked the wheels' rotors and the base's slide along the ground; the slide is
   set free here after the rest in hand. Return RESTS where the soil holds the rover, SLIDES where it does not (the
   state is then that of the rest in hand), NEVER where it does not come to rest even in hand. */
int rover_pin_set_down(Drive *d, const Settling *s) {
  if (!(rest_in_hand(d, s) <= AT_REST)) return NEVER;
  keep_state(d, s->in_hand);
  /* Release the base's slide along the ground. */
  for (int i = 0; i < 3; ++i) {
    d->armature[SLIDE[i]] = s->free_rotors[i];
    s->lengths[SLIDE[i]] = s->free_lengths[i];
  }
  if (remaining_acceleration(d, s) <= AT_REST) return RESTS;
  if (s->n_slip && relax(d, s, ON_THE_SOIL) <= AT_REST) return RESTS;
  take_state(d, s->in_hand);
  return SLIDES;
}
