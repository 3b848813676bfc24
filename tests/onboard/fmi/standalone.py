"""Build the C sources of a functional mock-up unit as a separate program, with sanitizers and floating-point traps."""

import subprocess

from rover_pin.simulation.compiled.toolchain import compiler

SANE = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-Wno-psabi")
PERIODS = 30
MAIN = """
#define _GNU_SOURCE
#include <fenv.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
void *fmi3InstantiateCoSimulation(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *,
                                  size_t, void *, void *, void *);
int fmi3DoStep(void *, double, double, bool, bool *, bool *, bool *, double *);
int fmi3SetFloat64(void *, const uint32_t *, size_t, const double *, size_t);
int fmi3GetFMUState(void *, void **);
int fmi3SetFMUState(void *, void *);
int fmi3FreeFMUState(void *, void **);
void fmi3FreeInstance(void *);
int main(void) {
  bool event, ended = false, early;
  double last;
  const double duty[] = {DUTY};
  const uint32_t first = 1;
  void *state = 0;
  int k = 0;
  feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
  void *unit = fmi3InstantiateCoSimulation("", "TOKEN", "", 0, 0, 0, 0, 0, 0, 0, 0, 0);
  if (!unit || fmi3SetFloat64(unit, &first, 1, duty, sizeof duty / sizeof *duty)) return 1;
  for (; k < PERIODS && !ended; ++k)
    if (fmi3DoStep(unit, .05 * k, .05, 1, &event, &ended, &early, &last)) return 2;
  if (fmi3GetFMUState(unit, &state) || fmi3SetFMUState(unit, state)) return 3;
  fmi3FreeFMUState(unit, &state);
  fmi3FreeInstance(unit);
  printf("%d", k);
  return 0;
}
"""


def ran_sanely(unit, folder, duty):
    """Build a unit with a `main` function, step it, and return the number of periods. The test fails if a sanitizer
    reports an error.
    """
    words = {"DUTY": ", ".join(map(repr, duty)), "TOKEN": unit.token, "PERIODS": str(PERIODS)}
    main = MAIN
    for word, text in words.items():
        main = main.replace(word, text)
    for name, text in {**unit.c_files, "main.c": main}.items():
        (folder / name).write_text(text)
    names = [name for name in (*unit.c_files, "main.c") if name.endswith(".c")]
    built = subprocess.run(
        [*compiler(), *SANE, *names, "-lm", "-o", "run"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stderr
    done = subprocess.run([folder / "run"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return int(done.stdout)
