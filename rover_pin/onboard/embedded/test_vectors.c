/* Test of the exported control: test_vectors vectors.csv LIMIT

   The program gives the readings in vectors.csv to the control, compares its answers with those in the file, and prints
   the largest difference. It returns 0 if the difference is within LIMIT (1e-12 if not given), 1 if it is not, and 2 if
   the file is not named or cannot be read, with a message. */
#include "rover_control.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Read a number, and the comma or the end of the line behind it. */
static int read_number(FILE *file, double *value) {
  const int found = fscanf(file, " %lf", value) == 1;
  fgetc(file);
  return found;
}

/* Read several numbers in the precision of the control. */
static int read_numbers(FILE *file, rover_real *values, int count) {
  double value;
  int i;
  for (i = 0; i < count; ++i) {
    if (!read_number(file, &value)) return 0;
    values[i] = (rover_real)value;
  }
  return 1;
}

/* Read several answers and return the largest difference of the control's answers from them: relative to an answer
   above 1, absolute otherwise. */
static double largest_difference(FILE *file, const rover_real *answers, int count) {
  double worst = 0.0, value = 0.0;
  int i;
  for (i = 0; i < count; ++i) {
    if (!read_number(file, &value)) return INFINITY;
    const double difference = fabs((double)answers[i] - value) / fmax(1.0, fabs(value));
    worst = difference > worst || isnan(difference) ? difference : worst;
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
  FILE *file;
  const double limit = argc > 2 ? atof(argv[2]) : 1e-12;
  double worst = 0.0;
  rover_real anew;
  int rows = 0;
  if (argc < 2) {
    fputs("Usage: test_vectors vectors.csv [LIMIT]\n"
          "Compares the answers of the control with those in vectors.csv. The largest allowed difference is LIMIT,\n"
          "1e-12 if not given. Exit code: 0 if all answers agree, 1 if not, 2 if the file cannot be read.\n",
          stderr);
    return 2;
  }
  file = fopen(argv[1], "r");
  if (!file || fscanf(file, "%*[^\n]") == EOF) {
    fprintf(stderr, "test_vectors: %s cannot be read, or is empty.\n", argv[1]);
    return 2;
  }
  while (read_numbers(file, &anew, 1)) {
    if (anew > 0.5) {
      rover_control_reset(&control);
#ifdef ROVER_MONITOR
      rover_monitor_reset(&monitor);
#endif
    }
    if (!read_numbers(file, in.duty, ROVER_WHEELS) || !read_numbers(file, in.wheel_rate, ROVER_WHEELS) || !read_numbers(file, in.current, ROVER_WHEELS) ||
        !read_numbers(file, in.suspension, ROVER_LINKS) || !read_numbers(file, &in.roll, 1) || !read_numbers(file, &in.pitch, 1) ||
        !read_numbers(file, &in.seen_speed, 1) || !read_numbers(file, in.slip, ROVER_WHEELS) || !read_numbers(file, in.travel, ROVER_WHEELS)) {
      fprintf(stderr, "test_vectors: %s, sample %d: a number is missing.\n", argv[1], rows + 1);
      return 2;
    }
    rover_control_step(&control, &in, &out);
    const rover_real more[2] = {out.stands, (rover_real)out.stopped};
    worst = fmax(worst, largest_difference(file, out.duty, ROVER_WHEELS));
    worst = fmax(worst, largest_difference(file, out.slip, ROVER_WHEELS));
    worst = fmax(worst, largest_difference(file, out.hole, ROVER_WHEELS));
    worst = fmax(worst, largest_difference(file, more, 2));
#ifdef ROVER_MONITOR
    RoverForecast ahead;
    rover_monitor_step(&monitor, &control, &in, &ahead);
    const rover_real forecast[4] = {ahead.p_stuck, ahead.p_buried, (rover_real)ahead.alarm, (rover_real)ahead.cause};
    worst = fmax(worst, largest_difference(file, forecast, 4));
    worst = fmax(worst, largest_difference(file, ahead.causes, 5));
#endif
    ++rows;
  }
  fclose(file);
  printf("%d samples, largest difference %.2g\n", rows, worst);
  return rows && worst <= limit ? 0 : 1;
}
