/* One sample of held speeds, as control/motion/servo.py defines them: wheel kinematics, then a servo for each wheel. */

void rover_control_reset(RoverControl *c) { memset(c, 0, sizeof *c); }

void rover_control_step(RoverControl *c, const RoverReading *in, RoverCommand *out) {
  real after[ROVER_WHEELS];
  const real *arguments[3] = {in->motion, in->wheel_rate, c->integral};
  real *results[3] = {out->duty, out->steer, after};
  cmd_vel(arguments, results, 0, 0, 0);
  memcpy(c->integral, after, sizeof after);
}
