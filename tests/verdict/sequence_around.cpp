// What is worked out with the factor of a sequence beside whole solutions.
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <stdexcept>

#include "espalier/changed_system.hpp"
#include "espalier/factor_file.hpp"
#include "espalier/inverse.hpp"
#include "espalier/solve_rows.hpp"
#include "verdict/sequence.hpp"

namespace espalier::verdict {

template <class T>
void Sequence<T>::check_values(Actor<T>& a) {
  if (a.solver.state() != SolverOf<T>::State::factorized || a.factored.empty() || split_) return;
  if (a.solver.values() != a.factored) wrong("values() are not those of the last factorization");
}

template <class T>
void Sequence<T>::check_inverse(Actor<T>& a) {
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

template <class T>
void Sequence<T>::check_rows(Actor<T>& a) {
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

template <class T>
double Sequence<T>::dense_error(const std::vector<T>& m, const std::vector<T>& b, const std::vector<T>& x) {
  using Long = std::conditional_t<std::is_same_v<T, double>, long double, std::complex<long double>>;
  const std::size_t n = b.size();
  double worst = 0, norm = 0, of_x = 0, of_b = 0;
  for (std::size_t i = 0; i < n; ++i) {
    Long rest(b[i]);
    double row = 0;
    for (std::size_t j = 0; j < n; ++j) {
      rest -= Long(m[j * n + i]) * Long(x[j]);
      row += std::abs(m[j * n + i]);
    }
    if (!std::isfinite(std::abs(x[i]))) return std::numeric_limits<double>::infinity();
    worst = std::max(worst, static_cast<double>(std::abs(rest)));
    norm = std::max(norm, row);
    of_x = std::max(of_x, std::abs(x[i]));
    of_b = std::max(of_b, std::abs(b[i]));
  }
  const double scale = norm * of_x + of_b;
  return scale > 0 ? worst / scale : 0;
}

template <class T>
std::vector<T> Sequence<T>::dense(const Actor<T>& a) const {
  const auto n = static_cast<std::size_t>(a.matrix.rows);
  std::vector<T> m(n * n, 0);
  for (std::size_t j = 0; j < n; ++j)
    for (auto q = static_cast<std::size_t>(a.matrix.col_ptr[j]); q < static_cast<std::size_t>(a.matrix.col_ptr[j + 1]);
         ++q) {
      const auto i = static_cast<std::size_t>(a.matrix.row_ind[q]);
      m[j * n + i] += a.factored[q];
      if (one_triangle(a.matrix.storage) && i != j)
        m[i * n + j] += is_hermitian(a.matrix.storage) ? conjugate(a.factored[q]) : a.factored[q];
    }
  return m;
}

template <class T>
void Sequence<T>::change_around(Actor<T>& a) {
  last_ = "ChangedSystem";
  const bool poor = sort_ == 3 && !a.solver.options().matching;
  if (a.factored.empty() || !a.regular || a.solver.options().precision != Precision::fp64 || poor) return;
  const auto n = static_cast<std::size_t>(a.matrix.rows);
  ChangedSystemOf<T> around(a.solver);
  std::vector<T> m = dense(a), b(n), x(n);
  for (T& v : b) v = value(-1, 1);
  bool definite = definite_;
  if (below(2) == 0) {  // + u u^T, or u u^H
    std::vector<T> u(n, 0);
    for (std::size_t k = 0; k < 3; ++k) u[below(n)] = value(-1, 1);
    if (!around.add_low_rank(u, 1).ok()) return wrong("add_low_rank");
    for (std::size_t j = 0; j < n; ++j)
      for (std::size_t i = 0; i < n; ++i) m[j * n + i] += u[i] * (around.hermitian() ? conjugate(u[j]) : u[j]);
    definite = definite && (std::is_same_v<T, double> || around.hermitian());
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
    static const Transpose hows[] = {Transpose::no, Transpose::yes, Transpose::conjugate};
    const Transpose how = hows[below(3)];
    if (below(4) == 0) (void)around.fold();  // where it fails, changes stand as before
    const ChangedSolveResult r = around.solve(b, x, 1, how);
    if (how != Transpose::no)
      for (std::size_t j = 0; j < n; ++j)
        for (std::size_t i = 0; i < j; ++i) std::swap(m[j * n + i], m[i * n + j]);
    for (T& v : m) v = how == Transpose::conjugate ? conjugate(v) : v;
    for (std::size_t k = 0; k < n; ++k)
      if (around.removed(static_cast<Index>(k))) b[k] = 0;
    // What is left may be singular where nothing says that it is definite.
    if (r.status.ok()) {
      ++out_.solutions;
      if (!(dense_error(m, b, x) <= 1e-8)) wrong(what);
    } else if (definite) {
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
  definite = definite_;
  judge("no changes around the new factor");
}

// The last values and their bits, whatever becomes of the solver that was saved.
template <class T>
void Sequence<T>::saved(Actor<T>& a) {
  last_ = "save_factor";
  const std::string path =
      (std::filesystem::temp_directory_path() / ("espalier-saved-" + std::to_string(::getpid()))).string();
  if (a.factored.empty() || a.solver.state() != SolverOf<T>::State::factorized) {
    try {
      (void)save_factor(a.solver, path);
      if (a.solver.state() != SolverOf<T>::State::factorized) wrong("saved what is not there");
    } catch (const std::logic_error&) {
      ++out_.errors;
    }
    std::filesystem::remove(path);
    return;
  }
  if (!save_factor(a.solver, path).ok()) return wrong("a factor cannot be saved");
  Options o = options_;
  o.threads = 1 + static_cast<int>(below(3));
  o.rescale = static_cast<Rescale>(below(3));
  if (below(3) == 0) o.device = "cpu";
  const bool same_device = o.device == a.solver.options().device;
  LoadedFactorOf<T> loaded = [&] {
    if constexpr (std::is_same_v<T, double>)
      return load_factor(path, o);
    else
      return load_complex_factor(path, o);
  }();
  std::filesystem::remove(path);
  if (!loaded.result.status.ok()) {
    // Fronts of another layout are factorized again, and FP32 may not do for the matrix then.
    if (a.solver.options().precision == Precision::fp64) wrong("load_factor: " + loaded.result.status.message);
    return;
  }
  const std::vector<T> of_saved = a.factored;
  const MatrixOf<T> matrix = a.matrix;
  std::vector<T> b(static_cast<std::size_t>(matrix.rows)), x(b.size()), y(b.size());
  for (T& v : b) v = value(-1, 1);
  const Transpose how = below(2) == 0 ? Transpose::no : Transpose::yes;
  if (a.regular) {
    if (!a.solver.solve(b, x, 1, how).status.ok()) return wrong("solve beside a saved factor");
    if (below(2) == 0) {  // it has nothing to do with the solver any more
      std::vector<T> values = other_values(matrix, a.factored);
      const auto result = a.solver.refactorize(values);
      factored(a, result, std::move(values), "refactorize beside a saved factor");
      last_ = "load_factor";
    }
    if (!loaded.solver.solve(b, y, 1, how).status.ok()) return wrong("a loaded factor does not solve");
    ++out_.solutions;
    MatrixOf<T> truth = matrix;
    truth.values = of_saved;
    const bool poor = sort_ == 3 && !a.solver.options().matching;
    const double bound = a.solver.options().precision != Precision::fp64 ? 2e-3 : 1e-8;
    const double error = backward_error<T>(truth, b, y, 1, how);
    if (!poor && !(error <= bound) && !(error <= 10 * backward_error<T>(truth, b, x, 1, how)))
      return wrong("a loaded factor is of other values: " + std::to_string(error));
    if (loaded.restored && same_device) {
      ++out_.bits;
      if (std::memcmp(x.data(), y.data(), x.size() * sizeof(T)) != 0) return wrong("other bits from a loaded factor");
    }
  }
  if (below(2) == 0 || !a.regular) return;
  a.solver = std::move(loaded.solver);
  a.matrix = factorized_matrix(a.solver);
  a.factored = a.matrix.values;
  a.fresh.reset();  // factors of the same order, not of the same history
  a.moved_pivots = true;
  plan_changed_ = false;
  check(a);
}

template <class T>
void Sequence<T>::device_arrays(Actor<T>& a) {
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

template class Sequence<double>;
template class Sequence<std::complex<double>>;

}  // namespace espalier::verdict
