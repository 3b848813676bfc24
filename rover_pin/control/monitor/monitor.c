/* One sample of the monitor: faults, how fast the ground digs, and where the belief's particles come to within the
   horizon. monitor.py says why. */
#include <math.h>
#include <string.h>

void rover_pin_monitor_reset(Monitor *m) {
  m->random = 1181783497276652981ULL;
  m->count = m->samples = m->alarm = 0;
  m->smoothed = m->p_stuck = m->p_buried = m->motor = m->sensor = 0.0;
  memset(m->causes, 0, 3 * sizeof(real));
  memset(m->holes, 0, m->n * N_RATES * sizeof(real));
  memset(m->evidence, 0, N_RATES * sizeof(real));
  memset(m->by_way, 0, N_RATES * sizeof(real));
}

/* Whether a reading can be read; P that a motor or a sensor is at fault, from the last samples. */
int rover_pin_monitor_check(Monitor *m, const real *duty, const real *rate, const real *current, const real *posture, integer n_posture) {
  const integer n = m->n;
  int readable = 1, frozen = 0;
  for (integer i = 0; i < n; ++i) readable &= isfinite(rate[i]) && isfinite(current[i]);
  for (integer i = 0; i < n_posture; ++i) readable &= isfinite(posture[i]) != 0;
  if (!readable) {
    m->motor = 0.0;
    m->sensor = 1.0;
    return 0;
  }
  if (m->count == FAULT_ROWS) memmove(m->past, m->past + 3 * n, (FAULT_ROWS - 1) * 3 * n * sizeof(real));
  else ++m->count;
  real *row = m->past + (m->count - 1) * 3 * n, doubt = 0.0;
  for (integer i = 0; i < n; ++i) {
    row[i] = duty[i];
    row[n + i] = rate[i] / m->no_load_rate;
    row[2 * n + i] = current[i] / m->stall_current;
  }
  if (m->count < FAULT_ROWS) return 1;
  for (integer i = 0; i < n; ++i) {
    real mean[3] = {0.0, 0.0, 0.0}, least = INFINITY, most = 0.0;
    int stays = 0;
    for (int c = 0; c < 3; ++c) {
      real low = INFINITY, high = -INFINITY;
      for (integer k = 0; k < FAULT_ROWS; ++k) {
        const real value = m->past[(3 * k + c) * n + i];
        mean[c] += value / FAULT_ROWS;
        low = fmin(low, value);
        high = fmax(high, value);
        if (!c) least = fmin(least, fabs(value));
      }
      stays |= c && low == high;
      most = fmax(most, fabs(mean[c]));
    }
    frozen |= stays && least > TURNS;
    const real sd = hypot(MOTOR_SD * most, MOTOR_NOISE), off = (mean[2] - mean[0] + mean[1]) / sd;
    const real well = exp(-0.5 * off * off) / (sd * SQRT_TURN) * (1.0 - RARE);
    doubt = fmax(doubt, 1.0 - well / (well + 0.5 * RARE));
  }
  m->sensor = frozen;
  m->motor = frozen ? 0.0 : doubt;
  return 1;
}

/* Pull less what slope and holes take, over the weight; slips and holes are `apart` from wheel to wheel. */
static real balance(const Monitor *m, const Belief *b, const real *slips, integer slips_apart, const real *holes, integer holes_apart) {
  real load = 0.0, sum = 0.0;
  for (integer w = 0; w < m->n; ++w) {
    const real own = fmax(b->under[LOAD * m->n + w], 0.0);
    load += own;
    sum += own * (at_slip(m->pulls, slips[w * slips_apart]) - holes[w * holes_apart] / HOLE_LENGTH - b->under[SLOPE * m->n + w]);
  }
  return sum / fmax(load, 1e-9);
}

static void learn(real *evidence, real density, real time) {
  *evidence = (1.0 - time / MEMORY) * *evidence + log(density) * time / CORRELATED;
}

/* Dig on by each rate, and weigh the rates by the balance of forces; uneven ground adds to what is not known of it. With
   time, what slows the rover is told, be it a hole or an obstacle; only with way does the error become another one, and
   tell a hole from an obstacle. */
static void dig(Monitor *m, const Belief *b) {
  const real unknown = BALANCE_SD * BALANCE_SD + b->bend * b->bend + b->wall * b->wall;
  for (integer w = 0; w < m->n; ++w) {
    const real travel = (b->speed + b->under[AHEAD * m->n + w]) / fmax(b->under[LEVEL * m->n + w], LEAST_LEVEL);
    for (integer r = 0; r < N_RATES; ++r) {
      real *hole = m->holes + w * N_RATES + r, rate;
      const real *given[5] = {RATES + r, &travel, b->rim + w, m->radius + w, hole};
      real *result[1] = {&rate};
      deepening(given, result, 0, 0, 0);
      *hole = fmax(*hole + m->period * rate, 0.0);
    }
  }
  if (m->samples < UNSETTLED) return;
  const real moving = fmin(fmax(b->speed / fmax(b->pace, CREEP), 0.0), 1.0);
  for (integer r = 0; r < N_RATES; ++r) {
    const real net = balance(m, b, b->told, 4, m->holes + r, N_RATES);
    const real density = exp(-0.5 * net * net / unknown) + STRAY;
    learn(m->evidence + r, density, m->period);
    learn(m->by_way + r, density, moving * m->period);
  }
}

/* The index of the weight on which a level in [0, 1) falls. */
static integer chosen(const real *weights, integer count, real level) {
  real sum = 0.0, all = 0.0;
  for (integer i = 0; i < count; ++i) all += weights[i];
  for (integer i = 0; i < count; ++i)
    if ((sum += weights[i]) >= level * all) return i;
  return count - 1;
}

/* Weights of the rates of digging, by their evidence. */
static void weigh_rates(const real *evidence, real *weights) {
  real most = evidence[0], sum = 0.0;
  for (integer r = 1; r < N_RATES; ++r) most = fmax(most, evidence[r]);
  for (integer r = 0; r < N_RATES; ++r) sum += weights[r] = PRIOR[r] * exp(evidence[r] - most);
  for (integer r = 0; r < N_RATES; ++r) weights[r] /= sum;
}

/* Probability of each rate of digging, by what the way tells. */
void rover_pin_monitor_rates(const Monitor *m, real *weights) { weigh_rates(m->by_way, weights); }

/* P(buried): each rate's share of draws, by what the way tells of it; a rate without draws is as the others that dig. */
static real weighed(const Monitor *m, const integer *draws, const integer *buried) {
  real weights[N_RATES], p = 0.0;
  integer all = 0, those = 0;
  rover_pin_monitor_rates(m, weights);
  for (integer r = 1; r < N_RATES; ++r) all += draws[r], those += buried[r];
  if (draws[0]) p = weights[0] * buried[0] / draws[0];
  for (integer r = 1; r < N_RATES; ++r)
    if (all) p += weights[r] * (draws[r] ? (real)buried[r] / draws[r] : (real)those / all);
  return p;
}

/* States and draws, a row each: particles and rates of digging by their weights. */
static void draw_ways(Monitor *m, const Belief *b) {
  const integer n = m->n, size = 3 + 2 * n;
  integer order[DRAWS];
  real weights[N_RATES];
  weigh_rates(m->evidence, weights);
  const real offset = next_chance(&m->random);
  for (integer k = 0; k < DRAWS; ++k) order[k] = k;
  for (integer k = DRAWS - 1; k > 0; --k) {
    const integer other = (integer)(next_chance(&m->random) * (k + 1)), kept = order[k];
    order[k] = order[other];
    order[other] = kept;
  }
  for (integer k = 0; k < DRAWS; ++k) {
    real *x = m->ways + k * size, *draw = m->draws + 4 * k;
    const integer particle = chosen(b->weight, b->N, (k + offset) / DRAWS);
    const integer rate = chosen(weights, N_RATES, (order[k] + offset) / DRAWS);
    x[0] = fmin(fmax(b->travel[particle], 0.0), b->pace);
    x[1] = x[2] = 0.0;
    for (integer w = 0; w < n; ++w) {
      x[3 + w] = b->slip[w * b->N + particle];
      x[3 + n + w] = m->holes[w * N_RATES + rate];
    }
    m->rate[k] = rate;
    draw[0] = RATES[rate];
    draw[1] = balance(m, b, x + 3, 1, x + 3 + n, 1);
    draw[2] = STEEPENING * sqrt(-2.0 * log(1.0 - next_chance(&m->random))) * cos(FULL_TURN * next_chance(&m->random));
    draw[3] = b->stalled[particle] > 0.0 || b->no_progress;
  }
}

/* Whether a draw stands at the horizon, with shares of what an obstacle takes and of its holes; the deepest hole then. */
int rover_pin_monitor_ahead(Monitor *m, integer k, real wall, real hole, real *deepest) {
  const integer n = m->n, size = 3 + 2 * n;
  const real *from = m->draws + 4 * k, draw[4] = {hole * from[0], wall * from[1], from[2], wall * from[3]};
  real x[3 + 2 * MAX_WHEELS], next[3 + 2 * MAX_WHEELS], pull[2 * MAX_WHEELS];
  memcpy(x, m->ways + k * size, size * sizeof(real));
  for (integer w = 0; w < n; ++w) x[3 + n + w] *= hole;
  for (int step = 0; step < STEPS; ++step) {
    const real *given[4] = {x, draw, m->ground, pull};
    real *result[1] = {next};
    for (integer w = 0; w < n; ++w) {
      pull[w] = at_slip(m->pulls, x[3 + w]);
      pull[n + w] = at_slip(m->pull_slopes, x[3 + w]);
    }
    ahead_step(given, result, 0, 0, 0);
    memcpy(x, next, size * sizeof(real));
  }
  *deepest = 0.0;
  for (integer w = 0; w < n; ++w) *deepest = fmax(*deepest, x[3 + n + w] / m->radius[w]);
  return x[0] < GRIP * fmax(m->ground[4 * n], LEAST_TOUCH);
}

static void look_ahead(Monitor *m, const Belief *b) {
  const integer n = m->n;
  real load = 0.0, least = m->radius[0];
  integer stuck = 0, free = 0, firm = 0, of_rate[N_RATES] = {0}, buried[N_RATES] = {0};
  for (integer w = 0; w < n; ++w) load += fmax(b->under[LOAD * n + w], 0.0), least = fmin(least, m->radius[w]);
  memset(m->causes, 0, 3 * sizeof(real));
  m->p_buried = 0.0;
  m->p_stuck = b->pace < -CREEP ? b->stuck : 0.0;
  if (b->pace < CREEP || load <= 0.0) return;
  memcpy(m->ground, b->rim, n * sizeof(real));
  memcpy(m->ground + n, b->under, 3 * n * sizeof(real));
  for (integer w = 0; w < n; ++w) m->ground[3 * n + w] = fmax(m->ground[3 * n + w], 0.0);
  m->ground[4 * n] = b->pace;
  draw_ways(m, b);
  for (integer k = 0; k < DRAWS; ++k) {
    real depth, other;
    const int stands = rover_pin_monitor_ahead(m, k, 1.0, 1.0, &depth);
    stuck += stands;
    ++of_rate[m->rate[k]];
    buried[m->rate[k]] += m->sinkage / least + depth > m->buried;
    if (stands) {
      free += rover_pin_monitor_ahead(m, k, 0.0, 1.0, &other);
      firm += rover_pin_monitor_ahead(m, k, 0.0, 0.0, &other);
    }
  }
  m->p_stuck = (real)stuck / DRAWS;
  m->p_buried = weighed(m, of_rate, buried);
  if (m->p_stuck < WORTH) return;
  firm = firm < free ? firm : free;
  m->causes[0] = (real)firm / DRAWS;
  m->causes[1] = (real)(free - firm) / DRAWS;
  m->causes[2] = (real)(stuck - free) / DRAWS;
}

/* What is ahead of a rover, after its belief has taken the sample in. */
void rover_pin_monitor_foresee(Monitor *m, const Belief *b) {
  dig(m, b);
  if (m->samples >= UNSETTLED && m->samples % EVERY == 0) look_ahead(m, b);
  ++m->samples;
  m->smoothed += m->period / SMOOTHED * (m->p_stuck - m->smoothed);
  m->alarm = m->smoothed > (m->alarm ? 0.5 * ALARM : ALARM);
}

/* The most likely cause: 0 grip lost, 1 digging, 2 wall, 3 motor, 4 sensor, 5 cannot tell; -1 where nothing is to be said. */
integer rover_pin_monitor_cause(const Monitor *m) {
  integer most = 0;
  if (fmax(m->motor, m->sensor) > NAMED) return m->motor >= m->sensor ? 3 : 4;
  if (m->p_stuck < WORTH) return -1;
  for (integer c = 1; c < 3; ++c) most = m->causes[c] > m->causes[most] ? c : most;
  return m->causes[most] > NAMED * m->p_stuck ? most : 5;
}
