// A hash of 64 bits.
#pragma once

#include <cstdint>

namespace espalier::base {

/// The finalizer of splitmix64 (Steele, Lea, Flood 2014): every bit of x changes half of the bits of the result.
constexpr std::uint64_t mix(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

}  // namespace espalier::base
