#include "dynamics/elements/jet_kernels.hpp"

#include "dynamics/elements/dispatch.hpp"

namespace espalier::dynamics {

ESPALIER_CLONES void add_hessian(double s, const double* __restrict b, double* __restrict h) {
  for (int k = 0; k < kLargeJet * kLargeJet; ++k) h[k] += s * b[k];
}

ESPALIER_CLONES void product_hessian(double u, const double* a2, double v, const double* b2,
                                     const double* __restrict a1, const double* __restrict b1, double* __restrict h) {
  for (int i = 0; i < kLargeJet; ++i) {
    const double ai = a1[i], bi = b1[i];
    const int row = kLargeJet * i;
    for (int j = 0; j < kLargeJet; ++j) h[row + j] = u * a2[row + j] + v * b2[row + j] + ai * b1[j] + bi * a1[j];
  }
}

ESPALIER_CLONES void chain_hessian(double df, const double* __restrict a2, double ddf, const double* __restrict a1,
                                   double* __restrict h) {
  for (int i = 0; i < kLargeJet; ++i) {
    const double left = ddf * a1[i];
    const int row = kLargeJet * i;
    for (int j = 0; j < kLargeJet; ++j) h[row + j] = df * a2[row + j] + left * a1[j];
  }
}

}  // namespace espalier::dynamics
