/// \file
/// A complex system as a real one of twice the size: how complex answers are judged, with the residual of real ones.
#pragma once

#include "rivals/compressed.hpp"

namespace espalier::bench {

/// The matrix with a block [[a, -b], [b, a]] for each entry a + bi. It maps real and imaginary parts in turn as the
/// complex matrix maps numbers, so right-hand sides and solutions serve as they lie in memory. Its residual is that of
/// the complex system; its norms, which add the magnitudes of both parts, are up to sqrt(2) times those.
class RealEquivalent {
 public:
  /// @pre a has complex numbers, and values
  explicit RealEquivalent(const SystemView& a);

  /// `values` in the order of the system's entries. The view holds until the next call.
  [[nodiscard]] MatrixView with_values(std::span<const double> values);

 private:
  CompressedMatrix full_;
  SparseMatrix real_;
};

}  // namespace espalier::bench
