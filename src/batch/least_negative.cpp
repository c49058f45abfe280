#include "batch/least_negative.hpp"

#include <vector>

#include "base/at.hpp"

namespace espalier::batch {

// Unknowns without entries between them, whose diagonal is not positive, span a space on which x^T A x <= 0, which
// meets that of the positive eigenvalues in 0.
Index least_negative(const MatrixView& a) {
  std::vector<double> diagonal(at(a.cols), 0.0);
  for (Index c = 0; c < a.cols; ++c)
    for (Offset q = a.col_ptr[at(c)]; q < a.col_ptr[at(c) + 1]; ++q)
      if (a.row_ind[at(q)] == c) diagonal[at(c)] += a.values[at(q)];
  std::vector<char> taken(at(a.cols), 0), coupled(at(a.cols), 0);
  Index count = 0;
  for (Index c = 0; c < a.cols; ++c) {
    const auto first = at(a.col_ptr[at(c)]), last = at(a.col_ptr[at(c) + 1]);
    bool free = diagonal[at(c)] <= 0 && coupled[at(c)] == 0;
    for (std::size_t q = first; q < last && free; ++q)
      free = a.row_ind[q] == c || a.values[q] == 0 || taken[at(a.row_ind[q])] == 0;
    if (!free) continue;
    taken[at(c)] = 1;
    ++count;
    for (std::size_t q = first; q < last; ++q)
      if (a.row_ind[q] != c && a.values[q] != 0) coupled[at(a.row_ind[q])] = 1;
  }
  return count;
}

}  // namespace espalier::batch
