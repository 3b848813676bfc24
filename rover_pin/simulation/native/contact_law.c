/* The contact law: the generated function of the contact effects, evaluated for all patches of all wheels together,
   LANES at a time. Each patch becomes a spot, each spot asks one to four questions, and each answer is a Law. */

/* Weight gamma of the step's end in the solve for the speeds. 1, implicit Euler, sets a rover down. */
static double implicit_share(const Drive *d) { return d->settling ? 1.0 : GAMMA; }

/* Weight of the step's end in the effects' own states. 1/2, the midpoint rule, is used while driving. */
static double state_share(const Drive *d) { return d->settling ? 1.0 : 0.5; }

/* Whether a degree of freedom slides the base along the ground: its x, y and yaw. A rover that is set down is held
   in them. */
static int slides(integer dof) { return dof == 0 || dof == 1 || dof == 5; }

/* Output of the contact law at one patch. */
typedef struct {
  double load[4];                           /* f_t, f_y, f_n [N], torque [N m] */
  double by_speed[4][4];                    /* d load / d (v_x, v_y, v_n, rim), all speeds in m/s */
  double rate[MAX_STATES], rate_by_speed[MAX_STATES][4]; /* dx/dt of the effects' states, and its slopes */
  double load_by_state[4][MAX_STATES], rate_by_state[MAX_STATES][MAX_STATES];
  double slip[2];                           /* S and S_y */
} Law;

#define DEEPER 1e-6 /* share of the sinkage by which a patch is pressed deeper to find its stiffness */

/* Direction of travel of a wheel, from -1 (backwards) to 1 over the range `direction_speed`, and its slopes with v_x
   and rim. The faster of rim and travel decides; plain/law.py gives the formula and the reason. */
static double direction(const Drive *d, double v, double rim, double slope[2]) {
  const double least = d->direction_speed / UNDECIDED_SHARE, both = least / sqrt(2.0);
  const double top = v * fabs(v) + rim * fabs(rim) + both * (v + rim), bottom_2 = v * v + rim * rim + least * least;
  const double scale = 1.0 / (sqrt(2.0 * bottom_2) * d->direction_speed);
  slope[0] = (2.0 * fabs(v) + both - top * v / bottom_2) * scale;
  slope[1] = (2.0 * fabs(rim) + both - top * rim / bottom_2) * scale;
  return top * scale;
}

/* Add a question about a spot. */
static void ask(Step *s, integer spot, int mirrored, int deeper) {
  const Question question = {spot, mirrored, deeper};
  s->questions[s->n_questions++] = question;
}

/* Ask for the law of a spot in the direction of travel. Within `direction_speed` around rest both directions are
   blended with the smooth weight `forwards`. While a rover is set down, each question is asked once more for a
   slightly larger sinkage, because the normal spring is implicit then. */
static void ask_for_law(const Drive *d, Step *s, integer index) {
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

/* Write the inputs of a question into one SIMD lane. For backward travel the contact is mirrored: speeds along and
   across the wheel change sign, the first axle becomes the last, odd states change sign. */
static void set_lane(const Drive *d, const Spot *spot, Question question, integer lane, double *contact,
                     double *states) {
  static const int TURNS[N_GEOMETRY] = {[GEOMETRY_V_X] = 1, [GEOMETRY_V_Y] = 1, [GEOMETRY_RIM] = 1};
  const double *own = d->contact_states + spot->wheel * d->n_contact_states;
  for (integer i = 0; i < N_GEOMETRY; ++i)
    contact[i * LANES + lane] = question.mirrored && TURNS[i] ? -spot->contact[i] : spot->contact[i];
  if (question.mirrored) contact[GEOMETRY_AXLE * LANES + lane] = d->n_axles - 1 - spot->contact[GEOMETRY_AXLE];
  if (question.deeper) contact[GEOMETRY_H * LANES + lane] += DEEPER * spot->contact[GEOMETRY_H];
  for (integer i = 0; i < d->n_contact_states; ++i)
    states[i * LANES + lane] = own[i] * (question.mirrored ? d->contact_odd[i] : 1.0);
}

/* Write the precomputed constants of a question's wheel and soil into its lane, unless the lane still holds them
   from the step before. */
static void set_lane_constants(const Drive *d, Step *s, integer place, const double *held) {
  if (s->taken[place] == held) return;
  double *lane = d->held_lanes + (place / LANES) * d->n_held * LANES + place % LANES;
  for (integer i = 0; i < d->n_held; ++i) lane[i * LANES] = held[i];
  s->taken[place] = held;
}

/* Numbers in one answer of the law. */
static integer law_size(const Drive *d) { return 4 + 16 + d->n_contact_states * (9 + d->n_contact_states) + 2; }

/* Evaluate the law for all questions. */
static void evaluate_laws(const Drive *d, Step *s) {
  /* LANES questions are answered by one call of the law. */
  const integer size = law_size(d);
  for (integer first = 0; first < s->n_questions; first += LANES) {
    _Alignas(64) double contact[N_GEOMETRY * LANES], states[(MAX_STATES + 1) * LANES];
    /* lanes without a question repeat the first, so that no lane computes with arbitrary numbers */
    for (integer lane = 0; lane < LANES; ++lane) {
      integer k = first + lane < s->n_questions ? first + lane : first;
      const Spot *spot = s->spots + s->questions[k].spot;
      set_lane(d, spot, s->questions[k], lane, contact, states);
      set_lane_constants(d, s, first + lane, spot->held);
    }
    d->contact_law(contact, states, d->held_lanes + first * d->n_held, s->answers + first * size);
  }
}

/* Mirror an answer that was asked for backward travel: f_t, f_y, torque and the slips change sign, and so do slopes
   between quantities of unequal parity. */
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

/* Read the answer to question k. Its numbers lie LANES apart, in column-major blocks, in the order that laws.py
   writes. */
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

/* a <- share a + (1 - share) b. */
static void blend(double *a, const double *b, double share, size_t n) {
  for (size_t i = 0; i < n; ++i) a[i] = share * a[i] + (1.0 - share) * b[i];
}

/* Write the law of a spot whose answers begin at question k, and return the number of its answers. The slopes
   include the slope of the blend itself: near rest it is the stiffest part of a resistance whose direction turns
   with the wheel. */
static integer travel_law(const Drive *d, const Step *s, const Spot *spot, integer k, Law *law) {
  const integer nx = d->n_contact_states;
  read_answer(d, s, k, law);
  /* Away from rest one direction decides alone. */
  if (spot->forwards <= 0.0 || spot->forwards >= 1.0) return 1;
  Law back;
  double load[4], rate[MAX_STATES];
  read_answer(d, s, k + 1, &back);
  for (int i = 0; i < 4; ++i) load[i] = law->load[i] - back.load[i];
  for (integer i = 0; i < nx; ++i) rate[i] = law->rate[i] - back.rate[i];
  blend((double *)law, (const double *)&back, spot->forwards, sizeof(Law) / sizeof(double));
  for (int j = 0; j < 2; ++j) { /* slopes with v_x (0) and rim (3) */
    for (int i = 0; i < 4; ++i) law->by_speed[i][3 * j] += load[i] * spot->steep[j];
    for (integer i = 0; i < nx; ++i) law->rate_by_speed[i][3 * j] += rate[i] * spot->steep[j];
  }
  return 2;
}

/* Precompute the part of the contact law that depends on constants only, for every kind of wheel on every soil. To
   be called after every change of the soils. */
void rover_pin_hold(const Drive *d) {
  double constants[N_WHEEL + N_SOIL], *row = d->held;
  const double *arguments[2] = {constants, d->contact_parameters};
  /* Constants of the wheel, then of the soil, as laws.py orders them. */
  for (integer kind = 0; kind < d->n_kinds; ++kind)
    for (integer soil = 0; soil < d->n_soils; ++soil, row += d->n_held) {
      memcpy(constants, d->kinds + N_WHEEL * kind, N_WHEEL * sizeof(double));
      memcpy(constants + N_WHEEL, d->soils + N_SOIL * soil, N_SOIL * sizeof(double));
      double *results[1] = {row};
      d->contact_before(arguments, results, d->work_i, d->work_w, 0);
    }
  /* No lane holds valid constants any more. */
  memset(d->step->taken, 0, sizeof d->step->taken);
}

/* Spots: the patches of all wheels are pooled, so that the SIMD lanes stay full. */

static void add_spots(const Drive *d, Step *s);

/* Add a patch as a spot: its directions t (along the ground, forward) and l (to the left), the speeds of the wheel
   along them, and its questions. A full pool is evaluated first. */
static void add_spot(const Drive *d, Step *s, integer index, const Patch *patch, int airborne) {
  if (s->n_spots == MAX_SPOTS) add_spots(d, s);
  const Wheel *w = s->wheels + index;
  Spot *spot = s->spots + s->n_spots;
  spot->patch = *patch;
  spot->wheel = index;
  spot->airborne = airborne;
  const double *N = spot->patch.normal, r = d->radius[index];
  cross(w->axle, N, spot->t);
  unit(spot->t);
  cross(N, spot->t, spot->l);
  const double contact[N_GEOMETRY] = {patch->sinkage, dot(w->velocity, spot->t), dot(w->velocity, spot->l),
                                      -dot(w->velocity, N), r * w->spin, w->centre[0], (double)d->axle[index]};
  memcpy(spot->contact, contact, sizeof contact);
  spot->held = d->held + d->n_held * (d->kind[index] * d->n_soils + spot->patch.ground);
  ask_for_law(d, s, s->n_spots++);
}

/* Set the sums of a wheel to zero. */
static void clear_load(const Drive *d, WheelLoad *sum) {
  memset(sum, 0, offsetof(WheelLoad, gain));
  for (integer i = 0; i < d->n_contact_states; ++i) {
    sum->gain[i] = 0.0;
    for (int c = 0; c < 4; ++c) sum->gain_slope[i][c] = 0.0;
  }
  if (d->settling) memset(sum->spring, 0, sizeof sum->spring);
}

/* Find the patches of a wheel and add them as spots. */
static void add_wheel_spots(const Drive *d, Step *s, integer index) {
  const Wheel *wheel = s->wheels + index;
  const Patch *patches = (const Patch *)d->patches;
  clear_load(d, s->loads + index);
  memset(d->record + index * N_RECORD, 0, RECORD_TORQUE * sizeof(double)); /* the motor's entries follow and stay */
  integer touching = wheel_patches(d, wheel, index, d->record + index * N_RECORD + RECORD_SINKAGE);
  for (integer k = 0; k < touching; ++k) add_spot(d, s, index, patches + k, 0);
  if (touching || !d->n_contact_states) return;
  const Patch patch = {.sinkage = 1e-9, .n_t = 1.0, .normal = {wheel->up[0], wheel->up[1], wheel->up[2]}};
  /* in the air: a spot without a share of the load, so that the effects' states go on */
  add_spot(d, s, index, &patch, 1);
}

/* While a rover is set down, the normal spring is implicit too: return how much the load rises with depth over half
   a step. With the rover held in hand, nothing else changes with the speeds. */
static void find_stiffness(const Drive *d, const Step *s, const Spot *spot, integer k, Law *law, double *stiffness) {
  Law pushed;
  travel_law(d, s, spot, k, &pushed);
  for (int i = 0; i < 4; ++i)
    stiffness[i] = 0.5 * d->dt * (pushed.load[i] - law->load[i]) / (DEEPER * spot->contact[GEOMETRY_H]);
  if (d->settling == IN_HAND) {
    memset(law->by_speed, 0, sizeof law->by_speed);
    memset(law->load_by_state, 0, sizeof law->load_by_state);
  }
}
