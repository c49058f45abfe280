/// \file
/// Matrices into files that other programs read.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/substructure/matrix_file.hpp"

namespace espalier::dynamics {

/// A dense matrix, column by column, under a name.
struct NamedMatrix {
  std::string name;  ///< at most 8 letters and digits
  Index rows = 0, columns = 0;
  const double* values = nullptr;
  bool symmetric = false;
};

/// OUTPUT4: columns as they are, without zeros at their ends. Text has 17 digits a number, so that it is read back to
/// the last bit; numbers below 1e-99 in it are 0, since its exponents have two digits.
[[nodiscard]] std::string output4_binary(std::span<const NamedMatrix> matrices);
[[nodiscard]] std::string output4_text(std::span<const NamedMatrix> matrices);

/// DMIG cards of a symmetric matrix, in large fields. Such a field has 16 characters, that is 11 to 13 digits; what is
/// missing to all digits follows as a second matrix, whose name ends in L, to be added by who needs it.
/// @param unknowns of each row; component 0: a scalar
[[nodiscard]] std::string dmig_cards(const NamedMatrix& matrix, std::span<const NodalUnknown> unknowns);

/// A number in at most 16 characters, as many digits as fit: "-1.2345678901-05".
[[nodiscard]] std::string nastran_field(double value);

/// An array for NumPy.
struct NamedArray {
  std::string name;
  std::string type;                ///< "<f8", "<i8"
  std::vector<std::size_t> shape;  ///< the first index moves fastest
  const void* values = nullptr;
  std::size_t bytes = 0;
};
/// A .npz file, not packed.
[[nodiscard]] std::string npz_file(std::span<const NamedArray> arrays);

}  // namespace espalier::dynamics
