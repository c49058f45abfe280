#include "rivals/systems.hpp"

#include <filesystem>
#include <sstream>
#include <vector>

#include "matrix/read.hpp"

namespace espalier::bench {
namespace {

/// Seven-point Laplacian of an x by y by z grid with zero boundary, lower triangle.
SparseMatrix poisson(Index x, Index y, Index z) {
  SparseMatrix a;
  a.rows = a.cols = x * y * z;
  a.storage = Storage::symmetric_lower;
  a.col_ptr.push_back(0);
  for (Index k = 0; k < a.cols; ++k) {
    const auto put = [&](Index row, double value) { a.row_ind.push_back(row), a.values.push_back(value); };
    put(k, 6);
    if (k % x + 1 < x) put(k + 1, -1);
    if (k / x % y + 1 < y) put(k + x, -1);
    if (k / x / y + 1 < z) put(k + x * y, -1);
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  return a;
}

}  // namespace

SparseMatrix make_system(const std::string& words) {
  if (std::filesystem::is_regular_file(words)) return matrix::read_matrix(words);
  std::istringstream stream(words);
  std::string name;
  Index x = 0, y = 0, z = 0;
  if (stream >> name >> x >> y >> z && name == "poisson" && x > 0 && y > 0 && z > 0) return poisson(x, y, z);
  throw Error(StatusCode::invalid_input, "'" + words + "' is neither a matrix file nor \"poisson NX NY NZ\"");
}

Kind automatic_kind(const MatrixView& a) {
  if (!a.symmetric()) return Kind::lu;
  std::vector<double> diagonal(static_cast<std::size_t>(a.cols), 0);
  for (Index column = 0; column < a.cols; ++column)
    for (Offset k = a.col_ptr[column]; k < a.col_ptr[column + 1]; ++k)
      if (a.row_ind[k] == column) diagonal[column] += a.values[k];
  for (const double value : diagonal)
    if (!(value > 0)) return Kind::ldlt;
  return Kind::llt;
}

}  // namespace espalier::bench
