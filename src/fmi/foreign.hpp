/// \file
/// An FMU of another program, unpacked and loaded, that is stepped through time beside us.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "fmi/crash_note.hpp"
#include "fmi/held_folder.hpp"
#include "fmi/model_description.hpp"
#include "fmi/zip.hpp"

namespace espalier::fmi {

/// A folder with what an FMU holds, gone in the end.
class UnpackedFmu {
 public:
  /// Binaries of this platform and resources. @throws Error(invalid_input)
  UnpackedFmu(const ZipArchive& archive, const ModelDescription& description, const std::string& fmu);
  [[nodiscard]] const std::string& binary() const { return binary_; }
  [[nodiscard]] std::string resources() const { return folder_.path() + "/resources"; }

 private:
  HeldFolder folder_;
  std::string binary_;
};

/// One instance. All calls throw Error(invalid_input) that names the FMU, the function and what the FMU said.
class ForeignFmu {
 public:
  /// @param name of the instance @param file of the FMU, for messages @param bytes of that file
  [[nodiscard]] static std::unique_ptr<ForeignFmu> load(const std::string& name, const std::string& file,
                                                        std::string bytes);
  virtual ~ForeignFmu();
  ForeignFmu(const ForeignFmu&) = delete;
  ForeignFmu& operator=(const ForeignFmu&) = delete;

  [[nodiscard]] const ModelDescription& description() const { return description_; }
  [[nodiscard]] const std::string& title() const { return title_; }  ///< "FMU 'pump' (pump.fmu)"

  /// Forgets everything and begins anew: sets `start` values, then the initialization is open.
  using Value = std::variant<double, std::string>;
  virtual void begin(double time, const std::vector<std::pair<ForeignVariable, Value>>& start) = 0;
  virtual void end_initialization() = 0;
  virtual void set(const ForeignVariable& variable, double value) = 0;
  [[nodiscard]] virtual double get(const ForeignVariable& variable) = 0;
  /// @return false: the FMU wants the run to end
  [[nodiscard]] virtual bool step(double time, double length) = 0;
  /// The state as bytes. @pre description().serializes_state
  [[nodiscard]] std::string save();
  void restore(std::string_view bytes);

 protected:
  ForeignFmu(std::string name, std::string title, ModelDescription description, const ZipArchive& archive);
  /// @throws where the library has no such function
  template <class Function>
  [[nodiscard]] Function function(const char* symbol) const {
    return reinterpret_cast<Function>(find_function(symbol));
  }
  /// Calls a function of the FMU. @param told its name
  template <class Function, class... Arguments>
  void call(const char* told, Function f, Arguments... arguments) const {
    check(status_of(told, f, arguments...), told);
  }
  template <class Function, class... Arguments>
  auto status_of(const char* told, Function f, Arguments... arguments) const {
    const CrashNote note(title_, told);
    return f(arguments...);
  }
  /// What came of a call.
  void check(FmiStatus status, const char* told) const;
  [[noreturn]] void refuse(const std::string& what) const;
  void hear(const std::string& message);  ///< of the FMU's logger
  /// @throws where no number of the type, nor of a real variable, is the value rounded
  void check_value(const ForeignVariable& v, double value, bool fits) const;
  template <class Integer>
  [[nodiscard]] Integer rounded(const ForeignVariable& v, double value) const {
    const double whole = std::round(value);
    check_value(v, value,
                whole >= static_cast<double>(std::numeric_limits<Integer>::lowest()) &&
                    whole < std::ldexp(1.0, std::numeric_limits<Integer>::digits));
    return static_cast<Integer>(whole);
  }
  void load_state_functions(const char* prefix, const char* deserialize);
  void* instance_ = nullptr;
  std::string name_;
  UnpackedFmu unpacked_;

 private:
  [[nodiscard]] void* find_function(const char* symbol) const;

  std::string title_;
  ModelDescription description_;
  void* library_ = nullptr;
  mutable std::vector<std::string> heard_;  // since the last call that went well
  GetState get_state_ = nullptr, free_state_ = nullptr;
  SetState set_state_ = nullptr;
  StateSize state_size_ = nullptr;
  SerializeState serialize_ = nullptr;
  DeserializeState deserialize_ = nullptr;
};

}  // namespace espalier::fmi
