/* Steps the control through vectors.csv and prints by how much it differs from them: test_vectors vectors.csv LIMIT */
#include "rover_control.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static int number(FILE *file, double *value) { /* and the comma or the end of the line behind it */
  const int found = fscanf(file, " %lf", value) == 1;
  fgetc(file);
  return found;
}

static int row(FILE *file, rover_real *values, int count) {
  double value;
  int i;
  for (i = 0; i < count; ++i) {
    if (!number(file, &value)) return 0;
    values[i] = (rover_real)value;
  }
  return 1;
}

static double farthest(FILE *file, const rover_real *own, int count) {
  double worst = 0.0, value = 0.0;
  int i;
  for (i = 0; i < count; ++i) {
    if (!number(file, &value)) return INFINITY;
    const double off = fabs((double)own[i] - value) / fmax(1.0, fabs(value));
    worst = off > worst || isnan(off) ? off : worst;
  }
  return worst;
}

int main(int argc, char **argv) {
  static RoverControl control;
#ifdef ROVER_MONITOR
  static RoverMonitor monitor;
#endif
  RoverReading in;
  RoverCommand out;
  FILE *file = argc > 1 ? fopen(argv[1], "r") : NULL;
  const double limit = argc > 2 ? atof(argv[2]) : 1e-12;
  double worst = 0.0;
  rover_real anew;
  int rows = 0;
  if (!file) return 2;
  if (fscanf(file, "%*[^\n]") == EOF) return 2;
  while (row(file, &anew, 1)) {
    if (anew > 0.5) {
      rover_control_reset(&control);
#ifdef ROVER_MONITOR
      rover_monitor_reset(&monitor);
#endif
    }
    if (!row(file, in.duty, ROVER_WHEELS) || !row(file, in.wheel_rate, ROVER_WHEELS) || !row(file, in.current, ROVER_WHEELS) ||
        !row(file, in.suspension, ROVER_LINKS) || !row(file, &in.roll, 1) || !row(file, &in.pitch, 1) ||
        !row(file, &in.seen_speed, 1) || !row(file, in.slip, ROVER_WHEELS) || !row(file, in.travel, ROVER_WHEELS))
      return 2;
    rover_control_step(&control, &in, &out);
    const rover_real more[2] = {out.stands, (rover_real)out.stopped};
    worst = fmax(worst, farthest(file, out.duty, ROVER_WHEELS));
    worst = fmax(worst, farthest(file, out.slip, ROVER_WHEELS));
    worst = fmax(worst, farthest(file, out.hole, ROVER_WHEELS));
    worst = fmax(worst, farthest(file, more, 2));
#ifdef ROVER_MONITOR
    RoverForecast ahead;
    rover_monitor_step(&monitor, &control, &in, &ahead);
    const rover_real said[4] = {ahead.p_stuck, ahead.p_buried, (rover_real)ahead.alarm, (rover_real)ahead.cause};
    worst = fmax(worst, farthest(file, said, 4));
    worst = fmax(worst, farthest(file, ahead.causes, 5));
#endif
    ++rows;
  }
  fclose(file);
  printf("%d samples, %.2g off at most\n", rows, worst);
  return rows && worst <= limit ? 0 : 1;
}
