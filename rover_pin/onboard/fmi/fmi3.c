/* The functions of FMI 3.0 for co-simulation, as in sections 2.2, 2.3 and 4.2 of the standard, version 3.0.1.

   They work on a Unit, whose functions unit_begin, unit_step and unit_bind come before this text. All variables are
   Float64. Their values follow one another in `values` of the Unit; VARIABLES has the index of the first value of each. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define FMI __declspec(dllexport)
#else
#define FMI __attribute__((visibility("default")))
#endif

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef void *fmi3Instance;
typedef const char *fmi3String;
typedef uint32_t fmi3ValueReference;
typedef void (*fmi3LogMessageCallback)(void *, fmi3Status, fmi3String, fmi3String);

typedef struct {
  _Alignas(64) Unit unit;
  void *environment;
  fmi3LogMessageCallback log;
  double time;
  int failed;
} Instance;

/* Report an error to the simulator and return it. */
static fmi3Status failed(const Instance *m, fmi3String why) {
  if (m->log) m->log(m->environment, fmi3Error, "error", why);
  return fmi3Error;
}

/* Return to the state after the instantiation: all variables at their start values, time 0. */
static void restart(Instance *m) {
  memset(&m->unit, 0, sizeof m->unit);
  memcpy(m->unit.values, START, sizeof START);
  m->time = 0.0;
  m->failed = 0;
  unit_begin(&m->unit);
}

FMI const char *fmi3GetVersion(void) { return "3.0"; }

FMI fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, bool visible,
    bool logging, bool events, bool early, const fmi3ValueReference *intermediate, size_t count, void *environment,
    fmi3LogMessageCallback log, void *update) {
  (void)name; (void)resources; (void)visible; (void)logging; (void)early; (void)intermediate; (void)count; (void)update;
  if (events || strcmp(token, TOKEN)) return NULL;
  Instance *m = aligned_alloc(64, (sizeof(Instance) + 63) / 64 * 64);
  if (!m) return NULL;
  m->environment = environment;
  m->log = log;
  restart(m);
  return m;
}

/* The unit has no model exchange and no scheduled execution: NULL reports that the instantiation has failed. */
FMI fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, bool visible,
    bool logging, void *environment, fmi3LogMessageCallback log) {
  (void)name; (void)token; (void)resources; (void)visible; (void)logging; (void)environment; (void)log;
  return NULL;
}

FMI fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, bool visible,
    bool logging, void *environment, fmi3LogMessageCallback log, void *clock, void *lock, void *unlock) {
  (void)name; (void)token; (void)resources; (void)visible; (void)logging; (void)environment; (void)log;
  (void)clock; (void)lock; (void)unlock;
  return NULL;
}

FMI void fmi3FreeInstance(fmi3Instance m) { free(m); }

FMI fmi3Status fmi3SetDebugLogging(fmi3Instance m, bool on, size_t count, const fmi3String *categories) {
  (void)m; (void)on; (void)count; (void)categories;
  return fmi3OK;
}

FMI fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, bool has_tolerance, double tolerance, double start,
    bool has_stop, double stop) {
  (void)has_tolerance; (void)tolerance; (void)has_stop; (void)stop;
  ((Instance *)instance)->time = start;
  return fmi3OK;
}

FMI fmi3Status fmi3ExitInitializationMode(fmi3Instance m) { (void)m; return fmi3OK; }
FMI fmi3Status fmi3Terminate(fmi3Instance m) { (void)m; return fmi3OK; }

FMI fmi3Status fmi3Reset(fmi3Instance m) {
  restart(m);
  return fmi3OK;
}

/* Take a step of one or several periods. It ends early if the drive ends, with the reason in the log. */
FMI fmi3Status fmi3DoStep(fmi3Instance instance, double at, double step, bool no_return, bool *event, bool *terminate,
    bool *early, double *last) {
  Instance *m = instance;
  const double periods = step / PERIOD, whole = round(periods);
  (void)no_return;
  *event = *terminate = *early = false;
  *last = at;
  if (m->failed) return failed(m, "the drive has ended; reset the unit first");
  if (!(whole >= 1.0) || fabs(periods - whole) > 1e-6 * whole) return failed(m, "the step must be a multiple of fixedInternalStepSize");
  for (long k = 1; k <= (long)whole; ++k) {
    const char *why = unit_step(&m->unit);
    *last = m->time = at + k * PERIOD;
    if (!why) continue;
    m->failed = 1;
    if (m->log) m->log(m->environment, fmi3Warning, "ended", why);
    *early = k < (long)whole;
    *terminate = true;
    return fmi3OK;
  }
  return fmi3OK;
}

/* Whether a variable may have a value. */
static int is_allowed(int variable, double value) {
  return isnan(value) ? VARIABLES[variable].may_be_nan : VARIABLES[variable].low <= value && value <= VARIABLES[variable].high;
}

/* Get the values of several variables, or set them if `sets` is 1: one variable after another, arrays in full. The value
   reference 0 is the time, which cannot be set. */
static fmi3Status exchange(Instance *m, const fmi3ValueReference *of, size_t count, double *values, size_t room, int sets) {
  size_t at = 0;
  for (size_t i = 0; i < count; ++i) {
    if (!of[i] && !sets && at < room) {
      values[at++] = m->time;
      continue;
    }
    if (!of[i] || of[i] > N_VARIABLES || (sets && !VARIABLES[of[i] - 1].settable)) return failed(m, "there is no such variable, or it cannot be set");
    const int first = VARIABLES[of[i] - 1].first, many = VARIABLES[of[i] - 1].count;
    if (at + many > room) return failed(m, "there are fewer values than the variables have");
    double *stored = m->unit.values + first;
    for (int k = 0; k < many; ++k) if (sets && !is_allowed((int)of[i] - 1, values[at + k])) return failed(m, "a value is not finite, or outside the bounds of its variable");
    memcpy(sets ? stored : values + at, sets ? values + at : stored, many * sizeof(double));
    at += many;
  }
  return at == room ? fmi3OK : failed(m, "there are more values than the variables have");
}

FMI fmi3Status fmi3GetFloat64(fmi3Instance m, const fmi3ValueReference *of, size_t count, double *values, size_t room) {
  return exchange(m, of, count, values, room, 0);
}

FMI fmi3Status fmi3SetFloat64(fmi3Instance m, const fmi3ValueReference *of, size_t count, const double *values, size_t room) {
  return exchange(m, of, count, (double *)values, room, 1);
}

#define NO_VALUES(KIND, TYPE)                                                                                        \
  FMI fmi3Status fmi3Get##KIND(fmi3Instance m, const fmi3ValueReference *of, size_t count, TYPE *values, size_t room) { \
    (void)of; (void)values; (void)room;                                                                              \
    return count ? failed(m, "there are only Float64 variables") : fmi3OK;                                           \
  }                                                                                                                  \
  FMI fmi3Status fmi3Set##KIND(fmi3Instance m, const fmi3ValueReference *of, size_t count, const TYPE *values, size_t room) { \
    (void)of; (void)values; (void)room;                                                                              \
    return count ? failed(m, "there are only Float64 variables") : fmi3OK;                                           \
  }
NO_VALUES(Float32, float) NO_VALUES(Int8, int8_t) NO_VALUES(UInt8, uint8_t) NO_VALUES(Int16, int16_t)
NO_VALUES(UInt16, uint16_t) NO_VALUES(Int32, int32_t) NO_VALUES(UInt32, uint32_t) NO_VALUES(Int64, int64_t)
NO_VALUES(UInt64, uint64_t) NO_VALUES(Boolean, bool) NO_VALUES(String, fmi3String)

FMI fmi3Status fmi3GetBinary(fmi3Instance m, const fmi3ValueReference *of, size_t count, size_t *sizes, const uint8_t **values, size_t room) {
  (void)of; (void)sizes; (void)values; (void)room;
  return count ? failed(m, "there are only Float64 variables") : fmi3OK;
}

FMI fmi3Status fmi3SetBinary(fmi3Instance m, const fmi3ValueReference *of, size_t count, const size_t *sizes, const uint8_t *const *values, size_t room) {
  (void)of; (void)sizes; (void)values; (void)room;
  return count ? failed(m, "there are only Float64 variables") : fmi3OK;
}

/* A state of the unit is a copy of the instance. When a state is restored, unit_bind sets the pointers in the Unit, because
   they would point into the instance that was copied. */
FMI fmi3Status fmi3GetFMUState(fmi3Instance m, void **state) {
  if (!*state && !(*state = malloc(sizeof(Instance)))) return failed(m, "there is not enough memory for the state");
  memcpy(*state, m, sizeof(Instance));
  return fmi3OK;
}

FMI fmi3Status fmi3SetFMUState(fmi3Instance instance, void *state) {
  Instance *m = instance;
  void *environment = m->environment;
  const fmi3LogMessageCallback log = m->log;
  memcpy(m, state, sizeof(Instance));
  m->environment = environment;
  m->log = log;
  unit_bind(&m->unit);
  return fmi3OK;
}

FMI fmi3Status fmi3FreeFMUState(fmi3Instance m, void **state) {
  (void)m;
  free(*state);
  *state = NULL;
  return fmi3OK;
}

FMI fmi3Status fmi3SerializedFMUStateSize(fmi3Instance m, void *state, size_t *size) {
  (void)m; (void)state;
  *size = sizeof(Instance);
  return fmi3OK;
}

FMI fmi3Status fmi3SerializeFMUState(fmi3Instance m, void *state, uint8_t *bytes, size_t size) {
  if (size < sizeof(Instance)) return failed(m, "there are too few bytes for the state");
  memcpy(bytes, state, sizeof(Instance));
  return fmi3OK;
}

FMI fmi3Status fmi3DeserializeFMUState(fmi3Instance m, const uint8_t *bytes, size_t size, void **state) {
  if (size != sizeof(Instance)) return failed(m, "the bytes are not a state of this unit");
  if (!*state && !(*state = malloc(sizeof(Instance)))) return failed(m, "there is not enough memory for the state");
  memcpy(*state, bytes, sizeof(Instance));
  return fmi3OK;
}

/* Functions of the standard for features that this unit does not have. They refuse every call, whatever its arguments. */
#define REFUSED(NAME) \
  FMI fmi3Status fmi3##NAME(fmi3Instance m) { return failed(m, "fmi3" #NAME " is not supported by this unit"); }
REFUSED(EnterEventMode) REFUSED(EnterStepMode) REFUSED(EnterConfigurationMode) REFUSED(ExitConfigurationMode)
REFUSED(EnterContinuousTimeMode) REFUSED(UpdateDiscreteStates) REFUSED(EvaluateDiscreteStates) REFUSED(GetClock)
REFUSED(SetClock) REFUSED(GetIntervalDecimal) REFUSED(GetIntervalFraction) REFUSED(GetShiftDecimal)
REFUSED(GetShiftFraction) REFUSED(SetIntervalDecimal) REFUSED(SetIntervalFraction) REFUSED(SetShiftDecimal)
REFUSED(SetShiftFraction) REFUSED(ActivateModelPartition) REFUSED(GetNumberOfVariableDependencies)
REFUSED(GetVariableDependencies) REFUSED(GetDirectionalDerivative) REFUSED(GetAdjointDerivative)
REFUSED(GetOutputDerivatives) REFUSED(CompletedIntegratorStep) REFUSED(SetTime) REFUSED(SetContinuousStates)
REFUSED(GetContinuousStates) REFUSED(GetContinuousStateDerivatives) REFUSED(GetEventIndicators)
REFUSED(GetNominalsOfContinuousStates) REFUSED(GetNumberOfEventIndicators) REFUSED(GetNumberOfContinuousStates)
