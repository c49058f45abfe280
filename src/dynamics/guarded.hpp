/// \file
/// Failures as a status, for the public entries of models and systems.
#pragma once

#include <new>
#include <stdexcept>
#include <string>

#include "espalier/types.hpp"

namespace espalier::dynamics {

/// Runs `action`. @param what  the memory is too small for @return what it throws: an Error's status, or out of memory
template <class Action>
[[nodiscard]] Status guarded(const Action& action, const std::string& what = "model") {
  try {
    action();
  } catch (const Error& error) {
    return error.status();
  } catch (const std::bad_alloc&) {
    return {StatusCode::out_of_memory, "the machine's memory is too small for this " + what, -1};
  } catch (const std::length_error&) {
    return {StatusCode::out_of_memory, "the " + what + " needs an array longer than the machine can address", -1};
  }
  return {};
}

}  // namespace espalier::dynamics
