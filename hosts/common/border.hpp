/// \file
/// The border between a host program and us: no exception crosses it.
#pragma once

#include <new>

namespace espalier::hosts {

/// Marks the functions that a host finds; everything else in its library is hidden.
#define ESPALIER_HOST_CALL extern "C" __attribute__((visibility("default")))

/// Runs `body`; what it throws becomes `out_of_memory()` or `internal_error()`.
template <class Body, class OutOfMemory, class InternalError>
void guarded(Body&& body, OutOfMemory&& out_of_memory, InternalError&& internal_error) noexcept {
  try {
    body();
  } catch (const std::bad_alloc&) {
    out_of_memory();
  } catch (...) {
    internal_error();
  }
}

}  // namespace espalier::hosts
