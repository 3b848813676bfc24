/* The change of the speeds over a step, by the two-stage Rosenbrock method that plain/step.py explains. The
   equations are solved by Gaussian elimination in the order of the kinematic tree, from the leaves to the base, so
   that no zero fills in which the tree does not fill anyway (Featherstone 2008, section 6.5). */

#define LEAST_PIVOT 1e-12 /* smallest pivot over the diagonal before elimination; below, rows have to be exchanged */

/* Back substitution with the eliminated A, whose diagonal holds the inverse pivots. */
static void substitute_back(const Drive *d, double A[][MAX_DOF], double *b) {
  for (integer o = d->n_free - 1; o >= 0; --o) {
    const integer k = d->free_order[o], m = d->free_count[o], *above = d->free_above + o * MAX_DOF;
    double sum = b[k];
    for (integer a = 0; a < m; ++a) sum -= A[k][above[a]] * b[above[a]];
    b[k] = sum * A[k][k];
  }
}

/* Eliminate in the order `free_order` and solve for b in place. `free_above` lists the columns that row o still
   meets; the first of them belong to the base and are treated as one vector. No rows are exchanged; return SINGULAR
   where a pivot is too small. */
static int eliminate(const Drive *d, double A[][MAX_DOF], double *b) {
  double diagonal[MAX_DOF];
  for (integer i = 0; i < d->nv; ++i) diagonal[i] = fabs(A[i][i]);
  for (integer o = 0; o < d->n_free; ++o) {
    const integer k = d->free_order[o], m = d->free_count[o], *above = d->free_above + o * MAX_DOF;
    const integer base = m < 6 ? m : 6;
    if (!(fabs(A[k][k]) > LEAST_PIVOT * diagonal[k])) return SINGULAR;
    /* The base's columns of the pivot row are one vector of 8, whose last two entries stay zero. */
    const double inverse = 1.0 / A[k][k], *pivot = A[k], b_k = b[k];
    Row first = {0};
    for (integer c = 0; c < base; ++c) first[c] = pivot[c];
    A[k][k] = inverse;
    for (integer a = 0; a < m; ++a) {
      double *row = A[above[a]];
      const double factor = row[k] * inverse;
      b[above[a]] -= factor * b_k;
      *(Row *)row -= factor * first;
      for (integer c = 6; c < m; ++c) row[above[c]] -= factor * pivot[above[c]];
    }
  }
  substitute_back(d, A, b);
  return OK;
}

/* Solve for another right side b with the A that `eliminate` left: below the diagonal it still holds the columns, on
   it the inverse pivots. */
static void solve_again(const Drive *d, double A[][MAX_DOF], double *b) {
  for (integer o = 0; o < d->n_free; ++o) {
    const integer k = d->free_order[o], m = d->free_count[o], *above = d->free_above + o * MAX_DOF;
    const double b_k = A[k][k] * b[k];
    for (integer a = 0; a < m; ++a) b[above[a]] -= A[above[a]][k] * b_k;
  }
  substitute_back(d, A, b);
}

/* Gaussian elimination with partial pivoting of A (n x n) and b. Return SINGULAR where a column has no pivot. */
static int eliminate_pivoted(integer n, double A[][MAX_DOF], double *b) {
  /* The row with the largest entry in column p becomes the pivot. */
  for (integer p = 0; p < n; ++p) {
    integer best = p;
    for (integer i = p + 1; i < n; ++i) if (fabs(A[i][p]) > fabs(A[best][p])) best = i;
    if (!(fabs(A[best][p]) > 1e-300)) return SINGULAR;
    if (best != p) {
      for (integer j = p; j < n; ++j) { double s = A[p][j]; A[p][j] = A[best][j]; A[best][j] = s; }
      double s = b[p]; b[p] = b[best]; b[best] = s;
    }
    double inverse = 1.0 / A[p][p];
    for (integer i = p + 1; i < n; ++i) {
      double factor = A[i][p] * inverse;
      if (factor == 0.0) continue;
      for (integer j = p + 1; j < n; ++j) A[i][j] -= factor * A[p][j];
      b[i] -= factor * b[p];
    }
  }
  for (integer p = n - 1; p >= 0; --p) {
    for (integer j = p + 1; j < n; ++j) b[p] -= A[p][j] * b[j];
    b[p] /= A[p][p];
  }
  return OK;
}

/* Solve the same equations with partial pivoting, on the free speeds alone: slow, and rarely needed. */
static int solve_pivoted(const Drive *d, double A[][MAX_DOF], double *b) {
  /* Copy rows and columns of the free speeds, without those of followers. */
  double x[MAX_DOF], packed[MAX_DOF][MAX_DOF];
  const integer n = d->n_free;
  for (integer i = 0; i < n; ++i) {
    x[i] = b[d->free_order[i]];
    for (integer j = 0; j < n; ++j) packed[i][j] = A[d->free_order[i]][d->free_order[j]];
  }
  int status = eliminate_pivoted(n, packed, x);
  for (integer i = 0; i < n; ++i) b[d->free_order[i]] = x[i];
  return status;
}

/* Coupled joints have v_follower = ratio v_leader. Add the force on a follower to its leader. */
static void couple(const Drive *d, double *b) {
  for (integer c = 0; c < d->n_coupled; ++c) b[d->coupled_dof[2 * c + 1]] += d->coupled_ratio[c] * b[d->coupled_dof[2 * c]];
}

/* Add a follower's row and column of A to its leader's. */
static void couple_system(const Drive *d, double A[][MAX_DOF]) {
  for (integer c = 0; c < d->n_coupled; ++c) {
    const integer follower = d->coupled_dof[2 * c], leader = d->coupled_dof[2 * c + 1];
    const double ratio = d->coupled_ratio[c];
    for (integer j = 0; j < d->nv; ++j) A[leader][j] += ratio * A[follower][j];
    for (integer i = 0; i < d->nv; ++i) A[i][leader] += ratio * A[i][follower];
  }
}

/* Set the followers' speeds from their leaders'. */
static void set_followers(const Drive *d, double *speeds) {
  for (integer c = 0; c < d->n_coupled; ++c)
    speeds[d->coupled_dof[2 * c]] = d->coupled_ratio[c] * speeds[d->coupled_dof[2 * c + 1]];
}

/* Complete the equations. Motors enter as the soil does, with the weight gamma; servos, stops and body effects are
   fully implicit, so that dt times their slopes goes into A and `mass` alike. */
static void complete_system(const Drive *d, System *system, const BodyPush *push) {
  const double implicit_dt = implicit_share(d) * d->dt;
  for (integer i = 0; i < d->nv; ++i) {
    const double other = d->dt * system->other_slope[i];
    system->A[i][i] -= implicit_dt * system->motor_slope[i] + other;
    system->mass[i][i] -= other;
    system->force[i] += system->motor_torque[i] + system->other_Q[i] - d->nle[i];
  }
  for (integer j = 0; j < d->n_body; ++j) {
    system->force[d->body_dof[j]] += push->Q[j];
    for (integer i = 0; i < d->n_body; ++i) {
      const double other = d->dt * push->D[i + j * d->n_body];
      system->A[d->body_dof[i]][d->body_dof[j]] -= other;
      system->mass[d->body_dof[i]][d->body_dof[j]] -= other;
    }
  }
}

/* Whether b is larger than GROWS a and larger than round-off. */
static int outgrows(double a, double b) { return fabs(b) > larger(GROWS * fabs(a), LEAST_GROWN); }

/* Growth factor of the step: the largest factor by which a further solve enlarges a speed that both solves before
   have enlarged by more than GROWS, in the same direction. Forces push such a speed away faster than the step can
   follow. 0 where there is none. */
static double growth(const Drive *d, System *system, const double *first, const double *second, int pivots) {
  double third[MAX_DOF], largest = 0.0;
  const integer nv = d->nv;
  integer grown = 0;
  /* A third solve is made only if a speed has grown: rarely. */
  for (integer i = 0; i < nv; ++i) grown += outgrows(first[i], second[i]);
  if (!grown) return 0.0;
  for (integer i = 0; i < nv; ++i) third[i] = along(system->mass[i], second, (nv + 7) / 8);
  couple(d, third);
  if (pivots) solve_pivoted(d, system->kept, third);
  else solve_again(d, system->A, third);
  set_followers(d, third);
  for (integer i = 0; i < nv; ++i)
    if (outgrows(first[i], second[i]) && outgrows(second[i], third[i]) && first[i] * third[i] > 0.0)
      largest = larger(largest, fabs(third[i] / second[i]));
  return largest;
}

/* Solve A k_1 = dt force and A k_2 = mass k_1; the change of the speeds is du = gamma k_1 + (1 - gamma) k_2, the
   change that belongs to the mean force is mean_du = gamma (k_1 + (1 - gamma) k_2). */
static int solve_speeds(Drive *d, System *system) {
  _Alignas(64) double first[MAX_DOF] = {0.0}, second[MAX_DOF] = {0.0};
  double b[MAX_DOF], left_row[MAX_DOF], lacks = 0.0;
  const integer nv = d->nv, left = d->differential_left;
  const double gamma = implicit_share(d);
  for (integer i = 0; i < nv; ++i) b[i] = d->dt * system->force[i];
  /* The differential's torque is the residual of the left rocker's own equation, which the coupling below mixes with
     the right one: keep its row. */
  if (left >= 0) {
    memcpy(left_row, system->A[left], nv * sizeof(double));
    lacks = -b[left];
  }
  couple_system(d, system->A);
  couple(d, b);
  /* First solve. `kept` is for the case that elimination meets a small pivot. */
  memcpy(first, b, nv * sizeof(double));
  for (integer i = 0; i < nv; ++i) memcpy(system->kept[i], system->A[i], nv * sizeof(double));
  int status = eliminate(d, system->A, first);
  const int pivots = status != OK;
  if (pivots) {
    ++d->pivoted;
    memcpy(first, b, nv * sizeof(double));
    status = solve_pivoted(d, system->kept, first);
  }
  set_followers(d, first);
  /* Second solve with the same left side. */
  for (integer i = 0; i < nv; ++i) second[i] = along(system->mass[i], first, (nv + 7) / 8);
  if (left >= 0) lacks -= (1.0 - gamma) * second[left];
  couple(d, second);
  if (pivots) solve_pivoted(d, system->kept, second);
  else solve_again(d, system->A, second);
  set_followers(d, second);
  /* du, mean_du, and the residual of the left rocker's equation. */
  for (integer i = 0; i < nv; ++i) {
    d->du[i] = gamma * first[i] + (1.0 - gamma) * second[i];
    system->mean_du[i] = gamma * (first[i] + (1.0 - gamma) * second[i]);
    if (left >= 0) lacks += left_row[i] * system->mean_du[i] / gamma;
  }
  d->growth = d->settling ? 0.0 : growth(d, system, first, second, pivots);
  system->differential = lacks / d->dt;
  return status;
}
