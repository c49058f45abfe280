/// \file
/// The norm of a changed matrix, by the rows that changes touch.
#pragma once

#include <vector>

#include "changes/border.hpp"

namespace espalier::changes {

template <class T>
class RowNorm {
 public:
  /// |M|_inf, or |M^T|_inf if `turned`, of the rows and columns that count, or a little less where changes touch
  /// thousands of rows.
  double of(const ChangedMatrix<T>& matrix, Base<T>& base, const Border<T>& border, bool turned);

 private:
  std::vector<double> bound_;  // by entity, as the list below; zero between calls
  std::vector<char> touched_;
  std::vector<Index> list_;
};

}  // namespace espalier::changes
