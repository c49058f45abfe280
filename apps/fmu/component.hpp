/// \file
/// What both standards' functions do around an instance: errors become messages of the caller's logger and a status.
#pragma once

#include <algorithm>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "instance.hpp"

namespace espalier::fmu {

using fmi::FmiStatus;

/// An instance with its caller. `Log` is called with a status, a category and a message.
template <class Log>
class Component {
 public:
  Component(Log log, bool logging) : log_(std::move(log)), logging_(logging) {}

  void make(const std::string& resources, const char* token, bool model_exchange) {
    instance_ = std::make_unique<Instance>(resources, token == nullptr ? "" : token, model_exchange);
  }
  [[nodiscard]] Instance& instance() { return *instance_; }
  void set_logging(bool on) { logging_ = on; }

  /// @param function the name of the standard's function, for the message
  template <class Body>
  FmiStatus call(const char* function, const Body& body) noexcept {
    FmiStatus status = FmiStatus::ok;
    try {
      try {
        body();
        tell_notices();
      } catch (const Error& error) {
        // Newton's iteration may succeed with a shorter step, from a state that the caller has kept.
        status = error.status().code == StatusCode::accuracy_not_reached ? FmiStatus::discard : FmiStatus::error;
        tell(status, function, error.what());
      } catch (const std::bad_alloc&) {
        tell(status = FmiStatus::error, function, "the machine's memory is too small for this model");
      } catch (const std::exception& error) {
        tell(status = FmiStatus::error, function, error.what());
      }
    } catch (...) {  // no memory for the message
      status = FmiStatus::error;
    }
    return status;
  }
  void tell(FmiStatus status, const char* function, const std::string& message) {
    const char* category = status == FmiStatus::warning   ? "logStatusWarning"
                           : status == FmiStatus::discard ? "logStatusDiscard"
                                                          : "logStatusError";
    log_(status, category, std::string(function) + ": " + message);
  }

 private:
  void tell_notices() {
    if (!instance_) return;
    for (const std::string& notice : instance_->take_notices())
      if (logging_) log_(FmiStatus::warning, "logStatusWarning", notice);
  }

  Log log_;
  bool logging_;
  std::unique_ptr<Instance> instance_;
};

/// States that a caller holds.
inline void* held_state(Instance& instance, void* before) {
  auto bytes = std::make_unique<std::string>(instance.save());
  if (before == nullptr) return bytes.release();
  *static_cast<std::string*>(before) = std::move(*bytes);
  return before;
}
inline const std::string& bytes_of(void* state) {
  if (state == nullptr) throw std::invalid_argument("the FMU state is null");
  return *static_cast<const std::string*>(state);
}
inline void copy_state(void* state, std::uint8_t* out, std::size_t size) {
  const std::string& bytes = bytes_of(state);
  if (size < bytes.size()) throw std::invalid_argument("the memory for the FMU state is too small");
  std::copy(bytes.begin(), bytes.end(), out);
}

}  // namespace espalier::fmu
