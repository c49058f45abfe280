/// \file
/// A linear system of the benchmark with real or complex numbers.
#pragma once

#include "base/scalar.hpp"
#include "espalier/matrix.hpp"

namespace espalier::bench {

using base::Numbers;

/// A matrix that somebody else owns. Complex values stand as doubles, real and imaginary parts in turn, so there are
/// parts_of(numbers) * nonzeros() of them; right-hand sides and solutions of the system likewise. Numbers::hermitian
/// goes with the Hermitian storages, Numbers::complex with all others.
struct SystemView : MatrixView {
  SystemView(const MatrixView& a, Numbers n = Numbers::real)  // NOLINT(google-explicit-constructor): real ones are many
      : MatrixView(a), numbers(n) {}
  SystemView(const SparseMatrix& a, Numbers n = Numbers::real)  // NOLINT(google-explicit-constructor): as above
      : SystemView(a.view(), n) {}

  /// Doubles in one number.
  [[nodiscard]] Index parts() const { return base::parts_of(numbers); }
  Numbers numbers;
};

}  // namespace espalier::bench
