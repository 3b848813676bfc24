/* Functions of the belief and of the monitor: random numbers, and a table over the slip. */

/* Return a random number in [0, 1) and advance its memory: xorshift64* of Vigna (2016), An experimental exploration of
   Marsaglia's xorshift generators, scrambled. */
static double next_chance(unsigned long long *memory) {
  unsigned long long x = *memory;
  x ^= x >> 12; x ^= x << 25; x ^= x >> 27;
  *memory = x;
  return (double)((x * 2685821657736338717ULL) >> 11) * 0x1p-53;
}

/* Return the value of a table of N_FACTORS entries at slip S, linear between slips from -1 to 1 and constant beyond. */
static real at_slip(const real *table, real S) {
  const real at = (fmin(fmax(S, -1.0), 1.0) + 1.0) * 0.5 * (N_FACTORS - 1);
  const integer k = at >= N_FACTORS - 1 ? N_FACTORS - 2 : (integer)at;
  return table[k] + (at - k) * (table[k + 1] - table[k]);
}
