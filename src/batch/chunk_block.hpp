/// \file
/// The places in a chunk. For the sources of Chunk alone.
#pragma once

#include <algorithm>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "base/at.hpp"
#include "batch/chunk.hpp"
#include "solve/residual.hpp"

namespace espalier::batch {

/// A place in the chunk, and the system that has it.
class Chunk::Block {
 public:
  Block(const solver::System& of, std::shared_ptr<const solver::Scales> of_system, Index first_unknown,
        Offset first_entry, base::ThreadPool& pool)
      : system(of),
        scales(std::move(of_system)),
        first(first_unknown),
        entry(first_entry),
        residual(prepared().a, system.rows, pool) {}
  [[nodiscard]] const solver::PreparedMatrix& prepared() const { return system.prepared; }
  [[nodiscard]] Index n() const { return prepared().n(); }
  /// The next system. @param place  where its values will stand
  void begin(std::span<const double> place) {
    residual.set_values(place);
    left = true;  // until it has values
    negative = 0;
    refined = {};
    steps.reset();
  }

  /// Takes the result of some of its right-hand sides.
  void note(const solve::RefinementResult& r) {
    refined.error.normwise = std::max(refined.error.normwise, r.error.normwise);
    refined.error.componentwise = std::max(refined.error.componentwise, r.error.componentwise);
    refined.steps = std::max(refined.steps, r.steps);
  }

  const solver::System& system;
  const std::shared_ptr<const solver::Scales> scales;  // equal systems share them
  const Index first;                                   // of its unknowns in the chunk
  const Offset entry;                                  // likewise of its values
  solve::ResidualOperator residual;
  bool left = false;      // to the caller
  Index negative = 0;     // eigenvalues (ldlt)
  std::vector<double> x;  // n x columns
  solve::RefinementResult refined;
  std::unique_ptr<solve::Refinement> steps;
};

// Always on the same thread for a block.
template <class Body>
void Chunk::for_blocks(Body&& body) {
  const auto threads = static_cast<Index>(workers_.size());
  context_.pool.run([&](int t) {
    for (Index k = t; k < static_cast<Index>(blocks_.size()); k += threads) body(*blocks_[at(k)], k);
  });
}

}  // namespace espalier::batch
