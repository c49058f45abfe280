// The functions of FMI 2.0.
#include <algorithm>
#include <string_view>

#include "component.hpp"

using espalier::fmi::Boolean2;
using espalier::fmi::FmiStatus;
using espalier::fmi::ValueReference;
using espalier::fmi::fmi2::Callbacks;
using espalier::fmi::fmi2::StatusKind;
using espalier::fmi::fmi2::Type;
using espalier::fmu::Instance;

namespace {

struct Logger2 {
  std::string name;
  const Callbacks* callbacks;  // live as long as the instance, says the standard
  void operator()(FmiStatus status, const char* category, const std::string& message) const {
    if (callbacks == nullptr || callbacks->logger == nullptr) return;
    callbacks->logger(callbacks->environment, name.c_str(), status, category, "%s", message.c_str());
  }
};

struct Component2 : espalier::fmu::Component<Logger2> {
  using Component::Component;
  espalier::fmu::StepEnd last;
};

template <class Body>
FmiStatus call2(void* c, const char* function, const Body& body) {
  if (c == nullptr) return FmiStatus::error;
  auto& component = *static_cast<Component2*>(c);
  return component.call(function, [&] { body(component.instance()); });
}

FmiStatus refuse2(void* c, const char* function, const char* why) {
  return call2(c, function, [&](Instance&) { throw std::invalid_argument(why); });
}

FmiStatus none2(void* c, const char* function, std::size_t count) {
  return count == 0 ? FmiStatus::ok : refuse2(c, function, "all variables of this FMU are Real");
}

/// The path of a file URI.
std::string path_of(const char* location) {
  if (location == nullptr) throw std::invalid_argument("the FMU needs the location of its resources");
  std::string_view uri = location;
  for (const std::string_view scheme : {"file://localhost/", "file:///", "file:/"})
    if (uri.starts_with(scheme)) {
      uri.remove_prefix(scheme.size() - 1);
      break;
    }
  std::string path;
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  for (std::size_t k = 0; k < uri.size(); ++k) {
    const bool code = uri[k] == '%' && k + 2 < uri.size() && digit(uri[k + 1]) >= 0 && digit(uri[k + 2]) >= 0;
    path += code ? static_cast<char>(16 * digit(uri[k + 1]) + digit(uri[k + 2])) : uri[k];
    if (code) k += 2;
  }
  return path;
}

}  // namespace

extern "C" {

const char* fmi2GetTypesPlatform() { return "default"; }
const char* fmi2GetVersion() { return "2.0"; }

FmiStatus fmi2SetDebugLogging(void* c, Boolean2 on, std::size_t /*count*/, const char* const* /*categories*/) {
  if (c == nullptr) return FmiStatus::error;
  static_cast<Component2*>(c)->set_logging(on != 0);
  return FmiStatus::ok;
}

void* fmi2Instantiate(const char* name, Type type, const char* guid, const char* resources, const Callbacks* callbacks,
                      Boolean2 /*visible*/, Boolean2 logging) {
  try {
    auto component = std::make_unique<Component2>(Logger2{name == nullptr ? "" : name, callbacks}, logging != 0);
    const FmiStatus status = component->call(
        "fmi2Instantiate", [&] { component->make(path_of(resources), guid, type == Type::model_exchange); });
    return status == FmiStatus::ok ? component.release() : nullptr;
  } catch (...) {
    return nullptr;
  }
}
void fmi2FreeInstance(void* c) { delete static_cast<Component2*>(c); }

FmiStatus fmi2SetupExperiment(void* c, Boolean2 tolerance_defined, double tolerance, double start,
                              Boolean2 stop_defined, double stop) {
  return call2(c, "fmi2SetupExperiment", [&](Instance& i) {
    i.set_times(tolerance_defined != 0 ? std::optional(tolerance) : std::nullopt, start,
                stop_defined != 0 ? std::optional(stop) : std::nullopt);
  });
}
FmiStatus fmi2EnterInitializationMode(void* c) {
  return call2(c, "fmi2EnterInitializationMode", [](Instance& i) { i.enter_initialization(); });
}
FmiStatus fmi2ExitInitializationMode(void* c) {
  return call2(c, "fmi2ExitInitializationMode", [](Instance& i) { i.exit_initialization(); });
}
FmiStatus fmi2Terminate(void* c) {
  return call2(c, "fmi2Terminate", [](Instance& i) { i.terminate(); });
}
FmiStatus fmi2Reset(void* c) {
  return call2(c, "fmi2Reset", [](Instance& i) { i.reset(); });
}

FmiStatus fmi2GetReal(void* c, const ValueReference* references, std::size_t count, double* values) {
  return call2(c, "fmi2GetReal", [&](Instance& i) {
    for (std::size_t k = 0; k < count; ++k) values[k] = i.get(references[k]);
  });
}
FmiStatus fmi2SetReal(void* c, const ValueReference* references, std::size_t count, const double* values) {
  return call2(c, "fmi2SetReal", [&](Instance& i) {
    for (std::size_t k = 0; k < count; ++k) i.set(references[k], values[k]);
  });
}
FmiStatus fmi2GetInteger(void* c, const ValueReference*, std::size_t count, int*) {
  return none2(c, "fmi2GetInteger", count);
}
FmiStatus fmi2GetBoolean(void* c, const ValueReference*, std::size_t count, Boolean2*) {
  return none2(c, "fmi2GetBoolean", count);
}
FmiStatus fmi2GetString(void* c, const ValueReference*, std::size_t count, const char**) {
  return none2(c, "fmi2GetString", count);
}
FmiStatus fmi2SetInteger(void* c, const ValueReference*, std::size_t count, const int*) {
  return none2(c, "fmi2SetInteger", count);
}
FmiStatus fmi2SetBoolean(void* c, const ValueReference*, std::size_t count, const Boolean2*) {
  return none2(c, "fmi2SetBoolean", count);
}
FmiStatus fmi2SetString(void* c, const ValueReference*, std::size_t count, const char* const*) {
  return none2(c, "fmi2SetString", count);
}

FmiStatus fmi2GetFMUstate(void* c, void** state) {
  return call2(c, "fmi2GetFMUstate", [&](Instance& i) { *state = espalier::fmu::held_state(i, *state); });
}
FmiStatus fmi2SetFMUstate(void* c, void* state) {
  return call2(c, "fmi2SetFMUstate", [&](Instance& i) { i.restore(espalier::fmu::bytes_of(state)); });
}
FmiStatus fmi2FreeFMUstate(void* /*c*/, void** state) {
  if (state == nullptr) return FmiStatus::ok;
  delete static_cast<std::string*>(*state);
  *state = nullptr;
  return FmiStatus::ok;
}
FmiStatus fmi2SerializedFMUstateSize(void* c, void* state, std::size_t* size) {
  return call2(c, "fmi2SerializedFMUstateSize", [&](Instance&) { *size = espalier::fmu::bytes_of(state).size(); });
}
FmiStatus fmi2SerializeFMUstate(void* c, void* state, std::uint8_t* bytes, std::size_t size) {
  return call2(c, "fmi2SerializeFMUstate", [&](Instance&) { espalier::fmu::copy_state(state, bytes, size); });
}
FmiStatus fmi2DeSerializeFMUstate(void* c, const std::uint8_t* bytes, std::size_t size, void** state) {
  return call2(c, "fmi2DeSerializeFMUstate", [&](Instance&) {
    auto held = std::make_unique<std::string>(reinterpret_cast<const char*>(bytes), size);
    *state = held.release();
  });
}

FmiStatus fmi2GetDirectionalDerivative(void* c, const ValueReference* unknowns, std::size_t unknown_count,
                                       const ValueReference* knowns, std::size_t known_count, const double* seed,
                                       double* sensitivity) {
  return call2(c, "fmi2GetDirectionalDerivative", [&](Instance& i) {
    i.directional({unknowns, unknown_count}, {knowns, known_count}, {seed, known_count}, {sensitivity, unknown_count});
  });
}

// Model exchange

FmiStatus fmi2EnterEventMode(void* c) {
  return call2(c, "fmi2EnterEventMode", [](Instance& i) { i.expect_model_exchange(); });
}
FmiStatus fmi2NewDiscreteStates(void* c, espalier::fmi::fmi2::EventInfo* info) {
  *info = {};
  return call2(c, "fmi2NewDiscreteStates", [](Instance& i) { i.expect_model_exchange(); });
}
FmiStatus fmi2EnterContinuousTimeMode(void* c) {
  return call2(c, "fmi2EnterContinuousTimeMode", [](Instance& i) { i.expect_model_exchange(); });
}
FmiStatus fmi2CompletedIntegratorStep(void* c, Boolean2, Boolean2* enter_event_mode, Boolean2* terminate) {
  *enter_event_mode = *terminate = 0;
  return call2(c, "fmi2CompletedIntegratorStep", [](Instance& i) { i.expect_model_exchange(); });
}
FmiStatus fmi2SetTime(void* c, double time) {
  return call2(c, "fmi2SetTime", [&](Instance& i) { i.set_time(time); });
}
FmiStatus fmi2SetContinuousStates(void* c, const double* states, std::size_t count) {
  return call2(c, "fmi2SetContinuousStates", [&](Instance& i) { i.set_states({states, count}); });
}
FmiStatus fmi2GetContinuousStates(void* c, double* states, std::size_t count) {
  return call2(c, "fmi2GetContinuousStates", [&](Instance& i) { i.get_states({states, count}); });
}
FmiStatus fmi2GetDerivatives(void* c, double* derivatives, std::size_t count) {
  return call2(c, "fmi2GetDerivatives", [&](Instance& i) { i.get_derivatives({derivatives, count}); });
}
FmiStatus fmi2GetEventIndicators(void* c, double*, std::size_t count) {
  return count == 0 ? FmiStatus::ok : refuse2(c, "fmi2GetEventIndicators", "this FMU has no event indicators");
}
FmiStatus fmi2GetNominalsOfContinuousStates(void* c, double* nominals, std::size_t count) {
  return call2(c, "fmi2GetNominalsOfContinuousStates", [&](Instance&) { std::fill_n(nominals, count, 1.0); });
}

// Co-simulation

FmiStatus fmi2SetRealInputDerivatives(void* c, const ValueReference*, std::size_t count, const int*, const double*) {
  return count == 0 ? FmiStatus::ok : refuse2(c, "fmi2SetRealInputDerivatives", "this FMU does not interpolate inputs");
}
FmiStatus fmi2GetRealOutputDerivatives(void* c, const ValueReference*, std::size_t count, const int*, double*) {
  return count == 0 ? FmiStatus::ok
                    : refuse2(c, "fmi2GetRealOutputDerivatives", "this FMU gives no derivatives of outputs by time");
}
FmiStatus fmi2DoStep(void* c, double time, double step, Boolean2 /*no_set_state_before*/) {
  const FmiStatus status = call2(c, "fmi2DoStep", [&](Instance& i) {
    static_cast<Component2*>(c)->last = {time, false};
    static_cast<Component2*>(c)->last = i.step(time, step);
  });
  return status == FmiStatus::ok && static_cast<Component2*>(c)->last.terminated ? FmiStatus::discard : status;
}
FmiStatus fmi2CancelStep(void* c) { return refuse2(c, "fmi2CancelStep", "this FMU steps while the caller waits"); }

FmiStatus fmi2GetStatus(void* c, StatusKind, FmiStatus*) {
  return refuse2(c, "fmi2GetStatus", "this FMU steps while the caller waits");
}
FmiStatus fmi2GetRealStatus(void* c, StatusKind kind, double* value) {
  return call2(c, "fmi2GetRealStatus", [&](Instance&) {
    if (kind != StatusKind::last_successful_time) throw std::invalid_argument("only the last successful time is known");
    *value = static_cast<Component2*>(c)->last.time;
  });
}
FmiStatus fmi2GetIntegerStatus(void* c, StatusKind, int*) {
  return refuse2(c, "fmi2GetIntegerStatus", "there is none");
}
FmiStatus fmi2GetBooleanStatus(void* c, StatusKind kind, Boolean2* value) {
  return call2(c, "fmi2GetBooleanStatus", [&](Instance&) {
    if (kind != StatusKind::terminated) throw std::invalid_argument("only whether the run was terminated is known");
    *value = static_cast<Component2*>(c)->last.terminated ? 1 : 0;
  });
}
FmiStatus fmi2GetStringStatus(void* c, StatusKind, const char**) {
  return refuse2(c, "fmi2GetStringStatus", "there is none");
}

}  // extern "C"
