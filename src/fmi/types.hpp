/// \file
/// What FMI 2.0 and 3.0 (fmi-standard.org) say in C: types, and the functions that we call of other programs' FMUs. The
/// names are those of the standards without their prefixes.
#pragma once

#include <cstddef>
#include <cstdint>

namespace espalier::fmi {

using ValueReference = std::uint32_t;  // unsigned int in FMI 2

/// The status of both standards; FMI 3 has no `pending`.
enum class FmiStatus : int { ok, warning, discard, error, fatal, pending };

/// True and false of FMI 2.
using Boolean2 = int;

namespace fmi2 {

enum class Type : int { model_exchange, co_simulation };
enum class StatusKind : int { do_step, pending, last_successful_time, terminated };

struct Callbacks {
  void (*logger)(void* environment, const char* instance, FmiStatus status, const char* category, const char* message,
                 ...);
  void* (*allocate)(std::size_t count, std::size_t size);
  void (*free)(void* memory);
  void (*step_finished)(void* environment, FmiStatus status);
  void* environment;
};

struct EventInfo {
  Boolean2 new_discrete_states_needed, terminate_simulation, nominals_changed, values_changed, next_event_time_defined;
  double next_event_time;
};

using Instantiate = void* (*)(const char* name, Type type, const char* guid, const char* resources,
                              const Callbacks* callbacks, Boolean2 visible, Boolean2 logging);
using FreeInstance = void (*)(void* c);
using SetupExperiment = FmiStatus (*)(void* c, Boolean2 tolerance_defined, double tolerance, double start,
                                      Boolean2 stop_defined, double stop);
using Call = FmiStatus (*)(void* c);  // modes, terminate, reset
using GetReal = FmiStatus (*)(void* c, const ValueReference* references, std::size_t count, double* values);
using GetInteger = FmiStatus (*)(void* c, const ValueReference* references, std::size_t count, int* values);
using SetReal = FmiStatus (*)(void* c, const ValueReference* references, std::size_t count, const double* values);
using SetInteger = FmiStatus (*)(void* c, const ValueReference* references, std::size_t count, const int* values);
using SetString = FmiStatus (*)(void* c, const ValueReference* references, std::size_t count,
                                const char* const* values);
using DoStep = FmiStatus (*)(void* c, double time, double step, Boolean2 no_set_state_before);
using GetRealStatus = FmiStatus (*)(void* c, StatusKind kind, double* value);
using GetBooleanStatus = FmiStatus (*)(void* c, StatusKind kind, Boolean2* value);

}  // namespace fmi2

namespace fmi3 {

using LogMessage = void (*)(void* environment, FmiStatus status, const char* category, const char* message);
using IntermediateUpdate = void (*)(void* environment, double time, bool set_requested, bool get_allowed,
                                    bool step_finished, bool can_return_early, bool* return_requested,
                                    double* return_time);

using InstantiateCoSimulation = void* (*)(const char* name, const char* token, const char* resources, bool visible,
                                          bool logging, bool event_mode_used, bool early_return_allowed,
                                          const ValueReference* intermediate, std::size_t count, void* environment,
                                          LogMessage log, IntermediateUpdate update);
using FreeInstance = void (*)(void* c);
using EnterInitializationMode = FmiStatus (*)(void* c, bool tolerance_defined, double tolerance, double start,
                                              bool stop_defined, double stop);
using Call = FmiStatus (*)(void* c);
template <class T>
using Get = FmiStatus (*)(void* c, const ValueReference* references, std::size_t count, T* values, std::size_t n);
template <class T>
using Set = FmiStatus (*)(void* c, const ValueReference* references, std::size_t count, const T* values, std::size_t n);
using DoStep = FmiStatus (*)(void* c, double time, double step, bool no_set_state_before, bool* event_needed,
                             bool* terminate, bool* early, double* last_time);

}  // namespace fmi3

/// The calls of both: states as they are, and as bytes.
using GetState = FmiStatus (*)(void* c, void** state);
using SetState = FmiStatus (*)(void* c, void* state);
using StateSize = FmiStatus (*)(void* c, void* state, std::size_t* size);
using SerializeState = FmiStatus (*)(void* c, void* state, std::uint8_t* bytes, std::size_t size);
using DeserializeState = FmiStatus (*)(void* c, const std::uint8_t* bytes, std::size_t size, void** state);

}  // namespace espalier::fmi
