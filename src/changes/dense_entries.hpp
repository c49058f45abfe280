/// \file
/// Loops over the entries of small dense matrices: they take a compiler less than Eigen's expressions of two scalars.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "base/at.hpp"

namespace espalier::changes {

template <class T>
using Dense = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>;

/// use(entry, row, column)
template <class Matrix, class Use>
void for_each_entry(Matrix& a, const Use& use) {
  for (Eigen::Index c = 0; c < a.cols(); ++c)
    for (Eigen::Index r = 0; r < a.rows(); ++r) use(a(r, c), r, c);
}

template <class T>
Eigen::VectorXd largest_of_rows(const Dense<T>& a) {
  Eigen::VectorXd largest = Eigen::VectorXd::Zero(a.rows());
  for_each_entry(a, [&](T x, auto r, auto) { largest[r] = std::max(largest[r], std::abs(x)); });
  return largest;
}

template <class T>
Dense<T> scaled_rows(const Eigen::VectorXd& by, Dense<T> a) {
  for_each_entry(a, [&](T& x, auto r, auto) { x *= by[r]; });
  return a;
}

/// The rows and columns of a list.
template <class T>
Dense<T> chosen(const Dense<T>& a, const std::vector<Index>& list) {
  const auto n = static_cast<Eigen::Index>(list.size());
  Dense<T> made(n, n);
  for_each_entry(made, [&](T& x, auto r, auto c) { x = a(list[at(r)], list[at(c)]); });
  return made;
}

}  // namespace espalier::changes
