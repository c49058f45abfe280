#include "modes/harvest.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "matrix/norms.hpp"

namespace espalier::modes {

namespace {

constexpr Index kHarvestColumns = 32;  // examined at a time

Eigen::Map<const Eigen::VectorXd> vector_of(const double* x, Index n) { return {x, n}; }

// Far above what a search leaves; a mode that has as much is none.
constexpr double kWorst = 1e-6;

void judge(ModesResult& result) {
  double worst = 0;
  for (const double r : result.residuals) worst = std::isnan(r) ? r : std::max(worst, r);
  if (worst <= kWorst && result.orthogonality <= kWorst) return;
  result.complete = false;
  result.completeness =
      fmt::format("not proven: residuals are up to {:.1e}, vectors orthogonal to {:.1e}", worst, result.orthogonality);
  throw Error(StatusCode::accuracy_not_reached,
              fmt::format("modes were found with residuals up to {:.1e} and orthogonal to {:.1e}: the matrices are too "
                          "badly scaled, or K - s M too badly conditioned; give another shift",
                          worst, result.orthogonality));
}

}  // namespace

void Harvest::add(Tall batch, const std::vector<double>& eigenvalues, const std::vector<double>& bounds) {
  batches_.push_back(std::make_unique<Tall>(std::move(batch)));
  for (std::size_t k = 0; k < eigenvalues.size(); ++k)
    sorted_.push_back({eigenvalues[k], bounds[k], batches_.back()->col(static_cast<Index>(k))});
  std::stable_sort(sorted_.begin(), sorted_.end(),
                   [](const Found& a, const Found& b) { return a.eigenvalue < b.eigenvalue; });
}

void Harvest::project_out(base::ThreadPool& pool, const Apply& b, Tall& v, Tall& work) const {
  for (Index c = 0; c < v.columns() && !batches_.empty(); c += work.columns()) {
    const Index width = std::min(work.columns(), v.columns() - c);
    b(v.col(c), work.col(0), width);
    for (const auto& batch : batches_)
      subtract(pool, v.rows(), batch->col(0), gram(pool, v.rows(), batch->col(0), batch->columns(), work.col(0), width),
               v.col(c));
  }
}

Index Harvest::below(double at) const {
  const auto end = std::lower_bound(sorted_.begin(), sorted_.end(), at,
                                    [](const Found& f, double limit) { return f.eigenvalue < limit; });
  return static_cast<Index>(end - sorted_.begin());
}

void Harvest::deliver(Index count, Index n, base::ThreadPool& pool, ModesResult& result) {
  count = std::min(count, size());
  const auto rows = static_cast<std::size_t>(n);
  result.vectors.resize(rows * static_cast<std::size_t>(count));
  for (Index i = 0; i < count; ++i) {
    result.eigenvalues.push_back((*this)[i].eigenvalue);
    result.error_bounds.push_back((*this)[i].bound);
  }
  pool.for_each_range(count, 1, [&](std::int64_t begin, std::int64_t end) {
    for (auto i = begin; i < end; ++i) {
      // The largest component is positive: shapes do not depend on where the search began.
      const auto x = vector_of((*this)[static_cast<Index>(i)].vector, n);
      Eigen::Index at = 0;
      x.cwiseAbs().maxCoeff(&at);
      const double sign = x[at] < 0 ? -1.0 : 1.0;
      double* to = result.vectors.data() + rows * static_cast<std::size_t>(i);
      for (std::size_t k = 0; k < rows; ++k) to[k] = sign * x[static_cast<Eigen::Index>(k)];
    }
  });
  sorted_.clear();
  batches_.clear();
}

void note_costs(const Pencil& pencil, const LanczosClock& clock, ModesResult& result) {
  result.factorizations = pencil.factorizations;
  result.solved_columns = clock.columns;
  result.seconds.analysis = pencil.analysis_seconds;
  result.seconds.factorization = pencil.factor_seconds;
  result.seconds.solves = clock.solves;
  result.seconds.orthogonalization = clock.orthogonalization;
}

void examine(const SparseMatrix& k, const SparseMatrix& m, const Product& k_full, const Product& m_full,
             bool inner_is_k, Resources& shop, ModesResult& result) {
  const Index n = result.n, count = result.count();
  const double k_norm = matrix::norm_inf(k, &shop.pool), m_norm = matrix::norm_inf(m, &shop.pool);
  Tall kx(n, std::min(count, kHarvestColumns), &shop.budget), mx(n, std::min(count, kHarvestColumns), &shop.budget);
  result.residuals.assign(static_cast<std::size_t>(count), 0.0);
  for (Index c = 0; c < count; c += kHarvestColumns) {
    const Index width = std::min(kHarvestColumns, count - c);
    const double* x = result.vectors.data() + static_cast<std::int64_t>(n) * c;
    k_full.apply(shop.pool, x, kx.col(0), width);
    m_full.apply(shop.pool, x, mx.col(0), width);
    for (Index j = 0; j < width; ++j) {
      const auto i = static_cast<std::size_t>(c + j);
      const double l = result.eigenvalues[i];
      const double size = (k_norm + std::abs(l) * m_norm) * vector_of(x + static_cast<std::int64_t>(n) * j, n).norm();
      const double residual = (vector_of(kx.col(j), n) - l * vector_of(mx.col(j), n)).norm();
      result.residuals[i] = residual == 0 ? 0 : residual / size;  // without stiffness both are 0
    }
    const Dense g = gram(shop.pool, n, result.vectors.data(), count, inner_is_k ? kx.col(0) : mx.col(0), width);
    for (Index j = 0; j < width; ++j)
      for (Index i = 0; i < count; ++i)
        result.orthogonality = std::max(result.orthogonality, std::abs(g(i, j) - (i == c + j ? 1.0 : 0.0)));
  }
  judge(result);
}

}  // namespace espalier::modes
