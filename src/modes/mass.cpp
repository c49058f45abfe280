#include "modes/mass.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "modes/components.hpp"
#include "modes/pencil.hpp"

namespace espalier::modes {

namespace {

// Rows and columns of a lower triangle that are listed in `place` (>= 0), renumbered; zeros are left out.
SparseMatrix part(const SparseMatrix& a, const std::vector<Index>& place, Index size) {
  SparseMatrix out;
  out.rows = out.cols = size;
  out.storage = Storage::symmetric_lower;
  out.col_ptr.assign(1, 0);
  for (Index j = 0; j < a.cols; ++j) {
    if (place[static_cast<std::size_t>(j)] < 0) continue;
    for (auto p = static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(j)]);
         p < static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(j) + 1]); ++p) {
      const Index i = place[static_cast<std::size_t>(a.row_ind[p])];
      if (i < 0 || a.values[p] == 0) continue;
      out.row_ind.push_back(i);
      out.values.push_back(a.values[p]);
    }
    out.col_ptr.push_back(static_cast<Offset>(out.row_ind.size()));
  }
  return out;
}

struct Places {
  std::vector<Index> with, without;  // mass: number of the row among its like, or -1
  Index massive = 0, massless = 0;
  bool diagonal = true;
};

Places places_of(const SparseMatrix& m) {
  Places out;
  std::vector<char> used(static_cast<std::size_t>(m.rows), 0);
  const std::vector<double> d = diagonal_of(m);
  for (Index j = 0; j < m.cols; ++j)
    for (auto p = static_cast<std::size_t>(m.col_ptr[static_cast<std::size_t>(j)]);
         p < static_cast<std::size_t>(m.col_ptr[static_cast<std::size_t>(j) + 1]); ++p) {
      if (m.values[p] == 0) continue;
      const Index i = m.row_ind[p];
      used[static_cast<std::size_t>(i)] = used[static_cast<std::size_t>(j)] = 1;
      out.diagonal = out.diagonal && i == j;
    }
  out.with.assign(used.size(), -1);
  out.without.assign(used.size(), -1);
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (used[i] != 0 && !(d[i] > 0))
      throw Error(StatusCode::invalid_input,
                  fmt::format("M is not positive semi-definite: row {} has entries, and {:g} on the diagonal", i, d[i]),
                  static_cast<Index>(i));
    (used[i] != 0 ? out.with[i] : out.without[i]) = used[i] != 0 ? out.massive++ : out.massless++;
  }
  return out;
}

// Null vectors of M11 in the numbering of M.
using Columns = std::vector<std::vector<double>>;

// One of each kind of component tells of all: a third of the matrix where directions do not know of each other.
bool is_definite(const SparseMatrix& m11, const Options& options) {
  const std::vector<char> kept = in_first_of_equal_components(m11);
  std::vector<Index> place(kept.size(), -1);
  Index size = 0;
  for (std::size_t i = 0; i < kept.size(); ++i)
    if (kept[i] != 0) place[i] = size++;
  const SparseMatrix fewer = size < m11.rows ? part(m11, place, size) : SparseMatrix{};
  const SparseMatrix& a = size < m11.rows ? fewer : m11;
  Solver solver(factor_options(options, Kind::llt));
  const AnalysisResult analysis = solver.analyze(a);
  if (!analysis.status.ok()) throw Error(analysis.status);
  const FactorResult factor = solver.refactorize(a.values);
  if (factor.status.code != StatusCode::not_positive_definite && factor.status.code != StatusCode::singular &&
      !factor.status.ok())
    throw Error(factor.status);
  // In a singular one rounding may leave pivots above zero: then its rank is looked at.
  constexpr double kNearlySingular = 1e12;
  return factor.status.ok() && solver.condition_estimate().estimate < kNearlySingular;
}

// A check of M11, by a factorization.
void check_definite(const SparseMatrix& m, const Places& places, const Options& options, MassReport& report,
                    Columns& null) {
  const SparseMatrix m11 = part(m, places.with, places.massive);
  if (is_definite(m11, options)) return;
  Options o = factor_options(options, Kind::ldlt);
  o.singular = SingularMatrix::null_vectors;
  Solver solver(o);
  const AnalysisResult analysis = solver.analyze(m11);
  if (!analysis.status.ok()) throw Error(analysis.status);
  const FactorResult factor = solver.refactorize(m11.values);
  if (!factor.status.ok()) throw Error(factor.status);
  if (factor.inertia.negative > 0)
    throw Error(
        StatusCode::invalid_input,
        fmt::format("M is not positive semi-definite: it has {} negative eigenvalues", factor.inertia.negative));
  report.rank = places.massive - factor.inertia.zero;
  const std::size_t vectors = factor.null_vectors.size() / static_cast<std::size_t>(places.massive);
  if (vectors != static_cast<std::size_t>(factor.inertia.zero)) {
    report.proven = false;
    report.why = fmt::format("M has {} zero eigenvalues besides its rows without entries", factor.inertia.zero);
    return;
  }
  for (std::size_t v = 0; v < vectors; ++v) {
    null.emplace_back(static_cast<std::size_t>(m.rows), 0.0);
    for (std::size_t i = 0; i < places.with.size(); ++i)
      if (places.with[i] >= 0)
        null.back()[i] =
            factor
                .null_vectors[v * static_cast<std::size_t>(places.massive) + static_cast<std::size_t>(places.with[i])];
  }
}

// K on the null space of M: the rows without mass, bordered by the null vectors of the others.
SparseMatrix restricted(const SparseMatrix& k, const Places& places, const Columns& null) {
  SparseMatrix out = part(k, places.without, places.massless);
  const auto size = places.massless + static_cast<Index>(null.size());
  std::vector<std::vector<std::pair<Index, double>>> border(static_cast<std::size_t>(size));  // by column
  for (std::size_t v = 0; v < null.size(); ++v) {
    std::vector<double> image(null[v].size(), 0.0);
    for (Index j = 0; j < k.cols; ++j)
      for (auto p = static_cast<std::size_t>(k.col_ptr[static_cast<std::size_t>(j)]);
           p < static_cast<std::size_t>(k.col_ptr[static_cast<std::size_t>(j) + 1]); ++p) {
        const auto i = static_cast<std::size_t>(k.row_ind[p]), c = static_cast<std::size_t>(j);
        image[i] += k.values[p] * null[v][c];
        if (i != c) image[c] += k.values[p] * null[v][i];
      }
    const Index row = places.massless + static_cast<Index>(v);
    for (std::size_t i = 0; i < image.size(); ++i)
      if (places.without[i] >= 0 && image[i] != 0)
        border[static_cast<std::size_t>(places.without[i])].emplace_back(row, image[i]);
    for (std::size_t w = 0; w <= v; ++w) {
      double dot = 0;
      for (std::size_t i = 0; i < image.size(); ++i) dot += image[i] * null[w][i];
      border[static_cast<std::size_t>(places.massless) + w].emplace_back(row, dot);
    }
  }
  SparseMatrix all;
  all.rows = all.cols = size;
  all.storage = Storage::symmetric_lower;
  all.col_ptr.assign(1, 0);
  for (std::size_t j = 0; j < static_cast<std::size_t>(size); ++j) {
    for (auto p = static_cast<std::size_t>(j < out.col_ptr.size() - 1 ? out.col_ptr[j] : 0);
         j < out.col_ptr.size() - 1 && p < static_cast<std::size_t>(out.col_ptr[j + 1]); ++p) {
      all.row_ind.push_back(out.row_ind[p]);
      all.values.push_back(out.values[p]);
    }
    for (const auto& [row, value] : border[j]) {
      all.row_ind.push_back(row);
      all.values.push_back(value);
    }
    all.col_ptr.push_back(static_cast<Offset>(all.row_ind.size()));
  }
  return all;
}

// As it stands, or, where that cannot be factorized (more multipliers than massless unknowns, for instance), by the
// negative eigenvalues with a little less and a little more on the diagonal.
Inertia inertia_of_regular(const SparseMatrix& a, const Options& options) {
  Options o = factor_options(options, Kind::ldlt);
  o.singular = SingularMatrix::report;
  Solver solver(o);
  const AnalysisResult analysis = solver.analyze(a);
  if (analysis.status.ok()) {
    const FactorResult factor = solver.refactorize(a.values);
    if (factor.status.ok()) return factor.inertia;
    if (factor.status.code != StatusCode::singular) throw Error(factor.status);
  } else if (analysis.status.code != StatusCode::singular) {
    throw Error(analysis.status);
  }
  constexpr double kLittle = 1e-9;
  double largest = 0;
  for (const double v : a.values) largest = std::max(largest, std::abs(v));
  SparseMatrix identity;
  identity.rows = identity.cols = a.rows;
  identity.storage = Storage::symmetric_lower;
  for (Index i = 0; i <= a.rows; ++i) identity.col_ptr.push_back(i);
  for (Index i = 0; i < a.rows; ++i) identity.row_ind.push_back(i);
  identity.values.assign(static_cast<std::size_t>(a.rows), kLittle * largest);
  const auto negative = [&](double sign) {
    Solver moved(factor_options(options, Kind::ldlt));
    const SparseMatrix b = sum(1, a, sign, identity);
    const AnalysisResult analyzed = moved.analyze(b);
    if (!analyzed.status.ok()) throw Error(analyzed.status);
    const FactorResult factor = moved.refactorize(b.values);
    if (!factor.status.ok()) throw Error(factor.status);
    return factor.inertia.negative;
  };
  const Index below = negative(1), upto = negative(-1);
  return {a.rows - upto, below, upto - below};
}

// Rows without entries count as zeros.
Inertia inertia_of(const SparseMatrix& a, const Options& options) {
  std::vector<Index> place(static_cast<std::size_t>(a.rows), -1);
  for (Index j = 0; j < a.cols; ++j)
    for (auto p = static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(j)]);
         p < static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(j) + 1]); ++p)
      if (a.values[p] != 0) place[static_cast<std::size_t>(j)] = place[static_cast<std::size_t>(a.row_ind[p])] = 0;
  Index used = 0;
  for (Index& i : place)
    if (i == 0) i = used++;
  Inertia out{0, 0, 0};
  if (used > 0) out = inertia_of_regular(part(a, place, used), options);
  out.zero += a.rows - used;
  return out;
}

}  // namespace

MassReport look_at_mass(const SparseMatrix& k, const SparseMatrix& m, bool check, const Options& options) {
  const Places places = places_of(m);
  MassReport report;
  report.massless = places.massless;
  report.rank = places.massive;
  if (places.massive == 0)
    throw Error(StatusCode::invalid_input, "M has no entries but zeros: there are no finite eigenvalues");
  Columns null;
  if (!places.diagonal && check) check_definite(m, places, options, report, null);
  if (!places.diagonal && !check) {
    report.proven = false;
    report.why = "M was not factorized (check_mass)";
  }
  const SparseMatrix k22 = restricted(k, places, null);
  Inertia inertia{0, 0, 0};
  if (k22.rows > 0) inertia = inertia_of(k22, options);
  report.negative_at_infinity = inertia.negative + inertia.zero;
  report.finite = report.rank - inertia.zero;
  return report;
}

}  // namespace espalier::modes
