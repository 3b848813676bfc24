/* Test of the exported control: test_vectors vectors.csv LIMIT

   The program gives the readings in vectors.csv to the control, compares its answers with those in the file, and prints
   the largest difference. It returns 0 if the difference is within LIMIT (1e-12 if not given), 1 if it is not, and 2 if
   the file is not named or cannot be read, with a message. */
#include "rover_control.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Read a row of numbers, with the commas between them. */
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
  FILE *file;
  const double limit = argc > 2 ? atof(argv[2]) : 1e-12;
  double row[1 + IN + OUT], worst = 0.0;
  int rows = 0, i;
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
  while (read_row(file, row, 1 + IN + OUT)) {
    if (row[0] > 0.5) rover_control_reset(&control);
    for (i = 0; i < IN; ++i) ((rover_real *)&in)[i] = (rover_real)row[1 + i];
    rover_control_step(&control, &in, &out);
    for (i = 0; i < OUT; ++i) {
      const double difference = fabs((double)((rover_real *)&out)[i] - row[1 + IN + i]);
      worst = difference > worst || isnan(difference) ? difference : worst;
    }
    ++rows;
  }
  fclose(file);
  printf("%d samples, largest difference %.2g\n", rows, worst);
  return rows && worst <= limit ? 0 : 1;
}
