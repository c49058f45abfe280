/// \file
/// Batches: many small systems in one call, one on each thread, or many together on a GPU.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "espalier/solver.hpp"

namespace espalier {

/// What became of one system of a batch.
struct SystemResult {
  Status status;
  Inertia inertia;            ///< -1 for lu
  Index rank = -1;            ///< n less the singular values that are zero to the rounding of the entries
  Index perturbed = 0;        ///< pivots that were replaced
  int refinement_steps = 0;   ///< the most of any right-hand side
  double backward_error = 0;  ///< normwise, the largest of any right-hand side; as SolveResult has it
  double componentwise_error = 0;
};

/// What became of a batch.
struct BatchResult {
  /// Ok where all systems are. Else the code of the first failure, and a message with its number and how many failed.
  Status status;
  Index failed = 0;                   ///< systems whose status is not ok
  std::vector<SystemResult> systems;  ///< in the caller's order; empty where nothing was begun
  double seconds = 0;                 ///< whole call
  int workers = 0;                    ///< most systems that were worked on at a time
};

/// Many systems of one pattern. The pattern is analyzed once; then each system is factorized and solved by one thread,
/// next to the others. Solutions have the bits that a Solver with this analysis would give for the system alone,
/// whatever the number of threads and the order of the batch (precision auto apart, which looks at the clock). One
/// system that fails does not touch the others.
///
/// A GPU takes as many systems at a time as fill it: two block-diagonal systems with the analysis repeated, one of
/// which the GPU works on while the host is busy with the other. Each system is refined there and judged for itself;
/// where a pivot fails, or a solution is not accurate, the system is solved again alone, and ends as it would have.
/// Inertia is told by the signs of each system's pivots; out of core, by the number of all negative eigenvalues, where
/// these are as few as regular matrices with their diagonals can have (those of [K B^T; B -C] with a diagonal C), and
/// elsewhere all are solved alone. Factors are those of single systems; refinement ends at a componentwise error of
/// 1e-15, so that solutions may differ from those of a Solver on that GPU in the last bits. With precision fp32, mixed
/// and auto, rescale, zero_pivot or perturbation systems go one after another.
class Batch {
 public:
  /// Options as for Solver. `threads`: systems at a time; where there are fewer systems, each gets several threads.
  /// device auto looks at one system alone: name a GPU (gpu:0) for batches of small ones. Log lines come from the
  /// analysis, and say how many systems were solved together.
  /// @throws std::invalid_argument for numbers and enumerations that no option can be
  explicit Batch(Options options = {});
  ~Batch();
  Batch(Batch&&) noexcept;
  Batch& operator=(Batch&&) noexcept;

  /// As Solver::analyze(): `a` has values that are typical of the batch, or none.
  AnalysisResult analyze(const MatrixView& a);
  /// op(A_k) X_k = B_k for `count` systems. No factor is kept; each worker has memory for one, which stays for the next
  /// call.
  /// @param values  count * nonzeros: of one system after another, each in the order of the analyzed matrix
  /// @param b, x    count * columns * n: of one system after another, column by column; x may be b. Solutions of
  /// systems
  ///                that fail are NaN, but for accuracy_not_reached: there they are the best that was found
  /// @pre analyze() was called, and succeeded
  /// @throws std::invalid_argument for arrays of other sizes, std::logic_error without an analysis
  BatchResult solve(std::span<const double> values, std::span<const double> b, std::span<double> x, Index count,
                    Index columns = 1, Transpose transpose = Transpose::no);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A system of a pattern of its own.
struct System {
  MatrixView a;               ///< with values
  std::span<const double> b;  ///< columns * n
  std::span<double> x;        ///< likewise; may be b
  Index columns = 1;
  Transpose transpose = Transpose::no;
};

/// Many small systems of any patterns: each is analyzed, factorized and solved by one thread, with the bits that a
/// Solver of these options gives for it. Nothing is kept. Options, statuses and solutions as for Batch.
///
/// Where a GPU is named, or `device` is auto and the model of the machine predicts that the GPU is faster for many
/// together, each system is ordered by a thread, and as many as fill the GPU are factorized and solved there as one
/// block-diagonal system, each scaled, refined and judged for itself. Those that fail there go on alone on the cores,
/// from their order, and end as they would have there. On a named GPU, 64 or more systems of one pattern (and of a kind
/// that their values do not decide on) go through a Batch instead; what fails in it is solved once more with an
/// analysis of its own. Groups take half of the GPU's memory, or of its budget, and are cut where that is too little;
/// systems of more than 16,384 unknowns are solved by themselves. With the options with which a
/// Batch solves one after another, so does this.
BatchResult solve_systems(std::span<const System> systems, const Options& options = {});

}  // namespace espalier
