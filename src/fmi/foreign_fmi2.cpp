// Co-simulation by FMI 2.0.
#include <fmt/format.h>

#include <cmath>
#include <cstdarg>
#include <cstdlib>

#include "espalier/types.hpp"
#include "fmi/foreign_versions.hpp"

namespace espalier::fmi {
namespace {

using Type = ForeignVariable::Type;

class Foreign2 final : public ForeignFmu {
 public:
  Foreign2(const std::string& name, const std::string& title, ModelDescription d, const ZipArchive& archive)
      : ForeignFmu(name, title, std::move(d), archive),
        free_(function<fmi2::FreeInstance>("fmi2FreeInstance")),
        setup_(function<fmi2::SetupExperiment>("fmi2SetupExperiment")),
        enter_(function<fmi2::Call>("fmi2EnterInitializationMode")),
        exit_(function<fmi2::Call>("fmi2ExitInitializationMode")),
        get_real_(function<fmi2::GetReal>("fmi2GetReal")),
        set_real_(function<fmi2::SetReal>("fmi2SetReal")),
        get_integer_(function<fmi2::GetInteger>("fmi2GetInteger")),
        get_boolean_(function<fmi2::GetInteger>("fmi2GetBoolean")),
        set_integer_(function<fmi2::SetInteger>("fmi2SetInteger")),
        set_boolean_(function<fmi2::SetInteger>("fmi2SetBoolean")),
        set_string_(function<fmi2::SetString>("fmi2SetString")),
        do_step_(function<fmi2::DoStep>("fmi2DoStep")),
        boolean_status_(function<fmi2::GetBooleanStatus>("fmi2GetBooleanStatus")) {
    load_state_functions("fmi2", "fmi2DeSerializeFMUstate");
  }
  ~Foreign2() override {
    if (instance_ != nullptr) free_(instance_);
  }

  void begin(double time, const std::vector<std::pair<ForeignVariable, Value>>& start) override {
    if (instance_ != nullptr) free_(instance_);
    const std::string location = "file://" + encoded(unpacked_.resources());
    instance_ = status_of("fmi2Instantiate", function<fmi2::Instantiate>("fmi2Instantiate"), name_.c_str(),
                          fmi2::Type::co_simulation, description().token.c_str(), location.c_str(), &callbacks_, 0, 0);
    if (instance_ == nullptr) check(FmiStatus::error, "fmi2Instantiate");
    for (const auto& [variable, value] : start) {
      if (const auto* text = std::get_if<std::string>(&value)) {
        const char* given = text->c_str();
        call("fmi2SetString", set_string_, instance_, &variable.reference, 1, &given);
      } else {
        set(variable, std::get<double>(value));
      }
    }
    call("fmi2SetupExperiment", setup_, instance_, 0, 0, time, 0, 0);
    call("fmi2EnterInitializationMode", enter_, instance_);
  }
  void end_initialization() override { call("fmi2ExitInitializationMode", exit_, instance_); }

  void set(const ForeignVariable& v, double value) override {
    check_value(v, value, true);
    if (v.type == Type::real) return call("fmi2SetReal", set_real_, instance_, &v.reference, 1, &value);
    const int whole = v.type == Type::boolean ? (value >= 0.5 ? 1 : 0) : rounded<int>(v, value);
    if (v.type == Type::boolean) return call("fmi2SetBoolean", set_boolean_, instance_, &v.reference, 1, &whole);
    call("fmi2SetInteger", set_integer_, instance_, &v.reference, 1, &whole);
  }
  double get(const ForeignVariable& v) override {
    double value = 0;
    int whole = 0;
    if (v.type == Type::real) {
      call("fmi2GetReal", get_real_, instance_, &v.reference, 1, &value);
    } else if (v.type == Type::boolean) {
      call("fmi2GetBoolean", get_boolean_, instance_, &v.reference, 1, &whole);
      value = whole != 0 ? 1 : 0;
    } else {
      call("fmi2GetInteger", get_integer_, instance_, &v.reference, 1, &whole);
      value = whole;
    }
    return value;
  }

  bool step(double time, double length) override {
    const FmiStatus status = status_of("fmi2DoStep", do_step_, instance_, time, length, 0);
    Boolean2 terminated = 0;
    if (status == FmiStatus::discard &&
        boolean_status_(instance_, fmi2::StatusKind::terminated, &terminated) == FmiStatus::ok && terminated != 0)
      return false;
    check(status, "fmi2DoStep");
    return true;
  }

 private:
  static std::string encoded(const std::string& path) {
    std::string out;
    for (const char c : path)
      if (c == '%' || c == ' ' || c == '#' || c == '?')
        out += fmt::format("%{:02X}", static_cast<unsigned char>(c));
      else
        out += c;
    return out;
  }
  static void log(void* environment, const char* /*instance*/, FmiStatus status, const char* /*category*/,
                  const char* message, ...) {
    if (message == nullptr || status == FmiStatus::ok) return;
    char text[1000];
    std::va_list values;
    va_start(values, message);
    std::vsnprintf(text, sizeof text, message, values);
    va_end(values);
    static_cast<Foreign2*>(environment)->hear(text);
  }

  const fmi2::Callbacks callbacks_ = {&Foreign2::log, &std::calloc, &std::free, nullptr, this};
  fmi2::FreeInstance free_;
  fmi2::SetupExperiment setup_;
  fmi2::Call enter_, exit_;
  fmi2::GetReal get_real_;
  fmi2::SetReal set_real_;
  fmi2::GetInteger get_integer_, get_boolean_;
  fmi2::SetInteger set_integer_, set_boolean_;
  fmi2::SetString set_string_;
  fmi2::DoStep do_step_;
  fmi2::GetBooleanStatus boolean_status_;
};

}  // namespace

std::unique_ptr<ForeignFmu> load_fmi2(const std::string& name, const std::string& title, ModelDescription description,
                                      const ZipArchive& archive) {
  return std::make_unique<Foreign2>(name, title, std::move(description), archive);
}

}  // namespace espalier::fmi
