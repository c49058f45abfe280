#include "command.hpp"

namespace espalier::cli {

int exit_code(StatusCode code) {
  switch (code) {
    case StatusCode::ok:
      return kSolved;
    case StatusCode::invalid_input:
      return kBadInput;
    case StatusCode::singular:
    case StatusCode::not_positive_definite:
      return kSingular;
    case StatusCode::out_of_memory:
      return kMemory;
    case StatusCode::device_error:
      return kDevice;
    case StatusCode::accuracy_not_reached:
      return kAccuracy;
    case StatusCode::cancelled:
      return kInterrupted;
  }
  return kInternalError;
}

}  // namespace espalier::cli
