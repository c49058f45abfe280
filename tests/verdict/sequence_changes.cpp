// New values and patterns of a sequence, good ones and bad ones.
#include <unistd.h>

#include <filesystem>
#include <stdexcept>

#include "verdict/sequence.hpp"

namespace espalier::verdict {

template <class T>
void Sequence<T>::some_entries(Actor<T>& a, bool good) {
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
    for (auto p = static_cast<std::size_t>(a.matrix.col_ptr[i]); p < static_cast<std::size_t>(a.matrix.col_ptr[i + 1]);
         ++p)
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

template <class T>
T Sequence<T>::conjugate(const T& v) {
  if constexpr (std::is_same_v<T, double>)
    return v;
  else
    return std::conj(v);
}

template <class T>
std::size_t Sequence<T>::column_of(const MatrixOf<T>& a, std::size_t q) {
  std::size_t j = 0;
  while (static_cast<std::size_t>(a.col_ptr[j + 1]) <= q) ++j;
  return j;
}

template <class T>
void Sequence<T>::not_finite(Actor<T>& a) {
  MatrixOf<T> bad = a.matrix;
  bad.values[below(bad.values.size())] = below(2) == 0 ? kNaN : std::numeric_limits<double>::infinity();
  const auto result = below(2) == 0 ? a.solver.refactorize(bad.values) : a.solver.factorize(bad);
  last_ = "values that are not finite";
  if (result.status.code != StatusCode::invalid_input) return wrong("were taken");
  lost(a);
}

template <class T>
void Sequence<T>::other_pattern(Actor<T>& a) {
  MatrixOf<T> bad = random_matrix();
  split_ = split_of(a);
  if (a.solver.has_pattern(bad)) return;
  const auto result = a.solver.factorize(bad);
  last_ = "another pattern";
  if (result.status.code != StatusCode::invalid_input) return wrong("was taken");
  lost(a);
}

template <class T>
bool Sequence<T>::split_of(const Actor<T>& a) {
  for (std::size_t j = 0; j < static_cast<std::size_t>(a.matrix.cols); ++j) {
    std::vector<Index> rows(a.matrix.row_ind.begin() + a.matrix.col_ptr[j],
                            a.matrix.row_ind.begin() + a.matrix.col_ptr[j + 1]);
    std::sort(rows.begin(), rows.end());
    if (std::adjacent_find(rows.begin(), rows.end()) != rows.end()) return true;
  }
  return false;
}

template <class T>
void Sequence<T>::wrong_sizes(Actor<T>& a) {
  last_ = "wrong sizes";
  std::vector<T> values(a.matrix.values.size() + 1, T(1));
  try {
    const auto result = a.solver.refactorize(values);
    if (result.status.ok()) return wrong("were taken");
  } catch (const std::invalid_argument&) {
  }
  lost(a);
}

template <class T>
void Sequence<T>::singular(Actor<T>& a) {
  std::vector<T> values = other_values(a.matrix, a.matrix.values);
  const auto row = static_cast<Index>(below(static_cast<std::size_t>(a.matrix.rows)));
  for (std::size_t j = 0; j < static_cast<std::size_t>(a.matrix.cols); ++j)
    for (auto q = static_cast<std::size_t>(a.matrix.col_ptr[j]); q < static_cast<std::size_t>(a.matrix.col_ptr[j + 1]);
         ++q)
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

template <class T>
void Sequence<T>::interrupted(Actor<T>& a) {
  const std::vector<T> values = other_values(a.matrix, a.matrix.values);
  interrupt_ = true;
  const auto result = a.solver.refactorize(values);
  interrupt_ = false;
  last_ = "an interrupted factorization";
  if (result.status.ok()) return factored(a, result, values, "an interruption that came too late");
  if (result.status.code != StatusCode::cancelled) return wrong(result.status.message);
  lost(a);
}

template <class T>
void Sequence<T>::change_pattern(Actor<T>& a) {
  // One more entry on the diagonal's side, or the same once more.
  const MatrixOf<T> before = a.matrix;
  const auto n = static_cast<std::size_t>(before.rows);
  const auto i = static_cast<Index>(below(n)), j = static_cast<Index>(below(n));
  const bool lower = before.storage == Storage::symmetric_lower || before.storage == Storage::hermitian_lower;
  const bool in = !one_triangle(before.storage) || (lower ? i >= j : i <= j);
  const bool both = !one_triangle(before.storage) && before.storage != Storage::general;
  if (!in || split_ || (both && i != j)) return;
  MatrixOf<T> next = before;
  const auto begin = next.row_ind.begin() + static_cast<std::ptrdiff_t>(before.col_ptr[static_cast<std::size_t>(j)]);
  const auto end = next.row_ind.begin() + static_cast<std::ptrdiff_t>(before.col_ptr[static_cast<std::size_t>(j) + 1]);
  const auto there = std::find(begin, end, i);
  const std::ptrdiff_t place = there - next.row_ind.begin();
  const T more = i == j ? 0.5 : 1e-3;
  if (there != end) {
    next.values[static_cast<std::size_t>(place)] += more;
  } else {
    next.row_ind.insert(next.row_ind.begin() + place, i);
    next.values.insert(next.values.begin() + place, more);
    for (auto c = static_cast<std::size_t>(j) + 1; c <= n; ++c) ++next.col_ptr[c];
  }
  a.matrix = next;
  const ChangeResult result = with_copy(a.matrix, [&](const MatrixOf<T>& m) { return a.solver.analyze_change(m); });
  analyzed(a, result.analysis.status, "analyze_change");
}

template <class T>
void Sequence<T>::by_file(Actor<T>& a) {
  const std::string path =
      (std::filesystem::temp_directory_path() / ("espalier-sequence-" + std::to_string(::getpid()))).string();
  if (!a.solver.save_analysis(path).ok()) return wrong("save_analysis");
  const auto result = with_copy(a.matrix, [&](const MatrixOf<T>& m) { return a.solver.load_analysis(path, m); });
  std::filesystem::remove(path);
  analyzed(a, result.status, "load_analysis");
}

template class Sequence<double>;
template class Sequence<std::complex<double>>;

}  // namespace espalier::verdict
