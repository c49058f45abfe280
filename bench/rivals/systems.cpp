#include "rivals/systems.hpp"

#include <filesystem>
#include <iterator>
#include <sstream>
#include <vector>

#include "base/thread_pool.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/read.hpp"

namespace espalier::bench {

SparseMatrix make_system(const std::string& words) {
  if (std::filesystem::is_regular_file(words)) return matrix::read_matrix(words);
  std::istringstream stream(words);
  const std::vector<std::string> tokens{std::istream_iterator<std::string>(stream), {}};
  base::ThreadPool pool(base::available_cores());
  return matrix::generate(matrix::parse_generator(tokens), &pool);
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
