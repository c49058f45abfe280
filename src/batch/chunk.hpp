/// \file
/// Many systems as one block-diagonal system: what fills a device that one of them does not.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "espalier/batch.hpp"
#include "solve/refinement_steps.hpp"
#include "solver/analysis/analysis.hpp"
#include "solver/factor/numeric.hpp"
#include "solver/session/context.hpp"

namespace espalier::batch {

/// Arrays of one system: the caller's values, and columns x n numbers each.
struct ChunkSystem {
  std::span<const double> values;
  const double* b = nullptr;
  double* x = nullptr;  ///< may be b
};

/// Up to Chunk::systems() systems, each for the block of its number.
struct ChunkJob {
  std::span<const ChunkSystem> systems;
  Index columns = 1;
  bool transpose = false;
};

/// The analysis is that of one system, repeated, or those of several systems beside each other: order, scaling,
/// matching and tiles of a block are those of its system, and blocks meet nowhere. So a block comes to the numbers that
/// its system comes to alone, where no pivot fails. A system of which one does is left to its caller, and so is one
/// whose solution is not accurate.
class Chunk {
 public:
  /// Whether factors with these options can be judged by blocks.
  static bool serves(const Options& options);
  /// How many systems of any number `chunks` at a time should take, by the memory that is free now; 0: go one by one.
  static Index best_size(const solver::Analysis& one, Index chunks, const solver::Context& context);
  /// The same by ESPALIER_BATCH_CHUNK, for tests and measurements on any device; nothing: it is not set.
  /// @throws Error(invalid_input)
  static std::optional<Index> wished_size();

  /// Makes a chunk of one system repeated. @param context  outlives this
  /// @throws Error(out_of_memory), Error(device_error)
  Chunk(const solver::SharedAnalysis& one, Index systems, const solver::Context& context);
  /// Makes a chunk of systems beside each other, whose analysis is `joined`. The systems outlive this.
  Chunk(solver::SharedAnalysis joined, const std::vector<const solver::System*>& systems,
        const solver::Context& context);
  /// Another one like it, with the same analysis.
  Chunk(const Chunk& like, const solver::Context& context);
  ~Chunk();
  Chunk(const Chunk&) = delete;
  Chunk& operator=(const Chunk&) = delete;

  [[nodiscard]] Index systems() const { return static_cast<Index>(systems_.size()); }
  /// Since construction: taking values, factorizing, substituting, and the rest (residuals and verdicts). On a device
  /// that keeps the values, refinement is a part of substituting.
  struct Seconds {
    double values = 0, factorizations = 0, substitutions = 0, residuals = 0;
    Seconds& operator+=(const Seconds& other);
  };
  [[nodiscard]] const Seconds& seconds() const { return seconds_; }
  /// Solves what can be solved together. @param results  of the systems of the job; those of systems that are left are
  /// not touched, nor is their x
  /// @returns which are left, by 1; empty: all are, since there is no factor that tells the inertia of each
  std::vector<char> solve(const ChunkJob& job, std::span<SystemResult> results);

 private:
  class Block;
  /// What a thread has for the block in hand.
  struct Worker {
    base::ThreadPool pool{1};
    solver::Values values;
    std::vector<double> scaled;
  };

  // Vectors of the block-diagonal system, one after another.
  using Vectors = std::shared_ptr<double[]>;

  Chunk(solver::SharedAnalysis one, solver::SharedAnalysis all, std::vector<const solver::System*> systems,
        const solver::Context& context);
  void make_blocks();
  template <class Body>
  void for_blocks(Body&& body);
  [[nodiscard]] Block& block_of(Index position);
  [[nodiscard]] std::span<double> values_of(const Block& block);
  [[nodiscard]] double* column_of(const Vectors& vectors, const Block& block, Index column) const;
  void take_vectors(Index columns);
  void take_systems(const ChunkJob& job);
  bool take_right_hand_sides(const ChunkJob& job, const Block& block, Index k);
  bool take_values(const ChunkJob& job, const Block& block, Index k);
  bool fill_gaps();
  bool factorize();
  void note_failures(const device::FactorOutcome& outcome);
  bool take_inertia();
  bool proves_inertia(Index negative);
  void substitute(Index columns, bool transpose);
  bool solve_on_device(const ChunkJob& job, bool refined);
  void solve_on_host(const ChunkJob& job, bool refined);
  void refine(const ChunkJob& job);
  void correct(Index columns, bool transpose);
  void finish(const ChunkJob& job, bool refined, std::span<SystemResult> results);

  solver::SharedAnalysis one_, all_;            // null: of no one; of the block-diagonal system
  std::vector<const solver::System*> systems_;  // of the blocks
  const solver::Context& context_;
  const Index n_;  // of all
  std::vector<double> values_;
  std::unique_ptr<solver::Numeric> numeric_;
  std::vector<std::unique_ptr<Worker>> workers_;  // of the threads
  std::vector<std::unique_ptr<Block>> blocks_;
  Vectors from_, to_;
  Index columns_ = 0;                           // that have room in them
  solve::RefinementOptions refinement_;         // of a system alone
  std::vector<solve::RefinementResult> parts_;  // columns x systems
  Seconds seconds_;
};

}  // namespace espalier::batch
