/// \file
/// Failures of models as a status, for the public entries.
#pragma once

#include <new>
#include <stdexcept>

#include "espalier/types.hpp"

namespace espalier::dynamics::model {

/// Runs `action`. @return what it throws: an Error's status, or that the machine's memory is too small
template <class Action>
[[nodiscard]] Status guarded(const Action& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.status();
  } catch (const std::bad_alloc&) {
    return {StatusCode::out_of_memory, "the machine's memory is too small for this model", -1};
  } catch (const std::length_error&) {
    return {StatusCode::out_of_memory, "the model needs an array longer than the machine can address", -1};
  }
  return {};
}

}  // namespace espalier::dynamics::model
