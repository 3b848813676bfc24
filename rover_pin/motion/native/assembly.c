/* From what patches push to generalised forces and their slopes. */

typedef struct {
  double A[MAX_DOF][MAX_DOF], soil_D[MAX_DOF][MAX_DOF], soil_Q[MAX_DOF];
  double motor_torque[MAX_DOF], motor_slope[MAX_DOF];
  double other_Q[MAX_DOF], other_slope[MAX_DOF];
} System;

typedef struct { /* what acts on the n degrees of freedom body_dof: force Q + D du (D by columns), and T of the differential */
  double Q[MAX_DOF], D[MAX_DOF * MAX_DOF], torque, torque_slope[MAX_DOF];
} BodyPush;

typedef struct { /* what a wheel's states need once the new speeds are known, and its load: now, and expected at the step's end */
  double weight, gain[MAX_STATES], by_col[MAX_STATES][MAX_COLS];
  double load[4], end[4], end_by_velocity[4][3], end_by_spin[4];
} WheelUpdate;

static void add_patch(const Drive *d, const Wheel *w, integer index, const Patch *patch, System *system, WheelUpdate *update) {
  const double *N = patch->facet->normal;
  const integer nx = d->n_contact_states, n = w->n;
  double r = d->radius[index], t[3], l[3], arm[3];
  cross(w->axle, N, t);
  unit(t);
  cross(N, t, l);
  double contact[N_GEOMETRY] = {patch->sinkage, dot(w->velocity, t), dot(w->velocity, l), -dot(w->velocity, N),
                                r * w->spin, w->centre[0], (double)d->axle[index]};
  const double *held = d->held + d->n_held * (d->kind[index] * d->n_soils + patch->facet->ground);
  Law law;
  double *states = d->contact_states + index * nx;
  travel_law(d, contact, held, states, &law);
  double stiffness[4] = {0.0, 0.0, 0.0, 0.0};
  if (d->settling) add_stiffness(d, contact, held, states, &law, stiffness);

  double begun[4];
  memcpy(begun, law.load, sizeof begun);

  /* the states' step dx = (I - dt/2 r_x)^-1 dt (r + r_v dv/2); half of it acts on the load of the implicit solve */
  const double share_of_end = implicit_share(d);
  double step[MAX_STATES][5];
  if (nx) {
    for (integer i = 0; i < nx; ++i) {
      step[i][0] = d->dt * law.rate[i];
      for (int j = 0; j < 4; ++j) step[i][1 + j] = d->dt * law.rate_by_speed[i][j];
    }
    implicit_states(share_of_end * d->dt, nx, law.rate_by_state, &step[0][0], 5, 5);
    for (int a = 0; a < 4; ++a)
      for (integer i = 0; i < nx; ++i) {
        law.load[a] += share_of_end * law.load_by_state[a][i] * step[i][0];
        for (int j = 0; j < 4; ++j) law.by_speed[a][j] += share_of_end * law.load_by_state[a][i] * step[i][1 + j];
      }
  }
  double in_plane[3];
  for (int c = 0; c < 3; ++c) in_plane[c] = patch->facet->n_s * w->forward[c] + patch->facet->n_t * w->up[c];
  double share = patch->share, tilt = patch->tilt, turn = patch->turn, side = patch->side;
  double e_t[3], e_n[3], moment_n[3], moment_y[3], moment_side[3];
  for (int c = 0; c < 3; ++c) {
    arm[c] = -r * in_plane[c];
    e_t[c] = share * t[c] + tilt * N[c];
    e_n[c] = share * N[c] - tilt * t[c];
  }
  cross(arm, N, moment_n);
  cross(arm, l, moment_y);
  const double across[3] = {0.0, 1.0, 0.0};
  cross(arm, across, moment_side);
  e_n[1] += side;
  double off_n = dot(moment_n, w->axle), off_y = dot(moment_y, w->axle), off_side = dot(moment_side, w->axle);
  for (int c = 0; c < 3; ++c) {
    moment_n[c] = share * (moment_n[c] - off_n * w->axle[c]) + side * (moment_side[c] - off_side * w->axle[c]);
    moment_y[c] = share * (moment_y[c] - off_y * w->axle[c]);
  }
  double push[4][MAX_COLS], see[4][MAX_COLS];
  for (integer i = 0; i < n; ++i) {
    const double *lin = w->lin[i], *ang = w->ang[i];
    double spin = dot(ang, w->axle);
    push[0][i] = dot(lin, e_t);
    push[1][i] = share * dot(lin, l) + dot(ang, moment_y);
    push[2][i] = dot(lin, e_n) + dot(ang, moment_n);
    push[3][i] = -turn * spin;
    see[0][i] = dot(lin, t);
    see[1][i] = dot(lin, l);
    see[2][i] = -dot(lin, N);
    see[3][i] = r * spin;
  }
  for (integer i = 0; i < n; ++i) {
    double row[4] = {0, 0, 0, 0};
    for (int a = 0; a < 4; ++a) {
      system->soil_Q[w->cols[i]] += push[a][i] * law.load[a];
      for (int b = 0; b < 4; ++b) row[b] += push[a][i] * law.by_speed[a][b];
    }
    double *target = system->soil_D[w->cols[i]];
    for (integer j = 0; j < n; ++j)
      target[w->cols[j]] += row[0] * see[0][j] + row[1] * see[1][j] + row[2] * see[2][j] + row[3] * see[3][j];
    if (!d->settling) continue;
    double spring = push[0][i] * stiffness[0] + push[1][i] * stiffness[1] + push[2][i] * stiffness[2] + push[3][i] * stiffness[3];
    for (integer j = 0; j < n; ++j) if (!slides(w->cols[j])) target[w->cols[j]] += spring * see[2][j];
  }
  const double felt[4] = {share, share, share, turn};
  for (int a = 0; a < 4; ++a) {
    update->load[a] += felt[a] * begun[a];
    update->end[a] += felt[a] * (2.0 * law.load[a] - begun[a]);
    const double *slope = law.by_speed[a];
    for (int c = 0; c < 3; ++c)
      update->end_by_velocity[a][c] += felt[a] * (slope[0] * t[c] + slope[1] * l[c] - slope[2] * N[c]);
    update->end_by_spin[a] += felt[a] * slope[3] * r;
  }
  double weight = fmax(share * law.load[2], 1e-12);
  update->weight += weight;
  for (integer i = 0; i < nx; ++i) {
    update->gain[i] += weight * step[i][0];
    for (integer j = 0; j < n; ++j)
      for (int b = 0; b < 4; ++b) update->by_col[i][j] += weight * step[i][1 + b] * see[b][j];
  }
  double *record = d->record + index * N_RECORD;
  record[0] += weight * law.slip[0];
  record[1] += weight * law.slip[1];
  record[3] += share * law.load[2];
  record[4] += share * law.load[0];
  record[5] += share * law.load[1] + side * l[1] * law.load[2];
  record[6] += turn * law.load[3];
  record[7] += weight * contact[1];
  record[8] += 1.0;
  for (int c = 0; c < 3; ++c)
    d->loads[6 * index + c] += e_n[c] * law.load[2] + e_t[c] * law.load[0] + share * l[c] * law.load[1];
  for (int c = 0; c < 3; ++c)
    d->loads[6 * index + 3 + c] += moment_n[c] * law.load[2] + moment_y[c] * law.load[1] - turn * w->axle[c] * law.load[3];
}

/* Add the patches of one strip of a wheel's width, which has this share of it; return how many touch. */
static integer add_strip(const Drive *d, const Wheel *wheel, integer index, const Facet *facets, integer n, double share,
                         double slope, System *system, WheelUpdate *update) {
  double radius = d->radius[index], deepest = 0.0, *sinkage = d->record + index * N_RECORD + 2, before = *sinkage;
  integer touching = 0;
  for (integer k = 0; k < n; ++k) {
    Patch patch;
    double n_soil = d->soils[N_SOIL * facets[k].ground + SOIL_N];
    if (!find_patch(facets, n, k, radius, n_soil, &patch)) continue;
    ++touching;
    deepest = fmax(deepest, patch.depth);
    patch.side = -slope * patch.share * patch.sinkage / (n_soil + 1.5);
    patch.share *= share;
    patch.tilt *= share;
    patch.turn *= share;
    add_patch(d, wheel, index, &patch, system, update);
  }
  *sinkage = before + share * deepest;
  return touching;
}

static void add_wheel(const Drive *d, integer index, Wheel *wheel, System *system, WheelUpdate *update) {
  Facet facets[MAX_FACETS + 1];
  look_at_wheel(d, index, wheel);
  double radius = d->radius[index];
  memset(update, 0, sizeof *update);
  memset(d->record + index * N_RECORD, 0, 9 * sizeof(double));
  memset(d->loads + 6 * index, 0, 6 * sizeof(double));
  integer touching = d->n_lanes ? 0 : add_strip(d, wheel, index, facets, cut_grid(d, wheel, radius, facets), 1.0, 0.0, system, update);
  for (integer lane = 0; lane < d->n_lanes; ++lane) {
    double slope, share = lane_share(d, wheel, lane, radius, d->kinds[N_WHEEL * d->kind[index] + WHEEL_B], &slope);
    if (share > 0.0) touching += add_strip(d, wheel, index, facets, cut_lane(d, wheel, lane, radius, facets), share, slope, system, update);
  }
  if (!touching && d->n_contact_states) { /* in the air: the states go on, nothing pushes */
    Facet below = {0, -radius, 0, 1, {wheel->up[0], wheel->up[1], wheel->up[2]}, 0};
    Patch patch = {1e-9, 0.0, 0.0, 0.0, 0.0, 0.0, &below};
    add_patch(d, wheel, index, &patch, system, update);
    d->record[index * N_RECORD + 8] = 0.0;
  }
  double *record = d->record + index * N_RECORD;
  if (update->weight > 0.0) {
    record[0] /= update->weight;
    record[1] /= update->weight;
    record[7] /= update->weight;
    for (integer i = 0; i < d->n_contact_states; ++i) {
      update->gain[i] /= update->weight;
      for (integer j = 0; j < wheel->n; ++j) update->by_col[i][j] /= update->weight;
    }
  }
}
