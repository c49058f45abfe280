// Co-simulation by FMI 3.0.
#include <fmt/format.h>

#include <cmath>
#include <cstdint>

#include "espalier/types.hpp"
#include "fmi/foreign_versions.hpp"

namespace espalier::fmi {
namespace {

using Type = ForeignVariable::Type;

/// Calls `each` with the name of a type in the functions' names and a number of that type.
template <class Each>
auto with_type(Type type, const Each& each) {
  switch (type) {
    case Type::float32:
      return each("Float32", 0.0F);
    case Type::int8:
      return each("Int8", std::int8_t{});
    case Type::uint8:
      return each("UInt8", std::uint8_t{});
    case Type::int16:
      return each("Int16", std::int16_t{});
    case Type::uint16:
      return each("UInt16", std::uint16_t{});
    case Type::int32:
      return each("Int32", std::int32_t{});
    case Type::uint32:
      return each("UInt32", std::uint32_t{});
    case Type::int64:
      return each("Int64", std::int64_t{});
    case Type::uint64:
      return each("UInt64", std::uint64_t{});
    case Type::boolean:
      return each("Boolean", false);
    default:
      return each("Float64", 0.0);
  }
}

class Foreign3 final : public ForeignFmu {
 public:
  Foreign3(const std::string& name, const std::string& title, ModelDescription d, const ZipArchive& archive)
      : ForeignFmu(name, title, std::move(d), archive),
        free_(function<fmi3::FreeInstance>("fmi3FreeInstance")),
        enter_(function<fmi3::EnterInitializationMode>("fmi3EnterInitializationMode")),
        exit_(function<fmi3::Call>("fmi3ExitInitializationMode")),
        do_step_(function<fmi3::DoStep>("fmi3DoStep")) {
    load_state_functions("fmi3", "fmi3DeserializeFMUState");
  }
  ~Foreign3() override {
    if (instance_ != nullptr) free_(instance_);
  }

  void begin(double time, const std::vector<std::pair<ForeignVariable, Value>>& start) override {
    if (instance_ != nullptr) free_(instance_);
    instance_ =
        status_of("fmi3InstantiateCoSimulation", function<fmi3::InstantiateCoSimulation>("fmi3InstantiateCoSimulation"),
                  name_.c_str(), description().token.c_str(), (unpacked_.resources() + "/").c_str(), false, false,
                  false, false, nullptr, 0, this, &Foreign3::log, nullptr);
    if (instance_ == nullptr) check(FmiStatus::error, "fmi3InstantiateCoSimulation");
    for (const auto& [variable, value] : start) {
      if (const auto* text = std::get_if<std::string>(&value)) {
        const char* given = text->c_str();
        call("fmi3SetString", function<fmi3::Set<const char*>>("fmi3SetString"), instance_, &variable.reference, 1,
             &given, 1);
      } else {
        set(variable, std::get<double>(value));
      }
    }
    call("fmi3EnterInitializationMode", enter_, instance_, false, 0, time, false, 0);
  }
  void end_initialization() override { call("fmi3ExitInitializationMode", exit_, instance_); }

  void set(const ForeignVariable& v, double value) override {
    check_value(v, value, true);
    with_type(v.type, [&](const char* name, auto number) {
      using Number = decltype(number);
      if constexpr (std::is_same_v<Number, bool>) {
        number = value >= 0.5;
      } else if constexpr (std::is_integral_v<Number>) {
        number = rounded<Number>(v, value);
      } else {
        number = static_cast<Number>(value);
      }
      const std::string symbol = std::string("fmi3Set") + name;
      call(symbol.c_str(), function<fmi3::Set<Number>>(symbol.c_str()), instance_, &v.reference, 1, &number, 1);
    });
  }
  double get(const ForeignVariable& v) override {
    return with_type(v.type, [&](const char* name, auto number) {
      using Number = decltype(number);
      const std::string symbol = std::string("fmi3Get") + name;
      call(symbol.c_str(), function<fmi3::Get<Number>>(symbol.c_str()), instance_, &v.reference, 1, &number, 1);
      return static_cast<double>(number);
    });
  }

  bool step(double time, double length) override {
    bool event = false, terminate = false, early = false;
    double last = time;
    call("fmi3DoStep", do_step_, instance_, time, length, false, &event, &terminate, &early, &last);
    if (early && !terminate) refuse(fmt::format("fmi3DoStep came back at {}, though that was not allowed", last));
    return !terminate;
  }

 private:
  static void log(void* environment, FmiStatus status, const char* /*category*/, const char* message) {
    if (message != nullptr && status != FmiStatus::ok) static_cast<Foreign3*>(environment)->hear(message);
  }

  fmi3::FreeInstance free_;
  fmi3::EnterInitializationMode enter_;
  fmi3::Call exit_;
  fmi3::DoStep do_step_;
};

}  // namespace

std::unique_ptr<ForeignFmu> load_fmi3(const std::string& name, const std::string& title, ModelDescription description,
                                      const ZipArchive& archive) {
  return std::make_unique<Foreign3>(name, title, std::move(description), archive);
}

}  // namespace espalier::fmi
