/* Steps the control through vectors.csv and prints by how much it differs from them: test_vectors vectors.csv LIMIT */
#include "rover_control.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static int read_row(FILE *file, double *values, int count) {
  int i;
  for (i = 0; i < count; ++i) {
    if (fscanf(file, " %lf", values + i) != 1) return 0;
    fgetc(file);
  }
  return 1;
}

int main(int argc, char **argv) {
  enum { IN = sizeof(RoverReading) / sizeof(rover_real), OUT = ROVER_WHEELS + ROVER_STEERED };
  static RoverControl control;
  RoverReading in;
  RoverCommand out;
  FILE *file = argc > 1 ? fopen(argv[1], "r") : NULL;
  const double limit = argc > 2 ? atof(argv[2]) : 1e-12;
  double row[1 + IN + OUT], worst = 0.0;
  int rows = 0, i;
  if (!file || fscanf(file, "%*[^\n]") == EOF) return 2;
  while (read_row(file, row, 1 + IN + OUT)) {
    if (row[0] > 0.5) rover_control_reset(&control);
    for (i = 0; i < IN; ++i) ((rover_real *)&in)[i] = (rover_real)row[1 + i];
    rover_control_step(&control, &in, &out);
    for (i = 0; i < OUT; ++i) {
      const double off = fabs((double)((rover_real *)&out)[i] - row[1 + IN + i]);
      worst = off > worst || isnan(off) ? off : worst;
    }
    ++rows;
  }
  fclose(file);
  printf("%d samples, %.2g off at most\n", rows, worst);
  return rows && worst <= limit ? 0 : 1;
}
