/* The effects' own states in an implicit step. */

/* Solve (I - half A) X = B for X (n x m, rows of stride `stride`), n <= MAX_STATES. */
static void implicit_states(double half, integer n, double a[][MAX_STATES], double *b, integer m, integer stride) {
  double lhs[MAX_STATES][MAX_STATES], inverse[MAX_STATES];
  for (integer i = 0; i < n; ++i)
    for (integer j = 0; j < n; ++j) lhs[i][j] = (i == j) - half * a[i][j];
  for (integer p = 0; p < n; ++p) {
    inverse[p] = 1.0 / lhs[p][p];
    for (integer i = p + 1; i < n; ++i) {
      double factor = lhs[i][p] * inverse[p];
      for (integer j = p; j < n; ++j) lhs[i][j] -= factor * lhs[p][j];
      for (integer j = 0; j < m; ++j) b[i * stride + j] -= factor * b[p * stride + j];
    }
  }
  for (integer p = n - 1; p >= 0; --p)
    for (integer j = 0; j < m; ++j) {
      for (integer i = p + 1; i < n; ++i) b[p * stride + j] -= lhs[p][i] * b[i * stride + j];
      b[p * stride + j] *= inverse[p];
    }
}
