/* The monitor of a rover: at every sample it looks for faults, weighs how fast the soil digs, and forecasts from the
   particles of the belief whether the rover will be stuck or buried within the horizon.

   The class Monitor in monitor.py describes the method, and source.py the constants and the fields of the struct. */
#include <math.h>
#include <string.h>

/* Reset the monitor to the start of a drive. */
void rover_pin_monitor_reset(Monitor *m) {
  m->random = 1181783497276652981ULL;
  m->count = m->samples = m->alarm = 0;
  m->smoothed = m->p_stuck = m->p_buried = m->motor = m->sensor = 0.0;
  memset(m->causes, 0, 3 * sizeof(real));
  memset(m->holes, 0, m->n * N_RATES * sizeof(real));
  memset(m->evidence, 0, N_RATES * sizeof(real));
  memset(m->by_way, 0, N_RATES * sizeof(real));
}

/* Look for faults in the latest samples. Return 1 if all readings are finite, so that the belief may use them.

   A motor is judged by its law, i R = delta V - K omega, which reads current = duty - rate in fractions of the largest
   values. A sensor is frozen if its readings do not change at all while its motor is driven. */
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
  /* Keep duty, rate and current of the latest samples, as fractions of the largest values. */
  if (m->count == FAULT_ROWS) memmove(m->past, m->past + 3 * n, (FAULT_ROWS - 1) * 3 * n * sizeof(real));
  else ++m->count;
  real *row = m->past + (m->count - 1) * 3 * n, p_fault = 0.0;
  for (integer i = 0; i < n; ++i) {
    row[i] = duty[i];
    row[n + i] = rate[i] / m->no_load_rate;
    row[2 * n + i] = current[i] / m->stall_current;
  }
  if (m->count < FAULT_ROWS) return 1;
  for (integer i = 0; i < n; ++i) {
    real mean[3] = {0.0, 0.0, 0.0}, least_duty = INFINITY, largest = 0.0;
    int constant = 0;
    for (int c = 0; c < 3; ++c) {
      real low = INFINITY, high = -INFINITY;
      for (integer k = 0; k < FAULT_ROWS; ++k) {
        const real value = m->past[(3 * k + c) * n + i];
        mean[c] += value / FAULT_ROWS;
        low = fmin(low, value);
        high = fmax(high, value);
        if (!c) least_duty = fmin(least_duty, fabs(value));
      }
      constant |= c && low == high;
      largest = fmax(largest, fabs(mean[c]));
    }
    frozen |= constant && least_duty > TURNS;
    /* Bayes' rule: a sound motor has a normal error, a faulty motor an error with equal density from -1 to 1. */
    const real sd = hypot(MOTOR_SD * largest, MOTOR_NOISE), error = (mean[2] - mean[0] + mean[1]) / sd;
    const real sound = exp(-0.5 * error * error) / (sd * SQRT_TURN) * (1.0 - RARE);
    p_fault = fmax(p_fault, 1.0 - sound / (sound + 0.5 * RARE));
  }
  m->sensor = frozen;
  m->motor = frozen ? 0.0 : p_fault;
  return 1;
}

/* Return the balance of forces over the weight: the pull minus the resistance of slope and holes, by the loads.

   slips_apart and holes_apart are the distances from one wheel to the next in the arrays. */
static real balance(const Monitor *m, const Belief *b, const real *slips, integer slips_apart, const real *holes, integer holes_apart) {
  real load = 0.0, sum = 0.0;
  for (integer w = 0; w < m->n; ++w) {
    const real wheel_load = fmax(b->under[LOAD * m->n + w], 0.0);
    load += wheel_load;
    sum += wheel_load * (at_slip(m->pulls, slips[w * slips_apart]) - holes[w * holes_apart] / HOLE_LENGTH - b->under[SLOPE * m->n + w]);
  }
  return sum / fmax(load, 1e-9);
}

/* Add the log density of one balance to the evidence, which fades with the time constant MEMORY. */
static void learn(real *evidence, real density, real time) {
  *evidence = (1.0 - time / MEMORY) * *evidence + log(density) * time / CORRELATED;
}

/* Deepen the holes by each rate of digging, and weigh the rates by the balance of forces.

   The balance must be zero to within its error, which uneven ground and walls increase. The evidence of the whole time
   shows how much the rover is slowed, by a hole or by an obstacle. Only the evidence of the driven distance distinguishes
   both, because a rover meets another obstacle there, but has the same soil. */
static void dig(Monitor *m, const Belief *b) {
  const real variance = BALANCE_SD * BALANCE_SD + b->bend * b->bend + b->wall * b->wall;
  for (integer w = 0; w < m->n; ++w) {
    const real travel = (b->speed + b->under[AHEAD * m->n + w]) / fmax(b->under[LEVEL * m->n + w], MIN_LEVEL);
    for (integer r = 0; r < N_RATES; ++r) {
      real *hole = m->holes + w * N_RATES + r, rate;
      const real *given[5] = {RATES + r, &travel, b->rim + w, m->radius + w, hole};
      real *result[1] = {&rate};
      deepening(given, result, 0, 0, 0);
      *hole = fmax(*hole + m->period * rate, 0.0);
    }
  }
  if (m->samples < UNSETTLED) return;
  const real moving = fmin(fmax(b->speed / fmax(b->pace, MIN_PACE), 0.0), 1.0);
  for (integer r = 0; r < N_RATES; ++r) {
    const real net = balance(m, b, b->estimates, 4, m->holes + r, N_RATES);
    const real density = exp(-0.5 * net * net / variance) + STRAY;
    learn(m->evidence + r, density, m->period);
    learn(m->by_way + r, density, moving * m->period);
  }
}

/* Return the index of the weight at which the cumulative sum reaches a level in [0, 1). */
static integer chosen(const real *weights, integer count, real level) {
  real sum = 0.0, all = 0.0;
  for (integer i = 0; i < count; ++i) all += weights[i];
  for (integer i = 0; i < count; ++i)
    if ((sum += weights[i]) >= level * all) return i;
  return count - 1;
}

/* Compute the posterior probabilities of the rates of digging from their evidence and PRIOR. */
static void weigh_rates(const real *evidence, real *weights) {
  real highest = evidence[0], sum = 0.0;
  for (integer r = 1; r < N_RATES; ++r) highest = fmax(highest, evidence[r]);
  for (integer r = 0; r < N_RATES; ++r) sum += weights[r] = PRIOR[r] * exp(evidence[r] - highest);
  for (integer r = 0; r < N_RATES; ++r) weights[r] /= sum;
}

/* Compute the probability of each rate of digging by the evidence of the driven distance. */
void rover_pin_monitor_rates(const Monitor *m, real *weights) { weigh_rates(m->by_way, weights); }

/* Return P(buried): the fraction of buried particles of each rate of digging, weighted by the rate's probability.

   A rate without particles gets the fraction of all particles with a rate above 0. */
static real buried_probability(const Monitor *m, const integer *draws, const integer *buried) {
  real weights[N_RATES], p = 0.0;
  integer digging = 0, digging_buried = 0;
  rover_pin_monitor_rates(m, weights);
  for (integer r = 1; r < N_RATES; ++r) digging += draws[r], digging_buried += buried[r];
  if (draws[0]) p = weights[0] * buried[0] / draws[0];
  for (integer r = 1; r < N_RATES; ++r)
    if (digging) p += weights[r] * (draws[r] ? (real)buried[r] / draws[r] : (real)digging_buried / digging);
  return p;
}

/* Draw the particles of the forecast, with a rate of digging each, in proportion to their weights.

   Both draws are evenly spaced. The rates are drawn in shuffled order, so that they do not depend on the particles. */
static void draw_particles(Monitor *m, const Belief *b) {
  const integer n = m->n, size = 3 + 2 * n;
  integer order[DRAWS];
  real weights[N_RATES];
  weigh_rates(m->evidence, weights);
  const real offset = next_chance(&m->random);
  /* Fisher and Yates' shuffle. */
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
    /* The resistance that slope and holes do not explain is an obstacle. */
    draw[1] = balance(m, b, x + 3, 1, x + 3 + n, 1);
    draw[2] = STEEPENING * sqrt(-2.0 * log(1.0 - next_chance(&m->random))) * cos(FULL_TURN * next_chance(&m->random));
    draw[3] = b->stalled[particle] > 0.0 || b->no_progress;
  }
}

/* Continue a particle to the horizon. Return 1 if the rover is then stuck; `deepest` is then its deepest hole over r.

   `wall` and `hole` are factors on the resistance of the obstacle and on the holes: 1 for the forecast, 0 to find its
   cause. */
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
  return x[0] < GRIP * fmax(m->ground[4 * n], MIN_TOUCH);
}

/* Forecast P(stuck), P(buried) and the probabilities of the causes. In reverse, P(stuck) is the belief's present one. */
static void forecast(Monitor *m, const Belief *b) {
  const integer n = m->n;
  real load = 0.0, smallest = m->radius[0];
  integer stuck = 0, without_wall = 0, without_both = 0, of_rate[N_RATES] = {0}, buried[N_RATES] = {0};
  for (integer w = 0; w < n; ++w) load += fmax(b->under[LOAD * n + w], 0.0), smallest = fmin(smallest, m->radius[w]);
  memset(m->causes, 0, 3 * sizeof(real));
  m->p_buried = 0.0;
  m->p_stuck = b->pace < -MIN_PACE ? b->stuck : 0.0;
  if (b->pace < MIN_PACE || load <= 0.0) return;
  memcpy(m->ground, b->rim, n * sizeof(real));
  memcpy(m->ground + n, b->under, 3 * n * sizeof(real));
  for (integer w = 0; w < n; ++w) m->ground[3 * n + w] = fmax(m->ground[3 * n + w], 0.0);
  m->ground[4 * n] = b->pace;
  draw_particles(m, b);
  for (integer k = 0; k < DRAWS; ++k) {
    real depth, other;
    const int is_stuck = rover_pin_monitor_ahead(m, k, 1.0, 1.0, &depth);
    stuck += is_stuck;
    ++of_rate[m->rate[k]];
    buried[m->rate[k]] += m->sinkage / smallest + depth > m->buried;
    /* A stuck particle is repeated without the obstacle, and without obstacle and holes: is it still stuck? */
    if (is_stuck) {
      without_wall += rover_pin_monitor_ahead(m, k, 0.0, 1.0, &other);
      without_both += rover_pin_monitor_ahead(m, k, 0.0, 0.0, &other);
    }
  }
  m->p_stuck = (real)stuck / DRAWS;
  m->p_buried = buried_probability(m, of_rate, buried);
  if (m->p_stuck < WORTH) return;
  without_both = without_both < without_wall ? without_both : without_wall;
  m->causes[0] = (real)without_both / DRAWS;
  m->causes[1] = (real)(without_wall - without_both) / DRAWS;
  m->causes[2] = (real)(stuck - without_wall) / DRAWS;
}

/* Update the monitor by one sample, after the belief has been updated by the same sample. */
void rover_pin_monitor_foresee(Monitor *m, const Belief *b) {
  dig(m, b);
  if (m->samples >= UNSETTLED && m->samples % EVERY == 0) forecast(m, b);
  ++m->samples;
  m->smoothed += m->period / SMOOTHING_TIME * (m->p_stuck - m->smoothed);
  m->alarm = m->smoothed > (m->alarm ? 0.5 * ALARM : ALARM);
}

/* Return the most likely cause: 0 lost grip, 1 digging, 2 wall, 3 motor, 4 sensor, 5 cannot tell; -1 if P(stuck) is small
   and nothing is faulty. */
integer rover_pin_monitor_cause(const Monitor *m) {
  integer likeliest = 0;
  if (fmax(m->motor, m->sensor) > NAMED) return m->motor >= m->sensor ? 3 : 4;
  if (m->p_stuck < WORTH) return -1;
  for (integer c = 1; c < 3; ++c) likeliest = m->causes[c] > m->causes[likeliest] ? c : likeliest;
  return m->causes[likeliest] > NAMED * m->p_stuck ? likeliest : 5;
}
