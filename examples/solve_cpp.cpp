// Analyze, factorize, solve: a bar of n elements, clamped at one end and pulled at the other.
#include <cmath>
#include <cstdio>
#include <espalier/espalier.hpp>
#include <vector>

/// The stiffness of the bar, lower triangle by columns; unit stiffness per element.
espalier::SparseMatrix bar(espalier::Index n) {
  espalier::SparseMatrix a;
  a.rows = a.cols = n;
  a.storage = espalier::Storage::symmetric_lower;
  a.col_ptr.push_back(0);
  for (espalier::Index j = 0; j < n; ++j) {
    a.row_ind.push_back(j);
    a.values.push_back(j + 1 < n ? 2.0 : 1.0);
    if (j + 1 < n) {
      a.row_ind.push_back(j + 1);
      a.values.push_back(-1.0);
    }
    a.col_ptr.push_back(static_cast<espalier::Offset>(a.row_ind.size()));
  }
  return a;
}

int main() {
  const espalier::Index n = 10000;
  const espalier::SparseMatrix a = bar(n);
  std::vector<double> force(n, 0.0), displacement(n);
  force.back() = 1.0;

  espalier::Solver solver;
  const auto analysis = solver.analyze(a);
  if (!analysis.status.ok()) return std::fprintf(stderr, "%s\n", analysis.status.message.c_str()), 1;
  const auto factor = solver.factorize(a);
  if (!factor.status.ok()) return std::fprintf(stderr, "%s\n", factor.status.message.c_str()), 1;
  const auto solution = solver.solve(force, displacement);
  if (!solution.status.ok()) return std::fprintf(stderr, "%s\n", solution.status.message.c_str()), 1;

  std::printf("%d unknowns, %lld entries in the factor, backward error %.1e\n", n,
              static_cast<long long>(analysis.nonzeros_factor), solution.backward_error);
  std::printf("the end moves by %.6f (exact: %d)\n", displacement.back(), n);
  return std::abs(displacement.back() - n) < 1e-6 * n ? 0 : 1;
}
