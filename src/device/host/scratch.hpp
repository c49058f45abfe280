/// \file
/// Working memory of the dense kernels: one buffer per thread that grows to the largest request and then stays.
#pragma once

#include <cstdint>

namespace espalier::device::host {

/// At least `bytes` of 64-byte aligned memory of the calling thread, valid until its next call. Nested users share it:
/// only the outermost routine of a kernel may ask. @throws std::bad_alloc
void* scratch_bytes(std::int64_t bytes);

template <class T>
T* scratch(std::int64_t elements) {
  return static_cast<T*>(scratch_bytes(elements * static_cast<std::int64_t>(sizeof(T))));
}

}  // namespace espalier::device::host
