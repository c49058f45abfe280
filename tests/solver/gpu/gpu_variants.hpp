/// \file
/// What factorizations that keep numbers are tried with on a GPU: kinds, precisions, matrices.
#pragma once

#include "solver/changed_values.hpp"
#include "solver/gpu/gpu_fixture.hpp"

#if ESPALIER_WITH_CUDA
#include "device/cuda/runtime/cuda_faults.hpp"

namespace espalier::gpu_variants {

using namespace changed_values;

/// Calls of CUDA that a test lets fail work again after it.
class FaultsOnGpu : public test::OnGpu {
 protected:
  void TearDown() override { device::cuda::call_faults().arm(0); }
};

struct Variant {
  const char* name;
  Kind kind;
  Precision precision = Precision::fp64;
  Index block = 0;
  Rescale rescale = Rescale::off;
};

inline constexpr Variant kVariants[] = {{"llt", Kind::llt},
                                        {"llt in narrow tiles", Kind::llt, Precision::fp64, 32},
                                        {"llt in FP32", Kind::llt, Precision::fp32},
                                        {"ldlt", Kind::ldlt},
                                        {"ldlt in FP32", Kind::ldlt, Precision::fp32},
                                        {"ldlt rescaled", Kind::ldlt, Precision::fp64, 0, Rescale::on},
                                        {"lu", Kind::lu},
                                        {"lu mixed", Kind::lu, Precision::mixed},
                                        {"lu in FP32", Kind::lu, Precision::fp32},
                                        {"chosen", Kind::automatic}};

inline Options on_gpu(bool partial) {
  Options o = bare(partial);
  o.device = "gpu:0";
  o.threads = 2;
  return o;
}

inline std::vector<SparseMatrix> matrices(Kind kind, unsigned seed) {
  std::vector<SparseMatrix> list{reference::random_system(900, 4, Values::positive, seed)};
  if (kind != Kind::llt) list.push_back(reference::saddle_point(300, 80, seed));
  if (kind == Kind::lu) list.push_back(reference::random_system(700, 4, Values::general, seed));
  list.push_back(elasticity(seed % 2 == 0 ? 7 : 11));
  return list;
}

}  // namespace espalier::gpu_variants
#endif
