/* One sample of the on-board belief: particles of travel, slips and holes, moved on and weighed. belief.py says why. */
#include <math.h>
#include <string.h>

#define HALF_TURN 3.14159265358979323846

/* Where the chances of a sample begin: SplitMix64 of Steele, Lea and Flood (2014), Fast splittable pseudorandom number
   generators. What an earlier sample drew does not move them. */
static unsigned long long chance_of(integer sample) {
  unsigned long long x = (unsigned long long)(sample + 2) * 0x9E3779B97F4A7C15ULL;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31);
}

static real within(real low, real high, real chance) { return low + (high - low) * chance; }

static void fill_normal(Belief *b, real *out) { /* Box and Muller's pairs */
  for (integer i = 0; i < b->N; i += 2) {
    const real far = sqrt(-2.0 * log(1.0 - next_chance(&b->random))), turn = 2.0 * HALF_TURN * next_chance(&b->random);
    out[i] = far * cos(turn);
    out[i + 1] = far * sin(turn);
  }
}

static real median(const real *values, integer n) {
  real sorted[MAX_WHEELS];
  for (integer i = 0; i < n; ++i) {
    integer k = i;
    for (; k > 0 && sorted[k - 1] > values[i]; --k) sorted[k] = sorted[k - 1];
    sorted[k] = values[i];
  }
  return 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]);
}

/* Mean distance of the wheels' values from their median. */
static real apart(const real *values, integer n) {
  const real middle = median(values, n);
  real sum = 0.0;
  for (integer i = 0; i < n; ++i) sum += fabs(values[i] - middle);
  return sum / n;
}

/* Begin anew: any travel may be, nothing slips, no hole is dug. */
void rover_pin_forget(Belief *b) {
  b->random = chance_of(-1);
  b->count = b->k = b->backwards = b->folds = b->no_progress = 0;
  b->wall = b->rolled = b->bend = b->reference = b->stuck = b->speed = b->pace = 0.0;
  memset(b->slip, 0, b->n * b->N * sizeof(real));
  memset(b->hole, 0, b->n * b->N * sizeof(real));
  for (integer i = 0; i < b->N; ++i) {
    b->share[i] = within(0.0, 1.1, next_chance(&b->random));
    b->stalled[i] = next_chance(&b->random) < 0.1;
    b->log_weight[i] = b->way[i] = 0.0;
  }
}

/* Means over the last samples: of posture, torque and rate; and the posture's rates over all that are kept. */
static void felt(Belief *b, const real *sample) {
  const integer n = b->n, p = b->n_posture, size = p + 2 * n;
  if (b->count == WINDOW) memmove(b->samples, b->samples + size, (WINDOW - 1) * size * sizeof(real));
  else ++b->count;
  memcpy(b->samples + (b->count - 1) * size, sample, size * sizeof(real));
  memset(b->mean, 0, size * sizeof(real));
  memset(b->rates, 0, p * sizeof(real));
  real squares = 0.0;
  for (integer k = 0; k < b->count; ++k) {
    const real *row = b->samples + k * size, t = b->period * (k - 0.5 * (b->count - 1));
    const integer ago = b->count - k, of_posture = b->count < POSTURE ? b->count : POSTURE;
    const integer of_rest = b->count < RECENT ? b->count : RECENT;
    squares += t * t;
    for (integer i = 0; i < p; ++i) b->rates[i] += t * row[i];
    for (integer i = 0; i < size; ++i)
      if (ago <= (i < p ? of_posture : of_rest)) b->mean[i] += row[i] / (i < p ? of_posture : of_rest);
  }
  b->folds = b->count >= LEAST_ROWS;
  for (integer i = 0; i < p; ++i) b->rates[i] = b->folds ? b->rates[i] / squares : 0.0;
}

/* The ground under the wheels, their rim speeds over it, and the torque over load of those that tell something. */
static void look(Belief *b) {
  const integer n = b->n, p = b->n_posture;
  for (integer i = 0; i < n; ++i) b->torque[i] = b->torque_per_current * b->mean[p + n + i];
  const real *asked[3] = {b->mean, b->rates, b->torque};
  real *told[1] = {b->under};
  ground(asked, told, b->work_i, b->work_w, 0);
  real highest = 0.0;
  for (integer i = 0; i < n; ++i) {
    const real load = b->under[LOAD * n + i];
    b->rim[i] = b->radius[i] * (b->mean[p + i] + b->under[SWING * n + i]);
    b->tells[i] = load > LEAST_LOAD && fabs(b->rim[i]) > LEAST_RIM && !b->backwards;
    b->factor[i] = b->torque[i] / (b->radius[i] * fmax(load, LEAST_LOAD));
    if (b->tells[i]) highest = fmax(highest, b->factor[i]);
  }
  b->bend = apart(b->under + SLOPE * n, n);
  const real excess = b->bend > BENT ? fmax(highest / b->most_factor - 1.1, 0.0) : 0.0;
  b->wall += b->wall_gain * (fmin(excess / 0.3, 1.0) - b->wall);
}

/* Modes and travel a period later; a rover that turns back may do anything. Every particle draws as often, whatever
   it does, so that one that hardly does otherwise leaves the others' chances alone. */
static void move(Belief *b, int backwards) {
  b->pace = median(b->rim, b->n);
  const real dt = b->period, usual = fmax(fabs(b->pace), b->floor);
  const real falls = (b->stalls + b->wall_stalls * fmin(b->wall, 1.0)) * dt;
  b->reference = backwards ? -usual : usual;
  fill_normal(b, b->chance);
  for (integer i = 0; i < b->N; ++i) {
    real share = b->share[i];
    int stalled = b->stalled[i] > 0.0;
    real drawn[4];
    for (int c = 0; c < 4; ++c) drawn[c] = next_chance(&b->random);
    if (backwards != b->backwards) {
      share = within(0.3, 1.0, drawn[0]);
      stalled = drawn[1] < 0.1;
    }
    const int frees = stalled && drawn[2] < b->frees * dt;
    stalled = (stalled && !frees) || (!stalled && drawn[2] < falls);
    share += b->wander * sqrt(dt) * b->chance[i];
    if (frees) share = within(0.0, 0.6, drawn[0]);
    if (!stalled && drawn[3] < b->surprise * dt) share = within(-0.2, 1.2, drawn[1]);
    b->share[i] = stalled ? 0.03 * b->chance[i] : fmin(fmax(share, -0.4), 1.4);
    b->stalled[i] = stalled;
    b->travel[i] = b->reference * b->share[i];
    b->way[i] += b->travel[i] * dt;
  }
  b->backwards = backwards;
  b->rolled += fmax(b->pace, 0.0) * dt;
}

/* Slips and holes a period later, and what the torques say of them. */
static void turn_wheels(Belief *b) {
  _Alignas(64) real given[3 * LANES], result[2 * LANES], F[LANES];
  const integer n = b->n, N = b->N;
  const real wide[1] = {b->strength * b->strength + b->bend * b->bend + b->wall_share * b->wall * b->wall_share * b->wall};
  for (integer i = 0; i < N; ++i) b->odds[i] = 1.0;
  for (integer w = 0; w < n; ++w) {
    const real wheel[4] = {b->under[AHEAD * n + w], b->under[LEVEL * n + w], b->rim[w], b->radius[w]};
    const real read[2] = {b->factor[w], wide[0]};
    for (integer i = 0; i < N; i += LANES) {
      real *slip = b->slip + w * N + i, *hole = b->hole + w * N + i;
      memcpy(given, b->travel + i, sizeof F);
      memcpy(given + LANES, slip, sizeof F);
      memcpy(given + 2 * LANES, hole, sizeof F);
      wheel_law(given, wheel, result);
      memcpy(slip, result, sizeof F);
      memcpy(hole, result + LANES, sizeof F);
      if (!b->tells[w]) continue;
      for (int lane = 0; lane < LANES; ++lane) F[lane] = at_slip(b->factors, slip[lane]);
      torque_law(F, read, result);
      for (int lane = 0; lane < LANES; ++lane) b->odds[i + lane] *= result[lane];
    }
  }
  for (integer i = 0; i < N; ++i) b->log_weight[i] += log(b->odds[i]) * b->period / b->correlated;
}

/* Weigh by a law of one number a particle. */
static void weigh(Belief *b, lanes_law law, const real *of, const real *shared, real by) {
  _Alignas(64) real result[LANES];
  for (integer i = 0; i < b->N; i += LANES) {
    law(of + i, shared, result);
    for (int lane = 0; lane < LANES; ++lane) b->log_weight[i + lane] += by * result[lane];
  }
}

/* What the change of the posture over seconds says of the way of each particle, and of any progress at all. */
static void look_back(Belief *b) {
  const integer n = b->n, row = b->k / b->stride;
  if (b->k % b->stride) return;
  real *now = b->past + (row % PAST) * (n + 2), changed[MAX_WHEELS], bend = 0.0, change = 0.0;
  memcpy(now, b->under + HEIGHT * n, n * sizeof(real));
  now[n] = b->bend;
  now[n + 1] = b->rolled;
  memcpy(b->way_then + (row % PAST) * b->N, b->way, b->N * sizeof(real));
  for (integer back = 1; back <= PAST - 1 && back <= row; ++back) {
    const real *then = b->past + ((row - back) % PAST) * (n + 2);
    bend += then[n];
    for (integer i = 0; i < n; ++i) changed[i] = now[i] - then[i];
    change = fmax(change, apart(changed, n));
    if (back != STILL && back != PAST - 1) continue;
    const real mean = (bend + b->bend) / (back + 1), rolled = b->rolled - then[n + 1];
    for (integer i = 0; i < b->N; ++i) b->odds[i] = b->way[i] - b->way_then[((row - back) % PAST) * b->N + i];
    const real shared[2] = {change, mean};
    weigh(b, still_law, b->odds, shared, 2.0 / STILL);
    if (back == PAST - 1)
      b->no_progress = mean > BENT && rolled > b->least_roll && change < fmax(0.3 * rolled * mean, b->settled);
  }
}

/* Weights of sum 1, and what is told of slips, holes and standing. */
static real tell(Belief *b) {
  const integer n = b->n, N = b->N;
  real most = b->log_weight[0], sum = 0.0, squares = 0.0;
  for (integer i = 0; i < N; ++i) most = fmax(most, b->log_weight[i]);
  for (integer i = 0; i < N; ++i) sum += b->weight[i] = exp(b->log_weight[i] -= most);
  b->stuck = b->speed = 0.0;
  for (integer i = 0; i < N; ++i) {
    const real p = b->weight[i] /= sum;
    squares += p * p;
    b->speed += p * b->travel[i];
    if (b->stalled[i] > 0.0 || b->share[i] < STANDING) b->stuck += p;
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
    real *told = b->told + 4 * w;
    told[0] = fmin(fmax(s, -1.0), 1.0); told[1] = sqrt(ss);
    told[2] = d; told[3] = sqrt(dd);
  }
  return 1.0 / squares;
}

static void pick(Belief *b, real *row) {
  for (integer i = 0; i < b->N; ++i) b->chance[i] = row[b->parent[i]];
  memcpy(row, b->chance, b->N * sizeof(real));
}

/* Particles anew, in proportion to their weights, with even spacing. */
static void resample(Belief *b) {
  const real first = next_chance(&b->random);
  real sum = b->weight[0];
  integer k = 0;
  for (integer i = 0; i < b->N; ++i) {
    while (k < b->N - 1 && sum < (i + first) / b->N) sum += b->weight[++k];
    b->parent[i] = k;
  }
  real *rows[] = {b->share, b->stalled, b->travel, b->way};
  for (int r = 0; r < 4; ++r) pick(b, rows[r]);
  for (integer w = 0; w < b->n; ++w) pick(b, b->slip + w * b->N), pick(b, b->hole + w * b->N);
  for (integer r = 0; r < PAST; ++r) pick(b, b->way_then + r * b->N);
  for (integer r = 0; r < b->lag + 1; ++r) pick(b, b->travel_then + r * b->N);
  memset(b->log_weight, 0, b->N * sizeof(real));
}

/* Visual odometry tells the speed of `lag` samples ago. */
static void see(Belief *b, real late) {
  const integer rows = b->lag + 1;
  memcpy(b->travel_then + (b->k % rows) * b->N, b->travel, b->N * sizeof(real));
  if (!isfinite(late) || b->k < b->lag) return;
  const real *then = b->travel_then + ((b->k - b->lag) % rows) * b->N;
  for (integer i = 0; i < b->N; ++i) {
    const real off = (late - then[i]) / b->odometry_sd;
    b->log_weight[i] -= 0.5 * off * off;
  }
}

/* One sample: posture, wheel rates and currents; whether the duties turn back; a late speed, or NaN. */
void rover_pin_sense(Belief *b, const real *sample, integer backwards, real late) {
  b->random = chance_of(b->k);
  felt(b, sample);
  look(b);
  move(b, backwards != 0);
  turn_wheels(b);
  if (b->folds) {
    const real shared[3] = {apart(b->under + RISE * b->n, b->n), b->bend, fmin(b->wall, 1.0)};
    weigh(b, fold_law, b->travel, shared, b->period / b->fold_correlated);
  }
  look_back(b);
  if (b->lag) see(b, late);
  if (tell(b) < 0.5 * b->N) resample(b);
  ++b->k;
}
