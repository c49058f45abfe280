#include "dynamics/dae/sparse_products.hpp"

namespace espalier::dynamics {

namespace {
std::size_t at(Offset i) { return static_cast<std::size_t>(i); }
}  // namespace

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
