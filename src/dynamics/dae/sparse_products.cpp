#include "dynamics/dae/sparse_products.hpp"

#include "dynamics/dae/at.hpp"

namespace espalier::dynamics {

void multiply_by_rows(const SparsePattern& p, ConstSpan values, ConstSpan x, Span y) {
  for (Index i = 0; i < p.rows; ++i) {
    double sum = 0;
    for (auto k = at(p.ptr[at(i)]); k < at(p.ptr[at(i) + 1]); ++k) sum += values[k] * x[at(p.ind[k])];
    y[at(i)] = sum;
  }
}

void add_transposed(const SparsePattern& p, ConstSpan values, ConstSpan x, Span y) {
  const std::size_t lines = p.ptr.size() - 1;
  for (std::size_t i = 0; i < lines; ++i) {
    const double xi = x[i];
    if (xi == 0) continue;
    for (auto k = at(p.ptr[i]); k < at(p.ptr[i + 1]); ++k) y[at(p.ind[k])] += values[k] * xi;
  }
}

}  // namespace espalier::dynamics
