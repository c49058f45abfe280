#include "verdict/call_sequences.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <limits>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "espalier/changed_system.hpp"
#include "espalier/complex_solver.hpp"
#include "espalier/inverse.hpp"
#include "espalier/solve_rows.hpp"
#include "espalier/solver.hpp"
#include "reference/reference.hpp"

namespace espalier::verdict {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

template <class T>
using MatrixOf = std::conditional_t<std::is_same_v<T, double>, SparseMatrix, ComplexSparseMatrix>;
template <class T>
using ViewOf = std::conditional_t<std::is_same_v<T, double>, MatrixView, ComplexMatrixView>;

bool is_hermitian(Storage s) { return s >= Storage::hermitian_lower; }
bool one_triangle(Storage s) {
  return s != Storage::general && s != Storage::symmetric_both && s != Storage::hermitian_both;
}

/// |b - op(A) x|_inf / (|op(A)|_inf |x|_inf + |b|_inf), the largest of the columns.
template <class T>
double backward_error(const MatrixOf<T>& a, const std::vector<T>& b, const std::vector<T>& x, Index columns,
                      Transpose how) {
  using Long = std::complex<long double>;
  const auto n = static_cast<std::size_t>(a.rows);
  double worst = 0;
  for (std::size_t c = 0; c < static_cast<std::size_t>(columns); ++c) {
    std::vector<Long> r(n);
    std::vector<double> row(n, 0);
    double largest_x = 0, largest_b = 0;
    for (std::size_t i = 0; i < n; ++i) {
      r[i] = Long(b[c * n + i]);
      largest_b = std::max(largest_b, std::abs(b[c * n + i]));
      if (!std::isfinite(std::abs(x[c * n + i]))) return std::numeric_limits<double>::infinity();
      largest_x = std::max(largest_x, std::abs(x[c * n + i]));
    }
    const auto add = [&](std::size_t i, std::size_t j, std::complex<double> v) {
      if (how != Transpose::no) std::swap(i, j);
      if (how == Transpose::conjugate) v = std::conj(v);
      r[i] -= Long(v) * Long(x[c * n + j]);
      row[i] += std::abs(v);
    };
    for (std::size_t j = 0; j < n; ++j)
      for (auto q = static_cast<std::size_t>(a.col_ptr[j]); q < static_cast<std::size_t>(a.col_ptr[j + 1]); ++q) {
        const auto i = static_cast<std::size_t>(a.row_ind[q]);
        const std::complex<double> v = a.values[q];
        add(i, j, v);
        if (one_triangle(a.storage) && i != j) add(j, i, is_hermitian(a.storage) ? std::conj(v) : v);
      }
    double largest_r = 0, norm = 0;
    for (std::size_t i = 0; i < n; ++i) {
      largest_r = std::max(largest_r, static_cast<double>(std::abs(r[i])));
      norm = std::max(norm, row[i]);
    }
    const double scale = norm * largest_x + largest_b;
    worst = std::max(worst, scale > 0 ? largest_r / scale : 0);
  }
  return worst;
}

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
  Sequence(std::uint64_t seed, const std::string& device) : random_(seed) {
    options_ = random_options();
    if (!device.empty()) {
      options_.device = device;
      options_.device_memory_bytes = 0;
      about_ += ", on " + device;
    }
    actors_.push_back(Actor<T>{SolverOf<T>(options_), random_matrix(), {}, {}, true, false});
    analyze(actors_[0]);
  }

  SequenceVerdict run(int calls) {
    for (; out_.calls < calls && out_.wrong.empty(); ++out_.calls) {
      Actor<T>& actor = actors_[below(actors_.size())];
      step(actor, static_cast<int>(below(kSteps)));
      if (std::getenv("VERDICT_LOG") != nullptr)
        std::printf("%d solver %d: %s\n", out_.calls, static_cast<int>(&actor - actors_.data()), last_.c_str());
    }
    return out_;
  }

 private:
  static constexpr int kSteps = 27;

  std::size_t below(std::size_t n) { return static_cast<std::size_t>(random_() % std::max<std::uint64_t>(1, n)); }
  double number(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  T value(double low, double high) {
    if constexpr (std::is_same_v<T, double>)
      return number(low, high);
    else
      return {number(low, high), number(-0.3, 0.3)};
  }
  void wrong(const std::string& what) {
    if (out_.wrong.empty())
      out_.wrong = what + " (" + about_ + "; call " + std::to_string(out_.calls) + ", " + last_ + ")";
  }

  Options random_options() {
    Options o;
    sort_ = static_cast<int>(below(4));
    definite_ = sort_ == 0;
    static const Precision precisions[] = {Precision::fp64, Precision::fp64, Precision::fp64, Precision::fp32,
                                           Precision::mixed};
    o.precision = precisions[below(std::size(precisions))];
    static const char* const devices[] = {"cpu", "cpu", "cpu", "host:1,1", "host:2", "cpu"};
    o.device = devices[below(std::size(devices))];
    if (std::string(o.device).starts_with("host") && below(2) == 0) o.device_memory_bytes = 4'000'000;
    o.threads = 1 + static_cast<int>(below(3));
    o.partial_refactorization = below(2) == 0;
    o.rescale = static_cast<Rescale>(below(3));
    if (below(3) == 0) o.singular = SingularMatrix::report;
    if (below(3) == 0) o.max_block_size = 16;
    if (below(4) == 0) o.matching = false;
    o.refinement_steps = 0;
    o.required_backward_error = std::numeric_limits<double>::infinity();
    o.interrupted = [this] { return interrupt_; };
    o.interrupted_every = 0;
    // What pivots that fail change in the plan stays until the next analysis.
    o.log = [this](const std::string& line) {
      for (const char* word : {"later front", "going on", "given up", "wider"})
        plan_changed_ = plan_changed_ || line.find(word) != std::string::npos;
    };
    about_ = "sort " + std::to_string(sort_) + ", " + o.device + ", budget " + std::to_string(o.device_memory_bytes) +
             ", precision " + std::to_string(static_cast<int>(o.precision)) + ", partial " +
             std::to_string(static_cast<int>(o.partial_refactorization)) + ", rescale " +
             std::to_string(static_cast<int>(o.rescale)) + ", singular " +
             std::to_string(static_cast<int>(o.singular)) + ", matching " +
             std::to_string(static_cast<int>(o.matching)) + (std::is_same_v<T, double> ? "" : ", complex");
    return o;
  }

  /// Of the sort of this sequence: definite, indefinite, a saddle point, general; in any storage that holds it.
  MatrixOf<T> random_matrix() {
    // Where pivots move far, which L U without matching leaves to them, 300 unknowns take a quarter of a second.
    const bool small = (sort_ == 3 && !options_.matching) || below(4) != 0;
    const auto n = static_cast<Index>(1 + below(small ? 40 : 300));
    const std::uint64_t seed = random_();
    SparseMatrix real;
    if (sort_ == 0) real = reference::random_system(n, 4, reference::Values::positive, seed);
    if (sort_ == 1) real = reference::random_system(n, 4, reference::Values::indefinite, seed);
    if (sort_ == 2) real = reference::saddle_point(n + 4, 1 + n / 5, seed);
    if (sort_ == 3) real = reference::random_system(n, 4, reference::Values::general, seed);
    split_ = below(4) == 0;
    if (sort_ < 3) {
      static const Storage storages[] = {Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both};
      real = reference::stored_as(real, storages[below(3)], split_);
    } else {
      split_ = false;
    }
    if constexpr (std::is_same_v<T, double>) {
      return real;
    } else {
      MatrixOf<T> a{real.rows, real.cols, real.col_ptr, real.row_ind, {}, real.storage};
      // Hermitian where it is definite; the imaginary parts leave it so. Else symmetric, or general.
      if (definite_) a.storage = static_cast<Storage>(static_cast<int>(real.storage) + 3);
      a.values.assign(real.values.begin(), real.values.end());
      return a;
    }
  }

  /// Others of the same sort on the same pattern: D A D, in one case with a phase where A is general.
  std::vector<T> other_values(const MatrixOf<T>& a, const std::vector<T>& from) {
    std::vector<double> d(static_cast<std::size_t>(a.rows));
    for (double& v : d) v = number(0.4, 2.5);
    std::vector<T> out = from;
    for (std::size_t j = 0; j < d.size(); ++j)
      for (auto q = static_cast<std::size_t>(a.col_ptr[j]); q < static_cast<std::size_t>(a.col_ptr[j + 1]); ++q)
        out[q] *= d[static_cast<std::size_t>(a.row_ind[q])] * d[j];
    return out;
  }

  static void scribble(std::vector<T>& values) {
    for (T& v : values) v = kNaN;
  }

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

  void analyzed(Actor<T>& a, const Status& status, const char* what) {
    last_ = what;
    a.factored.clear();
    a.fresh.reset();
    a.moved_pivots = plan_changed_ = false;
    if (!status.ok()) return wrong(std::string(what) + ": " + status.message);
    if (a.solver.state() != SolverOf<T>::State::analyzed)
      wrong(std::string(what) + " left another state than analyzed");
    a.fresh = a.solver.clone();
    must_refuse_to_solve(a);
  }
  void analyze(Actor<T>& a) {
    analyzed(a, with_copy(a.matrix, [&](const MatrixOf<T>& m) { return a.solver.analyze(m); }).status, "analyze");
  }

  void must_refuse_to_solve(Actor<T>& a) {
    std::vector<T> b(static_cast<std::size_t>(a.matrix.rows), T(1)), x = b;
    try {
      const SolveResult r = a.solver.solve(b, x);
      if (r.status.ok()) wrong("a solution without a factor");
    } catch (const std::logic_error&) {
      ++out_.errors;
    }
  }

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

  void note_plan(Actor<T>& a) { a.moved_pivots = std::exchange(plan_changed_, false) || a.moved_pivots; }

  /// After a factorization that failed: no factor, or the last one.
  void lost(Actor<T>& a) {
    ++out_.errors;
    note_plan(a);
    a.moved_pivots = a.moved_pivots || last_ == "a singular matrix";
    if (a.solver.state() == SolverOf<T>::State::factorized && !a.factored.empty()) return check(a);
    if (a.solver.state() == SolverOf<T>::State::factorized)
      return wrong("a failed factorization left a factor of nothing");
    a.factored.clear();
    must_refuse_to_solve(a);
  }

  /// Solutions against the values that the factor should have, without refinement, which would hide a wrong factor.
  void check(Actor<T>& a) {
    if (a.factored.empty() || !a.regular) return;
    const auto columns = static_cast<Index>(1 + below(3));
    static const Transpose hows[] = {Transpose::no, Transpose::yes, Transpose::conjugate};
    const Transpose how = hows[below(3)];
    std::vector<T> b(static_cast<std::size_t>(a.matrix.rows) * static_cast<std::size_t>(columns));
    for (T& v : b) v = value(-1, 1);
    std::vector<T> x(b.size()), own = b;
    const bool in_place = below(2) == 0;
    const SolveResult r = in_place ? a.solver.solve(own, own, columns, how) : a.solver.solve(own, x, columns, how);
    if (in_place) x = own;
    if (!r.status.ok()) return wrong("solve: " + r.status.message);
    MatrixOf<T> truth = a.matrix;
    truth.values = a.factored;
    const bool single = a.solver.options().precision != Precision::fp64;
    const double error = backward_error<T>(truth, b, x, columns, how), bound = single ? 2e-3 : 1e-8;
    ++out_.solutions;
    std::vector<T> y(x.size());
    bool same_way = false;  // the fresh factor has the history of this one
    if (a.fresh && (!(error <= bound) || !(a.moved_pivots || single))) {
      SolverOf<T> fresh = a.fresh->clone();
      const auto f = fresh.refactorize(a.factored);
      if (f.status.ok()) (void)fresh.solve(b, y, columns, how);
      same_way = f.status.ok() && !a.moved_pivots && !single && f.delayed == 0 && f.perturbed == 0 && !plan_changed_;
      plan_changed_ = false;
    }
    // Without matching and refinement a factor may be a poor one, a fresh one as well.
    const bool poor = sort_ == 3 && !a.solver.options().matching;
    if (!(error <= bound) && !poor && !(error <= 10 * backward_error<T>(truth, b, y, columns, how)))
      return wrong("the solution is not that of the last values: " + std::to_string(error));
    if (!same_way) return;
    ++out_.bits;
    if (std::memcmp(x.data(), y.data(), x.size() * sizeof(T)) != 0) wrong("other bits than those of a fresh factor");
  }

  void check_values(Actor<T>& a) {
    if (a.solver.state() != SolverOf<T>::State::factorized || a.factored.empty() || split_) return;
    if (a.solver.values() != a.factored) wrong("values() are not those of the last factorization");
  }

  void check_inverse(Actor<T>& a) {
    if (a.factored.empty() || !a.regular || a.solver.options().precision != Precision::fp64) return;
    std::vector<T> diagonal(static_cast<std::size_t>(a.matrix.rows));
    const InverseResult r = inverse_diagonal(a.solver, diagonal);
    if (r.status.code == StatusCode::device_error || r.status.code == StatusCode::accuracy_not_reached) return;
    if (!r.status.ok()) return wrong("inverse_diagonal: " + r.status.message);
    const std::size_t i = below(diagonal.size());
    std::vector<T> e(diagonal.size()), x(diagonal.size());
    e[i] = 1;
    (void)a.solver.solve(e, x);
    double largest = 0;
    for (const T& v : x) largest = std::max(largest, std::abs(v));
    if (!(std::abs(x[i] - diagonal[i]) <= 1e-6 * largest)) wrong("inverse_diagonal belongs to other values");
  }

  // Some unknowns for few loads: those of a whole solution, which is judged by its residual. Bad ones are refused.
  void check_rows(Actor<T>& a) {
    last_ = "solve_rows";
    if (a.factored.empty() || !a.regular) return;
    const auto n = static_cast<std::size_t>(a.matrix.rows);
    const std::size_t columns = 1 + below(3), unknowns = 1 + below(4);
    static const Transpose hows[] = {Transpose::no, Transpose::yes, Transpose::conjugate};
    const Transpose how = hows[below(3)];
    std::vector<Offset> begin{0};
    std::vector<Index> rows, wanted;
    std::vector<T> values, b(n * columns);
    for (std::size_t c = 0; c < columns; ++c) {
      for (std::size_t k = below(4); k > 0; --k) {
        rows.push_back(static_cast<Index>(below(n)));
        values.push_back(value(-1, 1));
        b[c * n + static_cast<std::size_t>(rows.back())] += values.back();
      }
      begin.push_back(static_cast<Offset>(rows.size()));
    }
    for (std::size_t k = 0; k < unknowns; ++k) wanted.push_back(static_cast<Index>(below(n)));
    std::vector<T> whole(b.size()), x(unknowns * columns);
    if (below(4) == 0) {
      std::vector<Index> bad = wanted;
      bad[below(unknowns)] = below(2) == 0 ? a.matrix.rows : Index{-1};
      const SolveRowsResult r = solve_rows(a.solver, {begin, rows, values}, bad, x, how);
      if (r.status.code != StatusCode::invalid_input) return wrong("an unknown out of range was taken");
      ++out_.errors;
    }
    const SolveRowsResult r = solve_rows(a.solver, {begin, rows, values}, wanted, x, how);
    const SolveResult all = a.solver.solve(b, whole, static_cast<Index>(columns), how);
    if (!r.status.ok() || !all.status.ok()) return wrong(r.status.message + all.status.message);
    MatrixOf<T> truth = a.matrix;
    truth.values = a.factored;
    ++out_.solutions;
    const bool poor = sort_ == 3 && !a.solver.options().matching;
    const double bound = a.solver.options().precision != Precision::fp64 ? 2e-3 : 1e-8;
    if (!poor && !(backward_error<T>(truth, b, whole, static_cast<Index>(columns), how) <= bound))
      return wrong("whole solutions beside rows are not those of the last values");
    for (std::size_t c = 0; c < columns; ++c)
      for (std::size_t k = 0; k < unknowns; ++k)
        if (x[c * unknowns + k] != whole[c * n + static_cast<std::size_t>(wanted[k])])
          return wrong("solve_rows gives other numbers than whole solutions");
  }

  /// |M x - b| / (|M| |x| + |b|) in the largest norm, M dense by columns.
  static double dense_error(const std::vector<double>& m, const std::vector<double>& b, const std::vector<double>& x) {
    const std::size_t n = b.size();
    double worst = 0, norm = 0, of_x = 0, of_b = 0;
    for (std::size_t i = 0; i < n; ++i) {
      long double rest = b[i];
      double row = 0;
      for (std::size_t j = 0; j < n; ++j) {
        rest -= static_cast<long double>(m[j * n + i]) * x[j];
        row += std::abs(m[j * n + i]);
      }
      if (!std::isfinite(x[i])) return std::numeric_limits<double>::infinity();
      worst = std::max(worst, static_cast<double>(std::abs(rest)));
      norm = std::max(norm, row);
      of_x = std::max(of_x, std::abs(x[i]));
      of_b = std::max(of_b, std::abs(b[i]));
    }
    const double scale = norm * of_x + of_b;
    return scale > 0 ? worst / scale : 0;
  }
  [[nodiscard]] std::vector<double> dense(const Actor<T>& a) const {
    const auto n = static_cast<std::size_t>(a.matrix.rows);
    std::vector<double> m(n * n, 0);
    if constexpr (std::is_same_v<T, double>)
      for (std::size_t j = 0; j < n; ++j)
        for (auto q = static_cast<std::size_t>(a.matrix.col_ptr[j]);
             q < static_cast<std::size_t>(a.matrix.col_ptr[j + 1]); ++q) {
          const auto i = static_cast<std::size_t>(a.matrix.row_ind[q]);
          m[j * n + i] += a.factored[q];
          if (one_triangle(a.matrix.storage) && i != j) m[i * n + j] += a.factored[q];
        }
    return m;
  }

  // Rows and columns around the factor; once there is another factor, they are refused until they know it.
  void change_around(Actor<T>& a) {
    if constexpr (std::is_same_v<T, double>) {
      last_ = "ChangedSystem";
      const bool poor = sort_ == 3 && !a.solver.options().matching;
      if (a.factored.empty() || !a.regular || a.solver.options().precision != Precision::fp64 || poor) return;
      const auto n = static_cast<std::size_t>(a.matrix.rows);
      ChangedSystem around(a.solver);
      std::vector<double> m = dense(a), b(n), x(n);
      for (double& v : b) v = number(-1, 1);
      if (below(2) == 0) {  // + u u^T
        std::vector<double> u(n, 0);
        for (std::size_t k = 0; k < 3; ++k) u[below(n)] = number(-1, 1);
        if (!around.add_low_rank(u, 1).ok()) return wrong("add_low_rank");
        for (std::size_t j = 0; j < n; ++j)
          for (std::size_t i = 0; i < n; ++i) m[j * n + i] += u[i] * u[j];
      }
      if (n > 1 && below(2) == 0) {
        const std::size_t p = below(n);
        const std::vector<Index> gone = {static_cast<Index>(p)};
        if (!around.remove(gone).ok()) return wrong("remove");
        if (around.remove(gone).code != StatusCode::invalid_input) return wrong("removed twice");
        for (std::size_t k = 0; k < n; ++k) m[k * n + p] = m[p * n + k] = 0;
        m[p * n + p] = 1;
      }
      const auto judge = [&](const char* what) {
        const ChangedSolveResult r = around.solve(b, x);
        for (std::size_t k = 0; k < n; ++k)
          if (m[k * n + k] == 1 && around.removed(static_cast<Index>(k))) b[k] = 0;
        // What is left may be singular where nothing says that it is definite.
        if (r.status.ok()) {
          ++out_.solutions;
          if (!(dense_error(m, b, x) <= 1e-8)) wrong(what);
        } else if (definite_) {
          wrong(std::string(what) + ": " + r.status.message);
        } else {
          ++out_.errors;
        }
      };
      judge("changes around the factor of the last values");
      if (below(2) == 0 || !out_.wrong.empty()) return;
      std::vector<T> values = other_values(a.matrix, a.matrix.values);
      const auto result = a.solver.refactorize(values);
      factored(a, result, std::move(values), "refactorize beside changes");
      if (a.factored.empty() || !a.regular || a.solver.state() != SolverOf<T>::State::factorized) return;
      try {
        (void)around.solve(b, x);
        return wrong("changes around a factor that is gone");
      } catch (const std::logic_error&) {
        ++out_.errors;
      }
      around.reset();
      m = dense(a);
      judge("no changes around the new factor");
    }
  }

  // Arrays of the host are refused, and nothing has changed.
  void device_arrays(Actor<T>& a) {
    if constexpr (std::is_same_v<T, double>) {
      last_ = "arrays of a device";
      std::vector<T> values = other_values(a.matrix, a.matrix.values), x(static_cast<std::size_t>(a.matrix.rows), 7);
      const auto refused = [&](const auto& call) {
        try {
          if (call().status.ok()) wrong("were taken");
        } catch (const std::invalid_argument&) {
        }
      };
      if (a.solver.state() == SolverOf<T>::State::factorized && !a.factored.empty())
        refused([&] { return a.solver.solve_device(values.data(), x.data()); });
      refused([&] { return a.solver.refactorize_device(values.data(), static_cast<Offset>(values.size())); });
      lost(a);
    }
  }

  // A few entries of the last factorization replaced.
  void some_entries(Actor<T>& a, bool good) {
    if (a.factored.empty() || a.solver.state() != SolverOf<T>::State::factorized) return;
    const std::size_t stored = a.factored.size();
    std::vector<Offset> places;
    std::vector<T> values, now = a.factored;
    const std::size_t many = 1 + below(4);
    for (std::size_t k = 0; k < many; ++k) {
      const std::size_t q = below(stored);
      const std::size_t j = column_of(a.matrix, q), i = static_cast<std::size_t>(a.matrix.row_ind[q]);
      if ((definite_ && i != j) || std::count(places.begin(), places.end(), static_cast<Offset>(q)) > 0) continue;
      now[q] *= number(1.2, 3);
      places.push_back(static_cast<Offset>(q));
      values.push_back(now[q]);
      if (i == j || one_triangle(a.matrix.storage) || a.matrix.storage == Storage::general) continue;
      for (auto p = static_cast<std::size_t>(a.matrix.col_ptr[i]);
           p < static_cast<std::size_t>(a.matrix.col_ptr[i + 1]); ++p)
        if (static_cast<std::size_t>(a.matrix.row_ind[p]) == j) {
          now[p] = is_hermitian(a.matrix.storage) ? conjugate(now[q]) : now[q];
          places.push_back(static_cast<Offset>(p));
          values.push_back(now[p]);
        }
    }
    if (places.empty()) return;
    if (!good) {
      if (below(2) == 0)
        places[below(places.size())] = below(2) == 0 ? static_cast<Offset>(stored) : Offset{-1};
      else
        values[below(values.size())] = kNaN;
    }
    const bool refuse = !good || split_;
    const auto result = a.solver.refactorize_entries(places, values);
    last_ = "refactorize_entries";
    if (refuse && result.status.ok() && !split_) return wrong("bad entries were taken");
    if (result.status.code == StatusCode::invalid_input && refuse) {
      ++out_.errors;
      if (a.solver.state() != SolverOf<T>::State::factorized) return wrong("refused entries took the factor away");
      return check(a);
    }
    // Entries at random may make an indefinite matrix nearly singular: then nothing is promised but a true status.
    if (!result.status.ok() && !definite_) return lost(a);
    factored(a, result, std::move(now), "refactorize_entries");
  }
  static T conjugate(const T& v) {
    if constexpr (std::is_same_v<T, double>)
      return v;
    else
      return std::conj(v);
  }
  static std::size_t column_of(const MatrixOf<T>& a, std::size_t q) {
    std::size_t j = 0;
    while (static_cast<std::size_t>(a.col_ptr[j + 1]) <= q) ++j;
    return j;
  }

  void not_finite(Actor<T>& a) {
    MatrixOf<T> bad = a.matrix;
    bad.values[below(bad.values.size())] = below(2) == 0 ? kNaN : std::numeric_limits<double>::infinity();
    const auto result = below(2) == 0 ? a.solver.refactorize(bad.values) : a.solver.factorize(bad);
    last_ = "values that are not finite";
    if (result.status.code != StatusCode::invalid_input) return wrong("were taken");
    lost(a);
  }

  void other_pattern(Actor<T>& a) {
    MatrixOf<T> bad = random_matrix();
    split_ = split_of(a);
    if (a.solver.has_pattern(bad)) return;
    const auto result = a.solver.factorize(bad);
    last_ = "another pattern";
    if (result.status.code != StatusCode::invalid_input) return wrong("was taken");
    lost(a);
  }
  // Whether the matrix has entries twice.
  static bool split_of(const Actor<T>& a) {
    for (std::size_t j = 0; j < static_cast<std::size_t>(a.matrix.cols); ++j) {
      std::vector<Index> rows(a.matrix.row_ind.begin() + a.matrix.col_ptr[j],
                              a.matrix.row_ind.begin() + a.matrix.col_ptr[j + 1]);
      std::sort(rows.begin(), rows.end());
      if (std::adjacent_find(rows.begin(), rows.end()) != rows.end()) return true;
    }
    return false;
  }

  void wrong_sizes(Actor<T>& a) {
    last_ = "wrong sizes";
    std::vector<T> values(a.matrix.values.size() + 1, T(1));
    try {
      const auto result = a.solver.refactorize(values);
      if (result.status.ok()) return wrong("were taken");
    } catch (const std::invalid_argument&) {
    }
    lost(a);
  }

  // A row and a column of zeros.
  void singular(Actor<T>& a) {
    std::vector<T> values = other_values(a.matrix, a.matrix.values);
    const auto row = static_cast<Index>(below(static_cast<std::size_t>(a.matrix.rows)));
    for (std::size_t j = 0; j < static_cast<std::size_t>(a.matrix.cols); ++j)
      for (auto q = static_cast<std::size_t>(a.matrix.col_ptr[j]);
           q < static_cast<std::size_t>(a.matrix.col_ptr[j + 1]); ++q)
        if (a.matrix.row_ind[q] == row || static_cast<Index>(j) == row) values[q] = 0;
    const auto result = a.solver.refactorize(values);
    last_ = "a singular matrix";
    if (!result.status.ok()) return lost(a);
    if (result.rank >= a.matrix.rows || result.rank < 0) return wrong("passed for a regular one");
    a.factored = std::move(values);
    a.regular = false;
    a.moved_pivots = true;
    ++out_.errors;
  }

  void interrupted(Actor<T>& a) {
    const std::vector<T> values = other_values(a.matrix, a.matrix.values);
    interrupt_ = true;
    const auto result = a.solver.refactorize(values);
    interrupt_ = false;
    last_ = "an interrupted factorization";
    if (result.status.ok()) return factored(a, result, values, "an interruption that came too late");
    if (result.status.code != StatusCode::cancelled) return wrong(result.status.message);
    lost(a);
  }

  void change_pattern(Actor<T>& a) {
    if constexpr (std::is_same_v<T, double>) {
      MatrixOf<T> next = a.matrix;
      // One more entry on the diagonal's side, or the same once more.
      std::vector<reference::Triple> triples;
      for (std::size_t j = 0; j < static_cast<std::size_t>(next.cols); ++j)
        for (auto q = static_cast<std::size_t>(next.col_ptr[j]); q < static_cast<std::size_t>(next.col_ptr[j + 1]); ++q)
          triples.push_back({next.row_ind[q], static_cast<Index>(j), next.values[q]});
      const auto n = static_cast<std::size_t>(next.rows);
      const auto i = static_cast<Index>(below(n)), j = static_cast<Index>(below(n));
      const bool in = next.storage == Storage::general || next.storage == Storage::symmetric_both ||
                      (next.storage == Storage::symmetric_lower ? i >= j : i <= j);
      if (!in || split_ || (next.storage == Storage::symmetric_both && i != j)) return;
      triples.push_back({i, j, i == j ? 0.5 : 1e-3});
      a.matrix = reference::from_triples(next.rows, triples, next.storage);
      const ChangeResult result = with_copy(a.matrix, [&](const MatrixOf<T>& m) { return a.solver.analyze_change(m); });
      analyzed(a, result.analysis.status, "analyze_change");
    }
  }

  void by_file(Actor<T>& a) {
    const std::string path =
        (std::filesystem::temp_directory_path() / ("espalier-sequence-" + std::to_string(::getpid()))).string();
    if (!a.solver.save_analysis(path).ok()) return wrong("save_analysis");
    const auto result = with_copy(a.matrix, [&](const MatrixOf<T>& m) { return a.solver.load_analysis(path, m); });
    std::filesystem::remove(path);
    analyzed(a, result.status, "load_analysis");
  }

  void step(Actor<T>& a, int which) {
    split_ = split_of(a);
    if (a.solver.state() == SolverOf<T>::State::empty) which = 0;
    switch (which) {
      case 0:
        if (below(2) == 0) {
          a.matrix = random_matrix();
        } else {
          a.matrix.values = other_values(a.matrix, a.matrix.values);
        }
        return analyze(a);
      case 1:
      case 2:
      case 3: {
        a.matrix.values = other_values(a.matrix, a.matrix.values);
        const auto result = with_copy(a.matrix, [&](const MatrixOf<T>& m) { return a.solver.factorize(m); });
        return factored(a, result, a.matrix.values, "factorize");
      }
      case 4:
      case 5: {
        std::vector<T> values = other_values(a.matrix, a.matrix.values), given = values;
        const auto result = a.solver.refactorize(given);
        scribble(given);
        return factored(a, result, std::move(values), "refactorize");
      }
      case 6:
      case 7:
      case 8:
        return some_entries(a, true);
      case 9:
        return some_entries(a, false);
      case 10:
        return not_finite(a);
      case 11:
        return other_pattern(a);
      case 12:
        return wrong_sizes(a);
      case 13:
        return singular(a);
      case 14:
        return interrupted(a);
      case 15:
        return change_pattern(a);
      case 16:
        return by_file(a);
      case 17: {
        last_ = "clone";
        if (actors_.size() >= 3) {
          if (&a != &actors_.back()) actors_.pop_back();
          return;
        }
        Actor<T> twin{a.solver.clone(), a.matrix, {}, {}, true, a.moved_pivots};
        twin.fresh = a.fresh ? std::optional(a.fresh->clone()) : std::nullopt;
        must_refuse_to_solve(twin);
        actors_.push_back(std::move(twin));
        return;
      }
      case 18: {
        last_ = "move";
        SolverOf<T> other(std::move(a.solver));
        a.solver = std::move(other);
        return check(a);
      }
      case 19:
        check_values(a);
        return check(a);
      case 20:
        return check_inverse(a);
      case 21:
      case 22:
        return check_rows(a);
      case 23:
        return change_around(a);
      case 24:
        return device_arrays(a);
      default:
        return check(a);
    }
  }

  std::mt19937_64 random_;
  Options options_;
  int sort_ = 0;
  bool definite_ = false, split_ = false, interrupt_ = false, plan_changed_ = false;
  std::vector<Actor<T>> actors_;
  std::string about_, last_;
  SequenceVerdict out_;
};

}  // namespace

SequenceVerdict run_sequence(std::uint64_t seed, int calls, const std::string& device) {
  try {
    if (seed % 4 == 3) return Sequence<std::complex<double>>(seed, device).run(calls);
    return Sequence<double>(seed, device).run(calls);
  } catch (const std::exception& e) {
    SequenceVerdict out;
    out.wrong = std::string("an exception: ") + e.what();
    return out;
  }
}

}  // namespace espalier::verdict
