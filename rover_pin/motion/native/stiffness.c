/* The normal spring, implicit while a rover is set down. */

/* Weight of the step's end in what is taken implicitly: the midpoint rule drives, implicit Euler sets down. */
static double implicit_share(const Drive *d) { return d->settling ? 1.0 : 0.5; }

/* While a rover is set down, the normal spring is implicit too: how the load rises with depth over half a step. In hand
   nothing else changes with the speeds. */
static void add_stiffness(const Drive *d, const double *contact, const double *held, const double *states, Law *law, double *stiffness) {
  double deeper[N_GEOMETRY], push = 1e-6 * contact[0];
  Law pushed;
  memcpy(deeper, contact, sizeof deeper);
  deeper[0] += push;
  travel_law(d, deeper, held, states, &pushed);
  for (int i = 0; i < 4; ++i) stiffness[i] = 0.5 * d->dt * (pushed.load[i] - law->load[i]) / push;
  if (d->settling == IN_HAND) {
    memset(law->by_speed, 0, sizeof law->by_speed);
    memset(law->load_by_state, 0, sizeof law->load_by_state);
  }
}

/* A rover that is set down is not moved by its own slide along the ground: the base's x, y and yaw. */
static int slides(integer dof) { return dof == 0 || dof == 1 || dof == 5; }
