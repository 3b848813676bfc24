/* One sample of the slip control, as control/slip_control.py defines it: slip estimate, torque limit, PI law, and stop.
   The functions begin, estimate, highest and stop come before this text and depend on the control. */

void rover_control_reset(RoverControl *c) {
  memset(c, 0, sizeof *c);
  begin(c);
}

void rover_control_step(RoverControl *c, const RoverReading *in, RoverCommand *out) {
  real travel[ROVER_WHEELS];
  int i;
  estimate(c, in, out, travel);
  for (i = 0; i < ROVER_WHEELS; ++i) {
    const real inputs[6] = {out->slip[i], c->integral[i], highest(in, i), in->wheel_rate[i], travel[i], c->depth[i]};
    const real *arguments[2] = {inputs, GAINS};
    real law[3], *results[1] = {law};
    pi_law(arguments, results, 0, 0, 0);
    /* The law returns the duty, and the rates of the integral and of the hole's depth. */
    c->integral[i] += ROVER_PERIOD * law[1];
    c->depth[i] += ROVER_PERIOD * law[2];
    out->duty[i] = law[0];
    out->hole[i] = c->depth[i];
  }
  stop(c, out);
}
