// The functions of FMI 3.0.

#include "component.hpp"

using espalier::fmi::FmiStatus;
using espalier::fmi::ValueReference;
using espalier::fmu::Instance;

namespace {

struct Logger3 {
  void* environment;
  espalier::fmi::fmi3::LogMessage log;
  void operator()(FmiStatus status, const char* category, const std::string& message) const {
    if (log != nullptr) log(environment, status, category, message.c_str());
  }
};

using Component3 = espalier::fmu::Component<Logger3>;

template <class Body>
FmiStatus call3(void* c, const char* function, const Body& body) {
  if (c == nullptr) return FmiStatus::error;
  auto& component = *static_cast<Component3*>(c);
  return component.call(function, [&] { body(component.instance()); });
}

FmiStatus refuse3(void* c, const char* function, const char* why) {
  return call3(c, function, [&](Instance&) { throw std::invalid_argument(why); });
}

/// The answer of the types that no variable has.
FmiStatus none3(void* c, const char* function, std::size_t count) {
  return count == 0 ? FmiStatus::ok : refuse3(c, function, "all variables of this FMU are Float64");
}

void* make3(const char* function, const char* token, const char* resources, bool logging, bool model_exchange,
            Logger3 logger) {
  try {
    auto component = std::make_unique<Component3>(logger, logging);
    const FmiStatus status = component->call(function, [&] {
      if (resources == nullptr) throw std::invalid_argument("the FMU needs the path of its resources");
      component->make(resources, token, model_exchange);
    });
    return status == FmiStatus::ok ? component.release() : nullptr;
  } catch (...) {
    return nullptr;
  }
}

}  // namespace

extern "C" {

const char* fmi3GetVersion() { return "3.0"; }

FmiStatus fmi3SetDebugLogging(void* c, bool on, std::size_t /*count*/, const char* const* /*categories*/) {
  if (c == nullptr) return FmiStatus::error;
  static_cast<Component3*>(c)->set_logging(on);
  return FmiStatus::ok;
}

void* fmi3InstantiateModelExchange(const char* /*name*/, const char* token, const char* resources, bool /*visible*/,
                                   bool logging, void* environment, espalier::fmi::fmi3::LogMessage log) {
  return make3("fmi3InstantiateModelExchange", token, resources, logging, true, {environment, log});
}

void* fmi3InstantiateCoSimulation(const char* /*name*/, const char* token, const char* resources, bool /*visible*/,
                                  bool logging, bool event_mode, bool /*early*/, const ValueReference* /*intermediate*/,
                                  std::size_t intermediate_count, void* environment,
                                  espalier::fmi::fmi3::LogMessage log, espalier::fmi::fmi3::IntermediateUpdate) {
  const Logger3 logger{environment, log};
  if (event_mode || intermediate_count > 0) {
    logger(FmiStatus::error, "logStatusError",
           "fmi3InstantiateCoSimulation: this FMU has no event mode and no intermediate variables");
    return nullptr;
  }
  return make3("fmi3InstantiateCoSimulation", token, resources, logging, false, logger);
}

void* fmi3InstantiateScheduledExecution(const char* /*name*/, const char* /*token*/, const char* /*resources*/,
                                        bool /*visible*/, bool /*logging*/, void* environment,
                                        espalier::fmi::fmi3::LogMessage log, void (*)(void*), void (*)(), void (*)()) {
  Logger3{environment, log}(FmiStatus::error, "logStatusError",
                            "fmi3InstantiateScheduledExecution: this FMU is for co-simulation or model exchange");
  return nullptr;
}

void fmi3FreeInstance(void* c) { delete static_cast<Component3*>(c); }

FmiStatus fmi3EnterInitializationMode(void* c, bool tolerance_defined, double tolerance, double start,
                                      bool stop_defined, double stop) {
  return call3(c, "fmi3EnterInitializationMode", [&](Instance& i) {
    i.set_times(tolerance_defined ? std::optional(tolerance) : std::nullopt, start,
                stop_defined ? std::optional(stop) : std::nullopt);
    i.enter_initialization();
  });
}
FmiStatus fmi3ExitInitializationMode(void* c) {
  return call3(c, "fmi3ExitInitializationMode", [](Instance& i) { i.exit_initialization(); });
}
FmiStatus fmi3EnterEventMode(void* c) {
  return call3(c, "fmi3EnterEventMode", [](Instance& i) { i.expect_model_exchange(); });
}
FmiStatus fmi3Terminate(void* c) {
  return call3(c, "fmi3Terminate", [](Instance& i) { i.terminate(); });
}
FmiStatus fmi3Reset(void* c) {
  return call3(c, "fmi3Reset", [](Instance& i) { i.reset(); });
}

FmiStatus fmi3GetFloat64(void* c, const ValueReference* references, std::size_t count, double* values, std::size_t n) {
  return call3(c, "fmi3GetFloat64", [&](Instance& i) {
    if (n != count) throw std::invalid_argument("all variables are scalars: as many values as references");
    for (std::size_t k = 0; k < count; ++k) values[k] = i.get(references[k]);
  });
}
FmiStatus fmi3SetFloat64(void* c, const ValueReference* references, std::size_t count, const double* values,
                         std::size_t n) {
  return call3(c, "fmi3SetFloat64", [&](Instance& i) {
    if (n != count) throw std::invalid_argument("all variables are scalars: as many values as references");
    for (std::size_t k = 0; k < count; ++k) i.set(references[k], values[k]);
  });
}

#define ESPALIER_FMI3_NO_TYPE(Type, type)                                                                \
  FmiStatus fmi3Get##Type(void* c, const ValueReference*, std::size_t count, type*, std::size_t) {       \
    return none3(c, "fmi3Get" #Type, count);                                                             \
  }                                                                                                      \
  FmiStatus fmi3Set##Type(void* c, const ValueReference*, std::size_t count, const type*, std::size_t) { \
    return none3(c, "fmi3Set" #Type, count);                                                             \
  }
ESPALIER_FMI3_NO_TYPE(Float32, float)
ESPALIER_FMI3_NO_TYPE(Int8, std::int8_t)
ESPALIER_FMI3_NO_TYPE(UInt8, std::uint8_t)
ESPALIER_FMI3_NO_TYPE(Int16, std::int16_t)
ESPALIER_FMI3_NO_TYPE(UInt16, std::uint16_t)
ESPALIER_FMI3_NO_TYPE(Int32, std::int32_t)
ESPALIER_FMI3_NO_TYPE(UInt32, std::uint32_t)
ESPALIER_FMI3_NO_TYPE(Int64, std::int64_t)
ESPALIER_FMI3_NO_TYPE(UInt64, std::uint64_t)
ESPALIER_FMI3_NO_TYPE(Boolean, bool)
ESPALIER_FMI3_NO_TYPE(String, char*)
#undef ESPALIER_FMI3_NO_TYPE

FmiStatus fmi3GetBinary(void* c, const ValueReference*, std::size_t count, std::size_t*, const std::uint8_t**,
                        std::size_t) {
  return none3(c, "fmi3GetBinary", count);
}
FmiStatus fmi3SetBinary(void* c, const ValueReference*, std::size_t count, const std::size_t*,
                        const std::uint8_t* const*, std::size_t) {
  return none3(c, "fmi3SetBinary", count);
}
FmiStatus fmi3GetClock(void* c, const ValueReference*, std::size_t count, bool*) {
  return none3(c, "fmi3GetClock", count);
}
FmiStatus fmi3SetClock(void* c, const ValueReference*, std::size_t count, const bool*) {
  return none3(c, "fmi3SetClock", count);
}

FmiStatus fmi3GetNumberOfVariableDependencies(void* c, ValueReference, std::size_t*) {
  return refuse3(c, "fmi3GetNumberOfVariableDependencies", "this FMU does not tell dependencies of array elements");
}
FmiStatus fmi3GetVariableDependencies(void* c, ValueReference, std::size_t*, ValueReference*, std::size_t*, int*,
                                      std::size_t) {
  return refuse3(c, "fmi3GetVariableDependencies", "this FMU does not tell dependencies of array elements");
}

FmiStatus fmi3GetFMUState(void* c, void** state) {
  return call3(c, "fmi3GetFMUState", [&](Instance& i) { *state = espalier::fmu::held_state(i, *state); });
}
FmiStatus fmi3SetFMUState(void* c, void* state) {
  return call3(c, "fmi3SetFMUState", [&](Instance& i) { i.restore(espalier::fmu::bytes_of(state)); });
}
FmiStatus fmi3FreeFMUState(void* /*c*/, void** state) {
  if (state == nullptr) return FmiStatus::ok;
  delete static_cast<std::string*>(*state);
  *state = nullptr;
  return FmiStatus::ok;
}
FmiStatus fmi3SerializedFMUStateSize(void* c, void* state, std::size_t* size) {
  return call3(c, "fmi3SerializedFMUStateSize", [&](Instance&) { *size = espalier::fmu::bytes_of(state).size(); });
}
FmiStatus fmi3SerializeFMUState(void* c, void* state, std::uint8_t* bytes, std::size_t size) {
  return call3(c, "fmi3SerializeFMUState", [&](Instance&) { espalier::fmu::copy_state(state, bytes, size); });
}
FmiStatus fmi3DeserializeFMUState(void* c, const std::uint8_t* bytes, std::size_t size, void** state) {
  return call3(c, "fmi3DeserializeFMUState", [&](Instance&) {
    auto held = std::make_unique<std::string>(reinterpret_cast<const char*>(bytes), size);
    *state = held.release();
  });
}

FmiStatus fmi3GetDirectionalDerivative(void* c, const ValueReference* unknowns, std::size_t unknown_count,
                                       const ValueReference* knowns, std::size_t known_count, const double* seed,
                                       std::size_t seed_count, double* sensitivity, std::size_t sensitivity_count) {
  return call3(c, "fmi3GetDirectionalDerivative", [&](Instance& i) {
    i.directional({unknowns, unknown_count}, {knowns, known_count}, {seed, seed_count},
                  {sensitivity, sensitivity_count});
  });
}
FmiStatus fmi3GetAdjointDerivative(void* c, const ValueReference*, std::size_t, const ValueReference*, std::size_t,
                                   const double*, std::size_t, double*, std::size_t) {
  return refuse3(c, "fmi3GetAdjointDerivative", "this FMU gives directional derivatives");
}

FmiStatus fmi3EnterConfigurationMode(void* c) {
  return refuse3(c, "fmi3EnterConfigurationMode", "this FMU has no structural parameters");
}
FmiStatus fmi3ExitConfigurationMode(void* c) {
  return refuse3(c, "fmi3ExitConfigurationMode", "this FMU has no structural parameters");
}

FmiStatus fmi3GetIntervalDecimal(void* c, const ValueReference*, std::size_t count, double*, int*) {
  return none3(c, "fmi3GetIntervalDecimal", count);
}
FmiStatus fmi3GetIntervalFraction(void* c, const ValueReference*, std::size_t count, std::uint64_t*, std::uint64_t*,
                                  int*) {
  return none3(c, "fmi3GetIntervalFraction", count);
}
FmiStatus fmi3GetShiftDecimal(void* c, const ValueReference*, std::size_t count, double*) {
  return none3(c, "fmi3GetShiftDecimal", count);
}
FmiStatus fmi3GetShiftFraction(void* c, const ValueReference*, std::size_t count, std::uint64_t*, std::uint64_t*) {
  return none3(c, "fmi3GetShiftFraction", count);
}
FmiStatus fmi3SetIntervalDecimal(void* c, const ValueReference*, std::size_t count, const double*) {
  return none3(c, "fmi3SetIntervalDecimal", count);
}
FmiStatus fmi3SetIntervalFraction(void* c, const ValueReference*, std::size_t count, const std::uint64_t*,
                                  const std::uint64_t*) {
  return none3(c, "fmi3SetIntervalFraction", count);
}
FmiStatus fmi3SetShiftDecimal(void* c, const ValueReference*, std::size_t count, const double*) {
  return none3(c, "fmi3SetShiftDecimal", count);
}
FmiStatus fmi3SetShiftFraction(void* c, const ValueReference*, std::size_t count, const std::uint64_t*,
                               const std::uint64_t*) {
  return none3(c, "fmi3SetShiftFraction", count);
}

FmiStatus fmi3EvaluateDiscreteStates(void* c) {
  return call3(c, "fmi3EvaluateDiscreteStates", [](Instance&) {});
}
FmiStatus fmi3UpdateDiscreteStates(void* c, bool* need_update, bool* terminate, bool* nominals_changed,
                                   bool* values_changed, bool* next_defined, double* next) {
  *need_update = *terminate = *nominals_changed = *values_changed = *next_defined = false;
  *next = 0;
  return call3(c, "fmi3UpdateDiscreteStates", [](Instance& i) { i.expect_model_exchange(); });
}

// Model exchange

FmiStatus fmi3EnterContinuousTimeMode(void* c) {
  return call3(c, "fmi3EnterContinuousTimeMode", [](Instance& i) { i.expect_model_exchange(); });
}
FmiStatus fmi3CompletedIntegratorStep(void* c, bool, bool* enter_event_mode, bool* terminate) {
  *enter_event_mode = *terminate = false;
  return call3(c, "fmi3CompletedIntegratorStep", [](Instance& i) { i.expect_model_exchange(); });
}
FmiStatus fmi3SetTime(void* c, double time) {
  return call3(c, "fmi3SetTime", [&](Instance& i) { i.set_time(time); });
}
FmiStatus fmi3SetContinuousStates(void* c, const double* states, std::size_t count) {
  return call3(c, "fmi3SetContinuousStates", [&](Instance& i) { i.set_states({states, count}); });
}
FmiStatus fmi3GetContinuousStates(void* c, double* states, std::size_t count) {
  return call3(c, "fmi3GetContinuousStates", [&](Instance& i) { i.get_states({states, count}); });
}
FmiStatus fmi3GetContinuousStateDerivatives(void* c, double* derivatives, std::size_t count) {
  return call3(c, "fmi3GetContinuousStateDerivatives", [&](Instance& i) { i.get_derivatives({derivatives, count}); });
}
FmiStatus fmi3GetNominalsOfContinuousStates(void* c, double* nominals, std::size_t count) {
  return call3(c, "fmi3GetNominalsOfContinuousStates", [&](Instance&) { std::fill_n(nominals, count, 1.0); });
}
FmiStatus fmi3GetEventIndicators(void* c, double*, std::size_t count) {
  return count == 0 ? FmiStatus::ok : refuse3(c, "fmi3GetEventIndicators", "this FMU has no event indicators");
}
FmiStatus fmi3GetNumberOfEventIndicators(void* c, std::size_t* count) {
  return call3(c, "fmi3GetNumberOfEventIndicators", [&](Instance&) { *count = 0; });
}
FmiStatus fmi3GetNumberOfContinuousStates(void* c, std::size_t* count) {
  return call3(c, "fmi3GetNumberOfContinuousStates", [&](Instance& i) { *count = i.state_count(); });
}

// Co-simulation

FmiStatus fmi3EnterStepMode(void* c) { return refuse3(c, "fmi3EnterStepMode", "this FMU has no event mode"); }
FmiStatus fmi3GetOutputDerivatives(void* c, const ValueReference*, std::size_t count, const std::int32_t*, double*,
                                   std::size_t) {
  return count == 0 ? FmiStatus::ok
                    : refuse3(c, "fmi3GetOutputDerivatives", "this FMU gives no derivatives of outputs by time");
}
FmiStatus fmi3DoStep(void* c, double time, double step, bool /*no_set_state_before*/, bool* event_needed,
                     bool* terminate, bool* early, double* last_time) {
  *event_needed = *terminate = *early = false;
  *last_time = time;
  return call3(c, "fmi3DoStep", [&](Instance& i) {
    const espalier::fmu::StepEnd end = i.step(time, step);
    *terminate = end.terminated;
    *last_time = end.time;
  });
}
FmiStatus fmi3ActivateModelPartition(void* c, ValueReference, double) {
  return refuse3(c, "fmi3ActivateModelPartition", "this FMU is for co-simulation or model exchange");
}

}  // extern "C"
