/* The particle filter of the on-board slip estimate: `rover_pin_sense` takes in one sample of the sensors.

   Each particle has a mode (moving or stalled), a forward speed of the base, and for each wheel a slip and the depth of
   its hole. The particles are in blocks of equal size, and each block assumes another soil. A sample moves the particles
   on by one period and weighs them by the readings. The class OnboardSlip in onboard_slip.py describes the model, laws.py
   the densities, and belief.py the fields of the struct Belief. */
#include <math.h>
#include <string.h>

#define HALF_TURN 3.14159265358979323846

/* Return the state of the random numbers at the beginning of a sample, by SplitMix64 of Steele, Lea and Flood (2014),
   Fast splittable pseudorandom number generators. The state depends on the number of the sample only, so that the number
   of draws in an earlier sample does not change the draws of this sample. */
static unsigned long long chance_of(integer sample) {
  unsigned long long x = (unsigned long long)(sample + 2) * 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31);
}

/* Map a chance in [0, 1) to [low, high). */
static real within(real low, real high, real chance) { return low + (high - low) * chance; }

/* Fill a row of N particles with standard normal numbers, by pairs of Box and Muller. */
static void fill_normal(Belief *b, real *out) {
  for (integer i = 0; i < b->N; i += 2) {
    const real radius = sqrt(-2.0 * log(1.0 - next_chance(&b->random))), turn = 2.0 * HALF_TURN * next_chance(&b->random);
    out[i] = radius * cos(turn);
    out[i + 1] = radius * sin(turn);
  }
}

/* Return the median of the values of all wheels. */
static real median(const real *values, integer n) {
  real sorted[MAX_WHEELS];
  for (integer i = 0; i < n; ++i) {
    integer k = i;
    for (; k > 0 && sorted[k - 1] > values[i]; --k) sorted[k] = sorted[k - 1];
    sorted[k] = values[i];
  }
  return 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]);
}

/* Return the mean absolute deviation of the wheels' values from their median. */
static real deviation(const real *values, integer n) {
  const real middle = median(values, n);
  real sum = 0.0;
  for (integer i = 0; i < n; ++i) sum += fabs(values[i] - middle);
  return sum / n;
}

/* Reset the belief to the start of a drive: any speed is possible, no wheel slips, and no hole is dug. */
void rover_pin_forget(Belief *b) {
  b->random = chance_of(-1);
  b->count = b->k = b->backwards = b->rates_known = b->no_progress = 0;
  b->wall = b->rolled = b->bend = b->reference = b->stuck = b->speed = b->pace = 0.0;
  memset(b->slip, 0, b->n * b->N * sizeof(real));
  memset(b->hole, 0, b->n * b->N * sizeof(real));
  for (integer i = 0; i < b->N; ++i) {
    b->ratio[i] = within(0.0, 1.1, next_chance(&b->random));
    b->stalled[i] = next_chance(&b->random) < 0.1;
    b->distance[i] = 0.0;
    /* The torque that the ground demands does not depend on the soil. Equally likely slips would mean otherwise: in a
       soft soil more of them fit a torque. The weight 1 / softness is the Jacobian dF/ds that corrects this. */
    b->log_weight[i] = -log(b->softness[i / (b->N / b->n_soils)]);
  }
  b->max_factor = 0.0;
  for (integer c = 0; c < b->n_soils; ++c) b->max_factor += b->greatest[c] / b->n_soils;
}

/* Keep a sample, and compute the means of the latest samples and the rates of the posture.

   The means cover fewer samples for wheel rates and currents (RECENT) than for the posture (POSTURE), because the posture
   changes more slowly. The rates are the slopes of straight lines through all samples that are kept. */
static void update_means(Belief *b, const real *sample) {
  const integer n = b->n, p = b->n_posture, size = p + 2 * n;
  if (b->count == WINDOW) memmove(b->samples, b->samples + size, (WINDOW - 1) * size * sizeof(real));
  else ++b->count;
  memcpy(b->samples + (b->count - 1) * size, sample, size * sizeof(real));
  memset(b->mean, 0, size * sizeof(real));
  memset(b->rates, 0, p * sizeof(real));
  real squares = 0.0;
  for (integer k = 0; k < b->count; ++k) {
    /* The times t are relative to their mean, so that the slope is sum(t y) / sum(t^2). */
    const real *row = b->samples + k * size, t = b->period * (k - 0.5 * (b->count - 1));
    const integer ago = b->count - k, of_posture = b->count < POSTURE ? b->count : POSTURE;
    const integer of_rest = b->count < RECENT ? b->count : RECENT;
    squares += t * t;
    for (integer i = 0; i < p; ++i) b->rates[i] += t * row[i];
    for (integer i = 0; i < size; ++i)
      if (ago <= (i < p ? of_posture : of_rest)) b->mean[i] += row[i] / (i < p ? of_posture : of_rest);
  }
  b->rates_known = b->count >= MIN_ROWS;
  for (integer i = 0; i < p; ++i) b->rates[i] = b->rates_known ? b->rates[i] / squares : 0.0;
}

/* Compute slope and load under each wheel, its rim speed over the ground and its torque factor, and look for a wall. */
static void read_ground(Belief *b) {
  const integer n = b->n, p = b->n_posture;
  for (integer i = 0; i < n; ++i) b->torque[i] = b->torque_per_current * b->mean[p + n + i];
  const real *inputs[3] = {b->mean, b->rates, b->torque};
  real *outputs[1] = {b->under};
  ground(inputs, outputs, b->work_i, b->work_w, 0);
  real highest = 0.0;
  for (integer i = 0; i < n; ++i) {
    const real load = b->under[LOAD * n + i];
    /* The mount of the wheel turns with the suspension, which adds to the rate of the wheel relative to the ground. */
    b->rim[i] = b->radius[i] * (b->mean[p + i] + b->under[SWING * n + i]);
    b->informative[i] = load > MIN_LOAD && fabs(b->rim[i]) > MIN_RIM && !b->backwards;
    b->factor[i] = b->torque[i] / (b->radius[i] * fmax(load, MIN_LOAD));
    if (b->informative[i]) highest = fmax(highest, b->factor[i]);
  }
  /* A torque 10 % above the largest torque of the soil means a wall, and 40 % above it a wall for certain. The low-pass
     filter of `wall` avoids that a single noisy torque counts. On even ground there is no wall. */
  b->bend = deviation(b->under + SLOPE * n, n);
  const real excess = b->bend > MIN_BEND ? fmax(highest / b->max_factor - 1.1, 0.0) : 0.0;
  b->wall += b->wall_gain * (fmin(excess / 0.3, 1.0) - b->wall);
}

/* Advance mode, speed and distance of every particle by one period.

   If the rover changes its direction, any speed is possible again. Every particle takes the same number of random
   numbers in every case, so that a small change of one particle does not change the random numbers of the others. */
static void move_particles(Belief *b, int backwards) {
  b->pace = median(b->rim, b->n);
  const real dt = b->period, usual = fmax(fabs(b->pace), b->floor);
  const real stall_chance = (b->stalls + b->wall_stalls * fmin(b->wall, 1.0)) * dt;
  const integer block = b->N / b->n_soils;
  b->reference = backwards ? -usual : usual;
  fill_normal(b, b->chance);
  for (integer i = 0; i < b->N; ++i) {
    real ratio = b->ratio[i];
    int stalled = b->stalled[i] > 0.0;
    real drawn[4];
    for (int c = 0; c < 4; ++c) drawn[c] = next_chance(&b->random);
    if (backwards != b->backwards) {
      ratio = within(0.3, 1.0, drawn[0]);
      stalled = drawn[1] < 0.1;
    }
    const int frees = stalled && drawn[2] < b->frees * dt;
    stalled = (stalled && !frees) || (!stalled && drawn[2] < stall_chance);
    /* A random walk of the speed, with larger steps in a softer soil, so that the steps of the torque are equal in all
       soils. A particle that comes free, or is surprised, gets a new speed. */
    ratio += b->wander * b->softness[i / block] * sqrt(dt) * b->chance[i];
    if (frees) ratio = within(0.0, 0.6, drawn[0]);
    if (!stalled && drawn[3] < b->surprise * dt) ratio = within(-0.2, 1.2, drawn[1]);
    b->ratio[i] = stalled ? 0.03 * b->chance[i] : fmin(fmax(ratio, -0.4), 1.4);
    b->stalled[i] = stalled;
    b->travel[i] = b->reference * b->ratio[i];
    b->distance[i] += b->travel[i] * dt;
  }
  b->backwards = backwards;
  b->rolled += fmax(b->pace, 0.0) * dt;
}

/* Advance slips and holes of all particles by one period, and weigh the particles by the torques of the wheels. */
static void advance_wheels(Belief *b) {
  _Alignas(64) real state[3 * LANES], result[2 * LANES], F[LANES];
  const integer n = b->n, N = b->N;
  /* Relative variance of a torque factor: of the soil and the loads, of bent ground, and of a wall. */
  const real variance[1] = {b->strength * b->strength + b->bend * b->bend + b->wall_error * b->wall * b->wall_error * b->wall};
  for (integer i = 0; i < N; ++i) b->likelihood[i] = 1.0;
  for (integer w = 0; w < n; ++w) {
    const real wheel[4] = {b->under[AHEAD * n + w], b->under[LEVEL * n + w], b->rim[w], b->radius[w]};
    const real reading[2] = {b->factor[w], variance[0]};
    for (integer i = 0; i < N; i += LANES) {
      real *slip = b->slip + w * N + i, *hole = b->hole + w * N + i;
      memcpy(state, b->travel + i, sizeof F);
      memcpy(state + LANES, slip, sizeof F);
      memcpy(state + 2 * LANES, hole, sizeof F);
      wheel_law(state, wheel, result);
      memcpy(slip, result, sizeof F);
      memcpy(hole, result + LANES, sizeof F);
      if (!b->informative[w]) continue;
      const real *factors = b->factors + i / (N / b->n_soils) * N_FACTORS;
      for (int lane = 0; lane < LANES; ++lane) F[lane] = at_slip(factors, slip[lane]);
      torque_law(F, reading, result);
      for (int lane = 0; lane < LANES; ++lane) b->likelihood[i + lane] *= result[lane];
    }
  }
  /* Torques within the time `correlated` have one error, so that a sample counts for period / correlated of a reading. */
  for (integer i = 0; i < N; ++i) b->log_weight[i] += log(b->likelihood[i]) * b->period / b->correlated;
}

/* Add to the logarithm of each particle's weight a law of one number of the particle, times a factor. */
static void weigh(Belief *b, lanes_law law, const real *numbers, const real *shared, real factor) {
  _Alignas(64) real result[LANES];
  for (integer i = 0; i < b->N; i += LANES) {
    law(numbers + i, shared, result);
    for (int lane = 0; lane < LANES; ++lane) b->log_weight[i + lane] += factor * result[lane];
  }
}

/* Weigh the particles by the balance of forces along the ground, if the constants of the resistance are uncertain.

   The pull of the wheels, minus the slope, equals the motion resistance plus the resistance of the holes that the wheels
   climb out of. A rover that stands needs less than this resistance. */
static void weigh_by_balance(Belief *b) {
  const integer n = b->n;
  real load = 0.0, thrust = 0.0, slope = 0.0, share[MAX_WHEELS];
  if (!(b->resistance_sd > 0.0) || b->backwards || !b->rates_known || b->pace < b->floor) return;
  for (integer w = 0; w < n; ++w) load += share[w] = fmax(b->under[LOAD * n + w], 0.0);
  if (load < MIN_LOAD) return;
  for (integer w = 0; w < n; ++w) {
    share[w] /= load;
    thrust += share[w] * b->factor[w];
    slope += share[w] * b->under[SLOPE * n + w];
  }
  const real scale = b->torque_sd * thrust, wall = b->wall_error * b->wall;
  const real variance[1] = {b->resistance_sd * b->resistance_sd + scale * scale + b->bend * b->bend + wall * wall};
  for (integer i = 0; i < b->N; ++i) {
    real excess = thrust - slope - b->resistance;
    for (integer w = 0; w < n; ++w) excess -= share[w] * b->hole[w * b->N + i] / b->hole_length;
    const real moving = fmin(fabs(b->ratio[i]) / STANDING_RATIO, 1.0);
    b->likelihood[i] = excess < 0.0 ? excess * moving : excess;
  }
  weigh(b, balance_law, b->likelihood, variance, b->period / b->balance_correlated);
}

/* Once in every stride: weigh the particles by how the posture has changed over STILL and over PAST - 1 strides.

   On bent ground, a rover that moves changes its posture. If the posture stays the same although the rims have turned,
   the rover does not get on (`no_progress`). */
static void weigh_by_posture(Belief *b) {
  const integer n = b->n, row = b->k / b->stride;
  if (b->k % b->stride) return;
  /* Store the present heights, bend, rim travel and distances in the ring of the latest PAST strides. */
  real *now = b->past + (row % PAST) * (n + 2), changed[MAX_WHEELS], bend = 0.0, change = 0.0;
  memcpy(now, b->under + HEIGHT * n, n * sizeof(real));
  now[n] = b->bend;
  now[n + 1] = b->rolled;
  memcpy(b->past_distance + (row % PAST) * b->N, b->distance, b->N * sizeof(real));
  for (integer back = 1; back <= PAST - 1 && back <= row; ++back) {
    const real *then = b->past + ((row - back) % PAST) * (n + 2);
    bend += then[n];
    for (integer i = 0; i < n; ++i) changed[i] = now[i] - then[i];
    /* The largest change within the time counts, because a wheel may rise and fall again. */
    change = fmax(change, deviation(changed, n));
    if (back != STILL && back != PAST - 1) continue;
    const real mean = (bend + b->bend) / (back + 1), rolled = b->rolled - then[n + 1];
    for (integer i = 0; i < b->N; ++i) b->likelihood[i] = b->distance[i] - b->past_distance[((row - back) % PAST) * b->N + i];
    const real shared[2] = {change, mean};
    weigh(b, still_law, b->likelihood, shared, 2.0 / STILL);
    if (back == PAST - 1)
      b->no_progress = mean > MIN_BEND && rolled > b->min_roll && change < fmax(0.3 * rolled * mean, b->settled);
  }
}

/* Scale the weights to the sum 1, and compute the estimates: means and SDs of slips and holes, P(the rover stands). */
static void compute_estimates(Belief *b) {
  const integer n = b->n, N = b->N;
  real highest = b->log_weight[0], sum = 0.0;
  for (integer i = 0; i < N; ++i) highest = fmax(highest, b->log_weight[i]);
  for (integer i = 0; i < N; ++i) sum += b->weight[i] = exp(b->log_weight[i] -= highest);
  const real shift = log(sum / N); /* makes log_weight the logarithm of N times the weight */
  b->stuck = b->speed = 0.0;
  for (integer i = 0; i < N; ++i) {
    const real p = b->weight[i] /= sum;
    b->log_weight[i] -= shift;
    b->speed += p * b->travel[i];
    if (b->stalled[i] > 0.0 || b->ratio[i] < STANDING_RATIO) b->stuck += p;
  }
  b->stuck = b->no_progress ? 1.0 : fmin(b->stuck, 1.0);
  for (integer w = 0; w < n; ++w) {
    real s = 0.0, ss = 0.0, d = 0.0, dd = 0.0;
    const real *slip = b->slip + w * N, *hole = b->hole + w * N;
    for (integer i = 0; i < N; ++i) s += b->weight[i] * slip[i], d += b->weight[i] * hole[i];
    for (integer i = 0; i < N; ++i) {
      ss += b->weight[i] * (slip[i] - s) * (slip[i] - s);
      dd += b->weight[i] * (hole[i] - d) * (hole[i] - d);
    }
    real *estimates = b->estimates + 4 * w;
    estimates[0] = fmin(fmax(s, -1.0), 1.0); estimates[1] = sqrt(ss);
    estimates[2] = d; estimates[3] = sqrt(dd);
  }
}

/* Reorder a row of N particles: each particle gets the value of its parent. */
static void copy_parents(Belief *b, real *row) {
  for (integer i = 0; i < b->N; ++i) b->chance[i] = row[b->parent[i]];
  memcpy(row, b->chance, b->N * sizeof(real));
}

/* Compute the probability of each soil, and draw new particles of equal weight in each block that needs them.

   A block needs new particles if few of them have most of its weight. The new particles are copies of the old ones, in
   proportion to the old weights; their common weight keeps the probability of the soil. The draws are evenly spaced
   (systematic resampling), which adds less noise than independent draws. A block is drawn from itself only, so that no
   soil is lost. A soil whose particles have not found the speed of the rover yet seems improbable for a while, so that
   the evidence against a soil is limited, and is forgotten: within the time `memory`, and sooner after the start. */
static void resample(Belief *b) {
  const integer M = b->N / b->n_soils;
  const real memory = fmin(b->memory, 0.5 * b->period * (b->k + 2));
  integer changed = 0;
  real most = 0.0;
  for (integer c = 0; c < b->n_soils; ++c) {
    b->p_soil[c] = 0.0;
    for (integer i = 0; i < M; ++i) b->p_soil[c] += b->weight[c * M + i];
    most = fmax(most, b->p_soil[c]);
  }
  b->max_factor = 0.0;
  for (integer c = 0; c < b->n_soils; ++c) {
    const real *weight = b->weight + c * M, whole = fmax(b->p_soil[c], 1e-300);
    b->max_factor += b->p_soil[c] * b->greatest[c];
    const real evidence = log(whole * b->n_soils);
    const real kept = log(fmax(whole, LEAST_ODDS * most) * b->n_soils) * (1.0 - b->period / memory);
    const real first = next_chance(&b->random);
    real squares = 0.0, sum = weight[0];
    for (integer i = 0; i < M; ++i) squares += weight[i] * weight[i];
    const int few = whole * whole < 0.5 * M * squares;
    integer k = 0;
    for (integer i = 0; i < M; ++i) {
      while (few && k < M - 1 && sum < (i + first) / M * whole) sum += weight[++k];
      b->parent[c * M + i] = c * M + (few ? k : i);
      b->log_weight[c * M + i] = few ? kept : b->log_weight[c * M + i] - evidence + kept;
    }
    changed += few;
  }
  if (!changed) return;
  real *rows[] = {b->ratio, b->stalled, b->travel, b->distance};
  for (int r = 0; r < 4; ++r) copy_parents(b, rows[r]);
  for (integer w = 0; w < b->n; ++w) copy_parents(b, b->slip + w * b->N), copy_parents(b, b->hole + w * b->N);
  for (integer r = 0; r < PAST; ++r) copy_parents(b, b->past_distance + r * b->N);
  for (integer r = 0; r < b->lag + 1; ++r) copy_parents(b, b->past_travel + r * b->N);
}

/* Weigh the particles by visual odometry: `late` is the measured speed `lag` samples ago, or NaN if there is none. */
static void weigh_by_odometry(Belief *b, real late) {
  const integer rows = b->lag + 1;
  memcpy(b->past_travel + (b->k % rows) * b->N, b->travel, b->N * sizeof(real));
  if (!isfinite(late) || b->k < b->lag) return;
  const real *then = b->past_travel + ((b->k - b->lag) % rows) * b->N;
  for (integer i = 0; i < b->N; ++i) {
    const real error = (late - then[i]) / b->odometry_sd;
    b->log_weight[i] -= 0.5 * error * error;
  }
}

/* Update the belief by one sample: posture, wheel rates and currents.

   `backwards` is 1 if the duties drive the rover backwards. `late` is the speed by visual odometry, or NaN. */
void rover_pin_sense(Belief *b, const real *sample, integer backwards, real late) {
  b->random = chance_of(b->k);
  update_means(b, sample);
  read_ground(b);
  move_particles(b, backwards != 0);
  advance_wheels(b);
  /* On bent ground, the wheels rise relative to each other at a rate that depends on the speed. */
  if (b->rates_known) {
    const real shared[3] = {deviation(b->under + RISE * b->n, b->n), b->bend, fmin(b->wall, 1.0)};
    weigh(b, fold_law, b->travel, shared, b->period / b->rise_correlated);
  }
  weigh_by_balance(b);
  weigh_by_posture(b);
  if (b->lag) weigh_by_odometry(b, late);
  compute_estimates(b);
  /* When few particles of a block have most of its weight, the others are replaced by copies of them. */
  resample(b);
  ++b->k;
}
