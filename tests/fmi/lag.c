/* A small FMU for the tests, by FMI 2 and 3: a lag of first order, T y' = gain u - y, whose steps are exact for an
 * input that is held. At `at` it does what the text `mischief` says: "error", "discard", "end", "nan", "crash",
 * "early". */
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { U, ENABLE, Y, COUNT, HIGH, GAIN, LAG, AT, MISCHIEF };

typedef struct {
  double u, y, gain, lag, at, time;
  int enable, count, ended;
  char mischief[16];
} State;

typedef void (*Logger2)(void*, const char*, int, const char*, const char*, ...);
typedef void (*Logger3)(void*, int, const char*, const char*);
typedef struct {
  Logger2 logger;
  void* (*allocate)(size_t, size_t);
  void (*release)(void*);
  void (*finished)(void*, int);
  void* environment;
} Callbacks;

typedef struct {
  State s;
  void* environment;
  Logger2 log2;
  Logger3 log3;
} Instance;

static Instance* make(const char* token, const char* wanted) {
  if (strcmp(token, wanted) != 0) return NULL;
  Instance* i = calloc(1, sizeof(Instance));
  i->s.gain = i->s.lag = 1;
  i->s.enable = 1;
  i->s.at = 1e300;
  return i;
}

static void tell(Instance* i, int status, const char* text) {
  if (i->log2) i->log2(i->environment, "lag", status, "events", "%s at t = %g", text, i->s.time);
  if (i->log3) i->log3(i->environment, status, "events", text);
}

static int step(Instance* i, double time, double h) {
  State* s = &i->s;
  if (fabs(time - s->time) > 1e-9) {
    tell(i, ERROR, "the step begins at another time");
    return ERROR;
  }
  if (time + h > s->at) {
    if (!strcmp(s->mischief, "error")) return tell(i, ERROR, "a valve broke"), ERROR;
    if (!strcmp(s->mischief, "discard")) return tell(i, DISCARD, "too long a step"), DISCARD;
    if (!strcmp(s->mischief, "end")) s->ended = 1;
    if (!strcmp(s->mischief, "nan")) s->y = NAN;
    if (!strcmp(s->mischief, "crash")) abort();
  }
  const double target = s->enable ? s->gain * s->u : 0;
  s->y = target + (s->y - target) * exp(-h / s->lag);
  s->time = time + h;
  s->count++;
  return OK;
}

static int get_real(Instance* i, uint32_t r, double* v) {
  switch (r) {
    case U:
      *v = i->s.u;
      return OK;
    case Y:
      *v = i->s.y;
      return OK;
    case GAIN:
      *v = i->s.gain;
      return OK;
    case LAG:
      *v = i->s.lag;
      return OK;
    case AT:
      *v = i->s.at;
      return OK;
  }
  return tell(i, ERROR, "no such real"), ERROR;
}
static int set_real(Instance* i, uint32_t r, double v) {
  switch (r) {
    case U:
      i->s.u = v;
      return OK;
    case GAIN:
      i->s.gain = v;
      return OK;
    case LAG:
      i->s.lag = v;
      return v > 0 ? OK : (tell(i, ERROR, "T must be positive"), ERROR);
    case AT:
      i->s.at = v;
      return OK;
  }
  return tell(i, ERROR, "no such real to set"), ERROR;
}
static int set_text(Instance* i, uint32_t r, const char* text) {
  if (r != MISCHIEF) return ERROR;
  snprintf(i->s.mischief, sizeof i->s.mischief, "%s", text);
  return OK;
}

/* States, of both versions. */
static int get_state(Instance* i, void** state) {
  if (!*state) *state = malloc(sizeof(State));
  memcpy(*state, &i->s, sizeof(State));
  return OK;
}
static int set_state(Instance* i, const void* state) { return memcpy(&i->s, state, sizeof(State)), OK; }
static int free_state(void** state) { return free(*state), *state = NULL, OK; }
static int state_size(size_t* size) { return *size = sizeof(State), OK; }
static int serialize(const void* state, uint8_t* bytes) { return memcpy(bytes, state, sizeof(State)), OK; }
static int deserialize(const uint8_t* bytes, size_t size, void** state) {
  if (size != sizeof(State)) return ERROR;
  return *state = memcpy(malloc(size), bytes, size), OK;
}

/* FMI 2 */
EXPORT void* fmi2Instantiate(const char* name, int type, const char* guid, const char* location, const Callbacks* c,
                             int visible, int logging) {
  (void)name, (void)visible, (void)logging;
  if (type != 1 || strncmp(location, "file:///", 8) != 0) return NULL;
  Instance* i = make(guid, "{lag-2}");
  if (!i) return c->logger(c->environment, "lag", ERROR, "events", "another %s", "GUID"), NULL;
  i->log2 = c->logger;
  i->environment = c->environment;
  return i;
}
EXPORT void fmi2FreeInstance(void* c) { free(c); }
EXPORT int fmi2SetupExperiment(void* c, int a, double b, double start, int d, double e) {
  (void)a, (void)b, (void)d, (void)e;
  ((Instance*)c)->s.time = start;
  return OK;
}
EXPORT int fmi2EnterInitializationMode(void* c) { return (void)c, OK; }
EXPORT int fmi2ExitInitializationMode(void* c) { return (void)c, OK; }
EXPORT int fmi2GetReal(void* c, const uint32_t* r, size_t n, double* v) { return n == 1 ? get_real(c, *r, v) : ERROR; }
EXPORT int fmi2SetReal(void* c, const uint32_t* r, size_t n, const double* v) {
  return n == 1 ? set_real(c, *r, *v) : ERROR;
}
EXPORT int fmi2GetInteger(void* c, const uint32_t* r, size_t n, int* v) {
  return n == 1 && *r == COUNT ? (*v = ((Instance*)c)->s.count, OK) : ERROR;
}
EXPORT int fmi2SetInteger(void* c, const uint32_t* r, size_t n, const int* v) {
  return (void)c, (void)r, (void)n, (void)v, ERROR;
}
EXPORT int fmi2GetBoolean(void* c, const uint32_t* r, size_t n, int* v) {
  return n == 1 && *r == HIGH ? (*v = ((Instance*)c)->s.y > 1, OK) : ERROR;
}
EXPORT int fmi2SetBoolean(void* c, const uint32_t* r, size_t n, const int* v) {
  return n == 1 && *r == ENABLE ? (((Instance*)c)->s.enable = *v, OK) : ERROR;
}
EXPORT int fmi2SetString(void* c, const uint32_t* r, size_t n, const char* const* v) {
  return n == 1 ? set_text(c, *r, *v) : ERROR;
}
EXPORT int fmi2DoStep(void* c, double time, double h, int no) {
  (void)no;
  const int status = step(c, time, h);
  return status == OK && ((Instance*)c)->s.ended ? DISCARD : status;
}
EXPORT int fmi2GetBooleanStatus(void* c, int kind, int* v) { return (void)kind, *v = ((Instance*)c)->s.ended, OK; }
EXPORT int fmi2GetFMUstate(void* c, void** s) { return get_state(c, s); }
EXPORT int fmi2SetFMUstate(void* c, void* s) { return set_state(c, s); }
EXPORT int fmi2FreeFMUstate(void* c, void** s) { return (void)c, free_state(s); }
EXPORT int fmi2SerializedFMUstateSize(void* c, void* s, size_t* n) { return (void)c, (void)s, state_size(n); }
EXPORT int fmi2SerializeFMUstate(void* c, void* s, uint8_t* b, size_t n) { return (void)c, (void)n, serialize(s, b); }
EXPORT int fmi2DeSerializeFMUstate(void* c, const uint8_t* b, size_t n, void** s) {
  return (void)c, deserialize(b, n, s);
}

/* FMI 3 */
EXPORT void* fmi3InstantiateCoSimulation(const char* name, const char* token, const char* resources, bool visible,
                                         bool logging, bool events, bool early, const uint32_t* r, size_t n,
                                         void* environment, Logger3 log, void* update) {
  (void)name, (void)visible, (void)logging, (void)events, (void)early, (void)r, (void)n, (void)update;
  if (resources[strlen(resources) - 1] != '/') return NULL;
  Instance* i = make(token, "{lag-3}");
  if (!i) return log(environment, ERROR, "events", "another token"), NULL;
  i->log3 = log;
  i->environment = environment;
  return i;
}
EXPORT void fmi3FreeInstance(void* c) { free(c); }
EXPORT int fmi3EnterInitializationMode(void* c, bool a, double b, double start, bool d, double e) {
  (void)a, (void)b, (void)d, (void)e;
  ((Instance*)c)->s.time = start;
  return OK;
}
EXPORT int fmi3ExitInitializationMode(void* c) { return (void)c, OK; }
EXPORT int fmi3GetFloat64(void* c, const uint32_t* r, size_t n, double* v, size_t m) {
  return n == 1 && m == 1 ? get_real(c, *r, v) : ERROR;
}
EXPORT int fmi3SetFloat64(void* c, const uint32_t* r, size_t n, const double* v, size_t m) {
  return n == 1 && m == 1 ? set_real(c, *r, *v) : ERROR;
}
EXPORT int fmi3GetInt32(void* c, const uint32_t* r, size_t n, int32_t* v, size_t m) {
  return n == 1 && m == 1 && *r == COUNT ? (*v = ((Instance*)c)->s.count, OK) : ERROR;
}
EXPORT int fmi3GetBoolean(void* c, const uint32_t* r, size_t n, bool* v, size_t m) {
  return n == 1 && m == 1 && *r == HIGH ? (*v = ((Instance*)c)->s.y > 1, OK) : ERROR;
}
EXPORT int fmi3SetBoolean(void* c, const uint32_t* r, size_t n, const bool* v, size_t m) {
  return n == 1 && m == 1 && *r == ENABLE ? (((Instance*)c)->s.enable = *v, OK) : ERROR;
}
EXPORT int fmi3SetString(void* c, const uint32_t* r, size_t n, const char* const* v, size_t m) {
  return n == 1 && m == 1 ? set_text(c, *r, *v) : ERROR;
}
EXPORT int fmi3DoStep(void* c, double time, double h, bool no, bool* event, bool* end, bool* early, double* last) {
  (void)no, (void)event;
  const int status = step(c, time, h);
  *last = ((Instance*)c)->s.time;
  *end = ((Instance*)c)->s.ended;
  *early = time + h > ((Instance*)c)->s.at && !strcmp(((Instance*)c)->s.mischief, "early");
  return status;
}
EXPORT int fmi3GetFMUState(void* c, void** s) { return get_state(c, s); }
EXPORT int fmi3SetFMUState(void* c, void* s) { return set_state(c, s); }
EXPORT int fmi3FreeFMUState(void* c, void** s) { return (void)c, free_state(s); }
EXPORT int fmi3SerializedFMUStateSize(void* c, void* s, size_t* n) { return (void)c, (void)s, state_size(n); }
EXPORT int fmi3SerializeFMUState(void* c, void* s, uint8_t* b, size_t n) { return (void)c, (void)n, serialize(s, b); }
EXPORT int fmi3DeserializeFMUState(void* c, const uint8_t* b, size_t n, void** s) {
  return (void)c, deserialize(b, n, s);
}
