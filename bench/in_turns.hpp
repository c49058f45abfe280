// What the programs of this folder share that measure calls of the library in turns.
#pragma once

#include <algorithm>
#include <chrono>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "espalier/solver.hpp"
#include "matrix/generators/generate.hpp"

namespace espalier::bench {

/// Seconds of one call, by the clock on the wall.
template <class Body>
double seconds_of(Body&& body) {
  const auto start = std::chrono::steady_clock::now();
  std::forward<Body>(body)();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// The median; of an even number of samples the upper one of the middle two; NaN of none.
inline double median(std::vector<double> samples) {
  if (samples.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(samples.begin(), samples.end());
  return samples[samples.size() / 2];
}

/// @throws std::runtime_error with the message of a call that has failed.
inline void check(const Status& status) {
  if (!status.ok()) throw std::runtime_error(status.message);
}

/// A generated system of N^3 cells in the order of its grid: x slowest, z fastest.
inline SparseMatrix grid_system(const std::string& name, Index n) {
  matrix::GeneratorSpec spec = matrix::parse_generator(std::vector<std::string>{name, std::to_string(n)});
  spec.numbering = matrix::Numbering::natural;
  return matrix::generate(spec);
}

}  // namespace espalier::bench
