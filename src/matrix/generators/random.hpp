/// \file
/// Reproducible random numbers: the same on every machine and for every number of threads, unlike <random>'s
/// distributions.
#pragma once

#include <cstdint>
#include <vector>

#include "base/mix.hpp"
#include "espalier/types.hpp"

namespace espalier::matrix {

/// The `counter`-th number of stream `seed`: splitmix64 (G. Steele, D. Lea, C. Flood, "Fast splittable pseudorandom
/// number generators", OOPSLA 2014) of seed + counter.
constexpr std::uint64_t random_bits(std::uint64_t seed, std::uint64_t counter) {
  return base::mix(seed * 0xd1342543de82ef95u + (counter + 1) * 0x9e3779b97f4a7c15u);
}

/// Uniform in [0, 1), a multiple of 2^-53.
constexpr double random_unit(std::uint64_t seed, std::uint64_t counter) {
  return static_cast<double>(random_bits(seed, counter) >> 11) * 0x1p-53;
}

/// Uniform in 0..below-1 (up to a bias of below / 2^32). @pre 0 < below <= 2^32
constexpr std::uint64_t random_below(std::uint64_t seed, std::uint64_t counter, std::uint64_t below) {
  return (random_bits(seed, counter) >> 32) * below >> 32;
}

/// A random permutation of 0..n-1 (Fisher and Yates).
std::vector<Index> random_permutation(Index n, std::uint64_t seed);

}  // namespace espalier::matrix
