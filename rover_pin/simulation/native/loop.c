/* A whole drive or replay: commands, steps, rows. */

/* A replay's gravity leans forward by a force along the heading: it acts on the whole rover alike. */
static void lean(Drive *d, const Loop *l, double force) {
  double attitude[3];
  const double pull = force / l->mass;
  find_attitude(d->q, attitude);
  d->gravity[0] = l->down[0] + pull * cos(attitude[2]);
  d->gravity[1] = l->down[1] + pull * sin(attitude[2]);
}

/* A replay's soils with tan phi changed by this share. */
static void grip(Drive *d, const Loop *l, double share) {
  for (integer i = 0; i < d->n_soils; ++i)
    d->soils[N_SOIL * i + SOIL_PHI] = atan((1.0 + share) * tan(l->soils_at_rest[N_SOIL * i + SOIL_PHI]));
  rover_pin_hold(d);
}

/* Aim the servos so that they reach the angles of a row: a log tells them as they were under their loads. Each servo is
   expected to give way as in the last row, and as much more as it did there than in the row before. */
static void aim(Drive *d, const Loop *l, integer row) {
  for (integer i = 0; i < d->n_servos; ++i) {
    const double gives = d->servo_target[i] - d->q[d->servo_q[i]];
    d->servo_target[i] = l->steer_rows[row * d->n_servos + i] + 2.0 * gives - l->gave[i];
    l->gave[i] = gives;
  }
}

/* The commands of a row of a replay. */
static void take_row(Drive *d, const Loop *l, integer row) {
  for (integer w = 0; w < d->n_wheels; ++w) d->duty[w] = smaller(1.0, larger(-1.0, l->duty_rows[row * d->n_wheels + w]));
  aim(d, l, row);
  if (l->force_rows) lean(d, l, l->force_rows[row]);
  if (l->grip_rows) grip(d, l, l->grip_rows[row]);
}

/* The rates at the end of this step: straight from row to row. A step that is taken again after the command has moved
   on meets the next step's, which is right again one step later. */
static void hold(Drive *d, const Loop *l) {
  const integer row = l->k / l->per_sample, n = d->n_wheels;
  const double share = (double)(l->k % l->per_sample + 1) / l->per_sample;
  const double *to = l->rate_rows + row * n, *from = row ? to - n : to;
  for (integer w = 0; w < n; ++w) d->held_rate[w] = from[w] + share * (to[w] - from[w]);
}

/* Move a replay towards its logged place and heading by the share of one row. */
static void draw(Drive *d, Loop *l, const double *place) {
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

/* Take the steps that another drive took over this one, whatever they misjudge here. */
static int follow(Drive *d, Loop *l) {
  for (; *l->followed && l->elapsed + 0.5 * *l->followed < (l->k + 1) * l->dt; ++l->followed) {
    d->dt = *l->followed;
    l->elapsed += d->dt;
    const int status = rover_pin_step(d);
    if (status) return status;
  }
  return OK;
}

/* Whether there is a command or a row before step k. */
static int is_border(const Loop *l, integer k) { return k % l->per_control == 0 || k % l->per_sample == 0; }

/* Go on until the last step, the row `until`, a failure, or a question to a controller; say which. */
int rover_pin_run(Drive *d, Loop *l, integer until) {
  while (l->k < l->steps && l->row < until) {
    if (l->asks && l->k % l->per_control == 0 && l->obeyed != l->k) {
      l->obeyed = l->k;
      rover_pin_row(d, l, l->questions + l->asked++ * l->row_size);
      return ASKS;
    }
    if (l->duty_fixed && l->k % l->per_control == 0) command(d, l);
    if (l->duty_rows && l->k % l->per_sample == 0) take_row(d, l, l->k / l->per_sample);
    if (l->rate_rows) hold(d, l);
    l->seen = !l->followed && !l->place_rows && is_border(l, l->k + 1);
    const int status = l->followed ? follow(d, l) : advance(d, l, is_border(l, l->k), l->seen);
    if (status) return status;
    if (++l->k % l->per_sample) continue;
    rover_pin_row(d, l, l->log + l->row * l->row_size);
    const int failed = l->row % l->check_every == 0 && fails(d, l);
    if (l->place_rows) draw(d, l, l->place_rows + 3 * l->row);
    ++l->row;
    if (failed) return FAILS;
  }
  return OK;
}
