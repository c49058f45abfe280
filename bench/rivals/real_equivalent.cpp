#include "rivals/real_equivalent.hpp"

namespace espalier::bench {

RealEquivalent::RealEquivalent(const SystemView& a) : full_(a, Shape::full_by_column, 0) {
  real_.rows = real_.cols = 2 * a.cols;
  real_.row_ind.reserve(4 * full_.indices.size());
  real_.values.resize(4 * full_.indices.size());
  real_.col_ptr.push_back(0);
  for (Index column = 0; column < a.cols; ++column)
    for (int part = 0; part < 2; ++part) {
      for (Offset k = full_.pointers[column]; k < full_.pointers[column + 1]; ++k) {
        real_.row_ind.push_back(2 * full_.indices[k]);
        real_.row_ind.push_back(2 * full_.indices[k] + 1);
      }
      real_.col_ptr.push_back(static_cast<Offset>(real_.row_ind.size()));
    }
}

MatrixView RealEquivalent::with_values(std::span<const double> values) {
  full_.fill(values);
  double* to = real_.values.data();
  for (Index column = 0; column < full_.size(); ++column) {
    const auto first = static_cast<std::size_t>(full_.pointers[column]),
               last = static_cast<std::size_t>(full_.pointers[column + 1]);
    for (std::size_t k = first; k < last; ++k) {
      *to++ = full_.values[2 * k];
      *to++ = full_.values[2 * k + 1];
    }
    for (std::size_t k = first; k < last; ++k) {
      *to++ = -full_.values[2 * k + 1];
      *to++ = full_.values[2 * k];
    }
  }
  return real_;
}

}  // namespace espalier::bench
