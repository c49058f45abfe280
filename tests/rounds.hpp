/// \file
/// How often tests repeat themselves: builds with sanitizers are many times slower.
#pragma once

namespace espalier::test {

/// @returns all; in a build with sanitizers, sanitized
template <class T>
constexpr T rounds([[maybe_unused]] T all, [[maybe_unused]] T sanitized) {
#if defined(ESPALIER_SANITIZED)
  return sanitized;
#else
  return all;
#endif
}

}  // namespace espalier::test
