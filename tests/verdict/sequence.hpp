/// \file
/// One random sequence of calls: what it knows of its solvers, and the calls that it makes.
#pragma once

#include <algorithm>
#include <complex>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "espalier/complex_solver.hpp"
#include "reference/reference.hpp"
#include "verdict/call_sequences.hpp"
#include "verdict/sequence_truth.hpp"

namespace espalier::verdict {

/// A solver with what is known of it.
template <class T>
struct Actor {
  SolverOf<T> solver;
  MatrixOf<T> matrix;                ///< analyzed pattern, values as they were given last
  std::optional<SolverOf<T>> fresh;  ///< a clone of the analysis that was never factorized
  std::vector<T> factored;           ///< values that a solution belongs to; empty: no solution may come
  bool regular = true;               ///< else the factor is that of a singular matrix
  bool moved_pivots = false;         ///< since the analysis: the bits have a history
};

template <class T>
class Sequence {
 public:
  Sequence(std::uint64_t seed, const std::string& device);

  SequenceVerdict run(int calls);

 private:
  static constexpr int kSteps = 29;

  std::size_t below(std::size_t n) { return static_cast<std::size_t>(random_() % std::max<std::uint64_t>(1, n)); }
  double number(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  T value(double low, double high);
  void wrong(const std::string& what);

  Options random_options();

  /// A matrix of the sort of this sequence: definite, indefinite, a saddle point, general; in any storage that holds
  /// it.
  MatrixOf<T> random_matrix();

  /// Others of the same sort on the same pattern: D A D, in one case with a phase where A is general.
  std::vector<T> other_values(const MatrixOf<T>& a, const std::vector<T>& from);

  static void scribble(std::vector<T>& values);

  /// With arrays that are gone and overwritten afterwards: what the solver needs of them it has copied.
  template <class Call>
  auto with_copy(const MatrixOf<T>& a, const Call& call) {
    MatrixOf<T> copy = a;
    auto result = call(copy);
    scribble(copy.values);
    for (Index& i : copy.row_ind) i = -7;
    for (Offset& p : copy.col_ptr) p = -7;
    return result;
  }

  void analyzed(Actor<T>& a, const Status& status, const char* what);
  void analyze(Actor<T>& a);

  void must_refuse_to_solve(Actor<T>& a);

  /// @param values  those that the factor should have now
  template <class Result>
  void factored(Actor<T>& a, const Result& result, std::vector<T> values, const char* what) {
    last_ = std::string(what) + (result.delayed > 0 ? " with pivots that moved" : "");
    if (result.status.ok()) {
      a.factored = std::move(values);
      a.regular = result.rank < 0 || result.rank == a.matrix.rows;
      note_plan(a);
      a.moved_pivots = a.moved_pivots || result.delayed > 0 || result.perturbed > 0;
      if (a.solver.state() != SolverOf<T>::State::factorized) wrong("factorized, but the state does not say so");
      return check(a);
    }
    // FP32 may not do for a matrix; a definite one stays definite, and only some sums of duplicates have no say there.
    if (result.status.code != StatusCode::singular || a.solver.options().precision == Precision::fp64)
      wrong(std::string(what) + ": " + result.status.message);
    lost(a);
  }

  void note_plan(Actor<T>& a);

  /// After a factorization that failed: no factor, or the last one.
  void lost(Actor<T>& a);

  /// Solutions against the values that the factor should have, without refinement, which would hide a wrong factor.
  void check(Actor<T>& a);

  void check_values(Actor<T>& a);

  void check_inverse(Actor<T>& a);

  // Some unknowns for few loads: those of a whole solution, which is judged by its residual. Bad ones are refused.
  void check_rows(Actor<T>& a);

  /// |M x - b| / (|M| |x| + |b|) in the largest norm, M dense by columns.
  static double dense_error(const std::vector<T>& m, const std::vector<T>& b, const std::vector<T>& x);
  [[nodiscard]] std::vector<T> dense(const Actor<T>& a) const;

  // Rows and columns around the factor; once there is another factor, they are refused until they know it.
  void change_around(Actor<T>& a);

  // On file and back, with other threads and devices; sometimes the sequence goes on with what was loaded.
  void saved(Actor<T>& a);
  // Arrays of the host are refused, and nothing has changed.
  void device_arrays(Actor<T>& a);

  // A few entries of the last factorization replaced.
  void some_entries(Actor<T>& a, bool good);
  static T conjugate(const T& v);
  static std::size_t column_of(const MatrixOf<T>& a, std::size_t q);

  void not_finite(Actor<T>& a);

  void other_pattern(Actor<T>& a);
  // Whether the matrix has entries twice.
  static bool split_of(const Actor<T>& a);

  void wrong_sizes(Actor<T>& a);

  // A row and a column of zeros.
  void singular(Actor<T>& a);

  void interrupted(Actor<T>& a);

  void change_pattern(Actor<T>& a);

  void by_file(Actor<T>& a);

  void step(Actor<T>& a, int which);

  std::mt19937_64 random_;
  Options options_;
  int sort_ = 0;
  bool definite_ = false, split_ = false, interrupt_ = false, plan_changed_ = false;
  std::vector<Actor<T>> actors_;
  std::string about_, last_;
  SequenceVerdict out_;
};

}  // namespace espalier::verdict
