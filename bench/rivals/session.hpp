/// \file
/// One system, all rivals: who does what when, and what comes out.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "matrix/residual.hpp"
#include "measure/document.hpp"
#include "rivals/child.hpp"
#include "rivals/system_view.hpp"

namespace espalier::bench {

/// How the rivals are compared.
struct Plan {
  std::vector<std::string> rivals;  ///< name or name:variant
  Kind kind = Kind::llt;            ///< not automatic
  int threads = 1;
  /// Rounds of refactorization and solves after one round of warm-up; 0: the first factorization and one round of
  /// solves after it are all, for what takes minutes.
  int repetitions = 5;
  int analyses = 3;             ///< rounds of analysis
  Index columns = 32;           ///< right-hand sides of the second solve
  bool one_at_a_time = false;   ///< a rival's process ends before the next starts (for systems that fill the memory)
  double wrong_above = 1e-8;    ///< a normwise backward error above it is a wrong answer
  double pause_seconds = 0.05;  ///< before each turn: spinning threads of the last rival go to sleep
  bool warm = true;             ///< short calls are made before the one that counts (warm_up() in protocol.hpp)
  /// Values of the rounds in turn, each in the order of the matrix; empty: its own values times a factor that changes.
  std::vector<std::vector<double>> sequence;
  ChildSettings child;
};

using measure::Samples;

/// What is known of one rival in the end. Figures are valid up to the phase that ended the verdict.
struct Row {
  std::string spec;  ///< as asked for
  std::string version;
  Verdict verdict;
  Samples analysis, first_factorization, refactorization, solve_one, solve_many;
  Offset nonzeros_factor = -1;
  double flops = -1;
  Inertia inertia;
  Index perturbed = -1;
  int refinement_steps = -1;
  bool checked = false;          ///< an answer came and was judged
  matrix::BackwardErrors error;  ///< the worst of all checked answers
  Offset peak_bytes = -1, device_bytes = -1, predicted_bytes = -1;
  std::vector<std::vector<DeviceReport>> devices;  ///< of each timed refactorization, in the order of its samples
};

/// Called before each step with what is about to happen.
using Progress = std::function<void(const std::string& what)>;

/// Runs the plan on `a`, whose values must be present. Each round takes the rivals in turn, the first one changing from
/// round to round; values change every round by a common factor or as the plan's sequence says; right-hand sides are
/// random (seeded) and the same for all. Never throws for what a rival does.
/// @throws std::invalid_argument when the kind is llt or ldlt and `a` is not stored as symmetric or Hermitian, or llt
/// and `a` is complex symmetric
std::vector<Row> compare(const SystemView& a, const Plan& plan, const Progress& progress);

}  // namespace espalier::bench
