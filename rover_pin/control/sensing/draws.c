/* What the belief and the monitor both use: chance, and a table over slips. */

static double next_chance(unsigned long long *memory) { /* xorshift64*: Vigna (2016), An experimental exploration of Marsaglia's generators */
  unsigned long long x = *memory;
  x ^= x >> 12; x ^= x << 25; x ^= x >> 27;
  *memory = x;
  return (double)((x * 2685821657736338717ULL) >> 11) * 0x1p-53;
}

static real at_slip(const real *table, real S) { /* linear over slips of -1 to 1 */
  const real at = (fmin(fmax(S, -1.0), 1.0) + 1.0) * 0.5 * (N_FACTORS - 1);
  const integer k = at >= N_FACTORS - 1 ? N_FACTORS - 2 : (integer)at;
  return table[k] + (at - k) * (table[k + 1] - table[k]);
}
