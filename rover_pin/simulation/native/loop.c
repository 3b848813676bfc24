/* The loop of a drive or a replay: commands, steps, rows. */

/* Apply a force [N] along the heading to a replay, by tilting gravity: it acts on all bodies in proportion to their
   mass. */
static void tilt_gravity(Drive *d, const Loop *l, double force) {
  double attitude[3];
  const double pull = force / l->mass;
  find_attitude(d->q, attitude);
  d->gravity[0] = l->down[0] + pull * cos(attitude[2]);
  d->gravity[1] = l->down[1] + pull * sin(attitude[2]);
}

/* Change tan phi of all soils of a replay by this share. */
static void change_grip(Drive *d, const Loop *l, double share) {
  for (integer i = 0; i < d->n_soils; ++i)
    d->soils[N_SOIL * i + SOIL_PHI] = atan((1.0 + share) * tan(l->soils_at_rest[N_SOIL * i + SOIL_PHI]));
  rover_pin_hold(d);
}

/* Set the servos' targets so that the joints reach the angles of a row: the log holds angles, which a servo under
   load does not reach. The deflection of a servo is extrapolated from the last two rows. */
static void aim_servos(Drive *d, const Loop *l, integer row) {
  for (integer i = 0; i < d->n_servos; ++i) {
    const double deflection = d->servo_target[i] - d->q[d->servo_q[i]];
    d->servo_target[i] = l->steer_rows[row * d->n_servos + i] + 2.0 * deflection - l->gave[i];
    l->gave[i] = deflection;
  }
}

/* Apply the commands of a row of a replay: duties, steering, force, grip. */
static void apply_row(Drive *d, const Loop *l, integer row) {
  for (integer w = 0; w < d->n_wheels; ++w)
    d->duty[w] = smaller(1.0, larger(-1.0, l->duty_rows[row * d->n_wheels + w]));
  aim_servos(d, l, row);
  if (l->force_rows) tilt_gravity(d, l, l->force_rows[row]);
  if (l->grip_rows) change_grip(d, l, l->grip_rows[row]);
}

/* Set the rates that the wheels are held to at the end of this step: linear between rows. A step that is taken again
   after the command has moved on uses the next step's rates; the step after it is right again. */
static void hold_logged_rates(Drive *d, const Loop *l) {
  const integer row = l->k / l->per_sample, n = d->n_wheels;
  const double share = (double)(l->k % l->per_sample + 1) / l->per_sample;
  const double *to = l->rate_rows + row * n, *from = row ? to - n : to;
  for (integer w = 0; w < n; ++w) d->held_rate[w] = from[w] + share * (to[w] - from[w]);
}

/* Move a replay towards its logged position and heading, by the fraction `share` of the distance; `moved` sums up
   the corrections. */
static void draw_to_log(Drive *d, Loop *l, const double *place) {
  double *q = d->q, attitude[3];
  if (isfinite(place[0]) && isfinite(place[1]))
    for (int c = 0; c < 2; ++c) {
      const double step = l->share * (place[c] - q[c]);
      q[c] += step;
      l->moved[c] += step;
    }
  if (!isfinite(place[2])) return;
  find_attitude(q, attitude);
  const double turn = l->share * remainder(place[2] - attitude[2], 2.0 * PI);
  turn_base(q, turn);
  l->moved[2] += turn;
}

/* Take the steps that another drive took over this dt, whatever their forecast error here: a smooth dependence on
   parameters needs equal steps. */
static int follow(Drive *d, Loop *l) {
  for (; *l->followed && l->elapsed + 0.5 * *l->followed < (l->k + 1) * l->dt; ++l->followed) {
    d->dt = *l->followed;
    l->elapsed += d->dt;
    const int status = rover_pin_step(d);
    if (status) return status;
  }
  return OK;
}

/* Whether a command or a row belongs to the instant before step k. */
static int is_border(const Loop *l, integer k) { return k % l->per_control == 0 || k % l->per_sample == 0; }

/* Run until the last step, until the row `until`, until the drive fails, or until a controller in Python has to be
   asked. Return OK, ASKS, FAILS, or the status of a step that failed. */
int rover_pin_run(Drive *d, Loop *l, integer until) {
  while (l->k < l->steps && l->row < until) {
    /* A controller in Python: return with a row of its readings. On the next call `obeyed` shows that the answer is
       in d->duty and d->servo_target. */
    if (l->asks && l->k % l->per_control == 0 && l->obeyed != l->k) {
      l->obeyed = l->k;
      rover_pin_row(d, l, l->questions + l->asked++ * l->row_size);
      return ASKS;
    }
    /* Commands of this step: a built-in controller's, a replay's row, or a replay's wheel rates. */
    if (l->duty_fixed && l->k % l->per_control == 0) command(d, l);
    if (l->duty_rows && l->k % l->per_sample == 0) apply_row(d, l, l->k / l->per_sample);
    if (l->rate_rows) hold_logged_rates(d, l);
    /* One step dt. Where a command or a row follows, the forces at its end are evaluated with it, and serve as `now`
       too. */
    l->seen = !l->followed && !l->place_rows && is_border(l, l->k + 1);
    const int status = l->followed ? follow(d, l) : advance(d, l, is_border(l, l->k), l->seen);
    if (status) return status;
    /* At the end of a sample: write a row, check the drive, and pull a replay towards its log. */
    if (++l->k % l->per_sample) continue;
    rover_pin_row(d, l, l->log + l->row * l->row_size);
    const int failed = l->row % l->check_every == 0 && fails(d, l);
    if (l->place_rows) draw_to_log(d, l, l->place_rows + 3 * l->row);
    ++l->row;
    if (failed) return FAILS;
  }
  return OK;
}
