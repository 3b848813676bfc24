/* What patches push: the generated law in the direction of travel for all of them together, LANES at a time. */

typedef struct {
  double load[4];                           /* f_t f_y f_n torque */
  double by_speed[4][4];                    /* d load / d (v_x v_y v_n rim) */
  double rate[MAX_STATES], rate_by_speed[MAX_STATES][4];
  double load_by_state[4][MAX_STATES], rate_by_state[MAX_STATES][MAX_STATES];
  double slip[2];
} Law;

#define DEEPER 1e-6 /* share of the sinkage by which it is pressed to see its stiffness */

/* Which way a wheel goes, -1 to 1 over `direction_speed`, and its slopes with v_x and rim: the faster of both decides. */
static double direction(const Drive *d, double v, double rim, double slope[2]) {
  const double least = d->direction_speed / UNDECIDED_SHARE, both = least / sqrt(2.0);
  const double top = v * fabs(v) + rim * fabs(rim) + both * (v + rim), bottom_2 = v * v + rim * rim + least * least;
  const double scale = 1.0 / (sqrt(2.0 * bottom_2) * d->direction_speed);
  slope[0] = (2.0 * fabs(v) + both - top * v / bottom_2) * scale;
  slope[1] = (2.0 * fabs(rim) + both - top * rim / bottom_2) * scale;
  return top * scale;
}

static void ask(Step *s, integer spot, int mirrored, int deeper) {
  const Question question = {spot, mirrored, deeper};
  s->questions[s->n_questions++] = question;
}

/* The law in the direction of travel; within the speed `direction_speed` around rest, a blend of both directions.
   While a rover is set down also a little deeper: the normal spring is implicit then. */
static void ask_about(const Drive *d, Step *s, integer index) {
  Spot *spot = s->spots + index;
  double z = direction(d, spot->contact[GEOMETRY_V_X], spot->contact[GEOMETRY_RIM], spot->steep);
  z = smaller(1.0, larger(-1.0, z));
  spot->forwards = 0.5 + 0.25 * z * (3.0 - z * z);
  for (int i = 0; i < 2; ++i) spot->steep[i] *= 0.75 * (1.0 - z * z);
  spot->asked = s->n_questions;
  for (int deeper = 0; deeper <= (d->settling != DRIVING); ++deeper) {
    ask(s, index, spot->forwards <= 0.0, deeper);
    if (spot->forwards > 0.0 && spot->forwards < 1.0) ask(s, index, 1, deeper);
  }
}

static void set_lane(const Drive *d, const Spot *spot, Question question, integer lane, double *contact, double *states) {
  static const int TURNS[N_GEOMETRY] = {[GEOMETRY_V_X] = 1, [GEOMETRY_V_Y] = 1, [GEOMETRY_RIM] = 1};
  const double *own = d->contact_states + spot->wheel * d->n_contact_states;
  for (integer i = 0; i < N_GEOMETRY; ++i)
    contact[i * LANES + lane] = question.mirrored && TURNS[i] ? -spot->contact[i] : spot->contact[i];
  if (question.mirrored) contact[GEOMETRY_AXLE * LANES + lane] = d->n_axles - 1 - spot->contact[GEOMETRY_AXLE];
  if (question.deeper) contact[GEOMETRY_H * LANES + lane] += DEEPER * spot->contact[GEOMETRY_H];
  for (integer i = 0; i < d->n_contact_states; ++i)
    states[i * LANES + lane] = own[i] * (question.mirrored ? d->contact_odd[i] : 1.0);
}

/* A lane's constants, unless it still has them from the step before. */
static void hold_lane(const Drive *d, Step *s, integer place, const double *held) {
  if (s->taken[place] == held) return;
  double *lane = d->held_lanes + (place / LANES) * d->n_held * LANES + place % LANES;
  for (integer i = 0; i < d->n_held; ++i) lane[i * LANES] = held[i];
  s->taken[place] = held;
}

static integer law_size(const Drive *d) { return 4 + 16 + d->n_contact_states * (9 + d->n_contact_states) + 2; }

static void answer_all(const Drive *d, Step *s) {
  const integer size = law_size(d);
  for (integer first = 0; first < s->n_questions; first += LANES) {
    _Alignas(64) double contact[N_GEOMETRY * LANES], states[(MAX_STATES + 1) * LANES];
    for (integer lane = 0; lane < LANES; ++lane) { /* what is over repeats the first */
      integer k = first + lane < s->n_questions ? first + lane : first;
      const Spot *spot = s->spots + s->questions[k].spot;
      set_lane(d, spot, s->questions[k], lane, contact, states);
      hold_lane(d, s, first + lane, spot->held);
    }
    d->contact_law(contact, states, d->held_lanes + first * d->n_held, s->answers + first * size);
  }
}

static void mirror_law(Law *law, integer nx, const double *odd) {
  const double sign[4] = {-1, -1, 1, -1};
  for (int i = 0; i < 4; ++i) {
    law->load[i] *= sign[i];
    for (int j = 0; j < 4; ++j) law->by_speed[i][j] *= sign[i] * sign[j];
    for (integer j = 0; j < nx; ++j) law->load_by_state[i][j] *= sign[i] * odd[j];
  }
  for (integer i = 0; i < nx; ++i) {
    law->rate[i] *= odd[i];
    for (int j = 0; j < 4; ++j) law->rate_by_speed[i][j] *= odd[i] * sign[j];
    for (integer j = 0; j < nx; ++j) law->rate_by_state[i][j] *= odd[i] * odd[j];
  }
  law->slip[0] *= -1;
  law->slip[1] *= -1;
}

/* The answer to question k, whose numbers are LANES apart, in column-major blocks as laws.py writes them. */
static void read_answer(const Drive *d, const Step *s, integer k, Law *law) {
  const integer nx = d->n_contact_states;
  const double *next = s->answers + (k - k % LANES) * law_size(d) + k % LANES;
#define NEXT (next += LANES, next[-LANES])
  for (int i = 0; i < 4; ++i) law->load[i] = NEXT;
  for (int j = 0; j < 4; ++j) for (int i = 0; i < 4; ++i) law->by_speed[i][j] = NEXT;
  for (integer i = 0; i < nx; ++i) law->rate[i] = NEXT;
  for (int j = 0; j < 4; ++j) for (integer i = 0; i < nx; ++i) law->rate_by_speed[i][j] = NEXT;
  for (integer j = 0; j < nx; ++j) for (int i = 0; i < 4; ++i) law->load_by_state[i][j] = NEXT;
  for (integer j = 0; j < nx; ++j) for (integer i = 0; i < nx; ++i) law->rate_by_state[i][j] = NEXT;
  law->slip[0] = NEXT;
  law->slip[1] = NEXT;
#undef NEXT
  if (s->questions[k].mirrored) mirror_law(law, nx, d->contact_odd);
}

static void blend(double *a, const double *b, double share, size_t n) {
  for (size_t i = 0; i < n; ++i) a[i] = share * a[i] + (1.0 - share) * b[i];
}

/* The law of a spot, whose answers begin at k. Its slopes hold the blend's own: near rest they are the stiffest part of a
   resistance that turns with the wheel. Return how many answers it took. */
static integer travel_law(const Drive *d, const Step *s, const Spot *spot, integer k, Law *law) {
  const integer nx = d->n_contact_states;
  read_answer(d, s, k, law);
  if (spot->forwards <= 0.0 || spot->forwards >= 1.0) return 1;
  Law back;
  double load[4], rate[MAX_STATES];
  read_answer(d, s, k + 1, &back);
  for (int i = 0; i < 4; ++i) load[i] = law->load[i] - back.load[i];
  for (integer i = 0; i < nx; ++i) rate[i] = law->rate[i] - back.rate[i];
  blend((double *)law, (const double *)&back, spot->forwards, sizeof(Law) / sizeof(double));
  for (int j = 0; j < 2; ++j) { /* v_x and rim */
    for (int i = 0; i < 4; ++i) law->by_speed[i][3 * j] += load[i] * spot->steep[j];
    for (integer i = 0; i < nx; ++i) law->rate_by_speed[i][3 * j] += rate[i] * spot->steep[j];
  }
  return 2;
}

/* Work out what the contact law holds; again after every change of the soils. */
void rover_pin_hold(const Drive *d) {
  double constants[N_WHEEL + N_SOIL], *row = d->held;
  const double *arguments[2] = {constants, d->contact_parameters};
  for (integer kind = 0; kind < d->n_kinds; ++kind)
    for (integer soil = 0; soil < d->n_soils; ++soil, row += d->n_held) {
      memcpy(constants, d->kinds + N_WHEEL * kind, N_WHEEL * sizeof(double));
      memcpy(constants + N_WHEEL, d->soils + N_SOIL * soil, N_SOIL * sizeof(double));
      double *results[1] = {row};
      d->contact_before(arguments, results, d->work_i, d->work_w, 0);
    }
  memset(d->step->taken, 0, sizeof d->step->taken);
}
