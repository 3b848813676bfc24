/* What is implicit, and how much: driving, and while a rover is set down. */

/* Weight of the step's end in the solve for the speeds: implicit Euler, 1, sets down. */
static double implicit_share(const Drive *d) { return d->settling ? 1.0 : GAMMA; }

/* The same in the effects' own states: the midpoint rule drives. */
static double state_share(const Drive *d) { return d->settling ? 1.0 : 0.5; }

/* While a rover is set down, the normal spring is implicit too: how the load rises with depth over half a step. In hand
   nothing else changes with the speeds. */
static void find_stiffness(const Drive *d, const Step *s, const Spot *spot, integer k, Law *law, double *stiffness) {
  Law pushed;
  travel_law(d, s, spot, k, &pushed);
  for (int i = 0; i < 4; ++i)
    stiffness[i] = 0.5 * d->dt * (pushed.load[i] - law->load[i]) / (DEEPER * spot->contact[GEOMETRY_H]);
  if (d->settling == IN_HAND) {
    memset(law->by_speed, 0, sizeof law->by_speed);
    memset(law->load_by_state, 0, sizeof law->load_by_state);
  }
}

/* A rover that is set down is not moved by its own slide along the ground: the base's x, y and yaw. */
static int slides(integer dof) { return dof == 0 || dof == 1 || dof == 5; }
