/// \file
/// Columns of sparse matrices inside the analysis, and their transposes, by all threads.
#pragma once

#include <span>
#include <vector>

#include "base/at.hpp"
#include "base/lazy_vector.hpp"
#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"

namespace espalier::analysis {

/// Columns of row indices, owned or seen.
struct Columns {
  std::span<const Offset> ptr;
  std::span<const Index> ind;
  std::vector<Offset> own_ptr;
  base::LazyVector<Index> own_ind;

  [[nodiscard]] std::span<const Index> operator[](std::int64_t j) const {
    const auto k = at(j);
    return ind.subspan(at(ptr[k]), at(ptr[k + 1] - ptr[k]));
  }
  void own() {
    ptr = own_ptr;
    ind = own_ind;
  }
};

/// counts[j + 1] -> positions
void accumulate(std::vector<Offset>& ptr);

/// The transpose of n columns; its columns come out sorted. The same for every number of threads.
Columns transpose(const Columns& columns, Index n, base::ThreadPool& pool);

/// Both triangles of a symmetric matrix of which one is stored, values included.
struct FullMatrix {
  std::vector<Offset> ptr;         ///< n + 1
  base::LazyVector<Index> row;     ///< ptr[n]
  base::LazyVector<double> value;  ///< ptr[n]
};
FullMatrix both_triangles(const MatrixView& a, base::ThreadPool& pool);

}  // namespace espalier::analysis
