/// \file
/// What of a Newton step a GPU takes over: forces and tangents of flexible bodies, and the matrix K itself, which never
/// leaves its memory. The state lies there too where the integrator has its vectors there (device_motion.hpp);
/// otherwise three vectors go to the GPU for each evaluation of F, and one comes back.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/thread_pool.hpp"
#include "dynamics/dae/system.hpp"
#include "dynamics/device/device_body.hpp"
#include "dynamics/device/device_motion.hpp"
#include "dynamics/device/device_vectors.hpp"

namespace espalier::dynamics {

struct DeviceShare;

/// The pattern of K and what of it does not come from bodies on the GPU. Lent for the call that makes a DeviceMatrix.
struct DeviceMatrixLayout {
  const SparsePattern* w = nullptr;
  std::span<const Offset> k_ptr;      ///< columns of K + 1; the entries of W stand first in the first w->cols columns
  std::span<const Offset> w_of_host;  ///< positions in K of entries of W that components on the host add to
  std::span<const Offset> rest;       ///< positions in K of all entries outside W
};

/// The values of K = S [W ...; ... ...] S in the memory of a GPU.
class DeviceMatrix {
 public:
  virtual ~DeviceMatrix() = default;
  /// Zeros. @return W's entries, unscaled, where bodies write
  virtual double* clear() = 0;
  /// Writes `count` numbers from the first on.
  using Fill = std::function<void(Offset first, Offset count, double* to)>;
  /// Adds what components on the host give, in the order of DeviceMatrixLayout::w_of_host. What is written goes over
  /// the link while the next part is being written.
  virtual void add_from_host(const Fill& fill) = 0;
  /// |W_jj| and the largest |W_ij| of each column, to the host.
  virtual void column_sizes(Span diagonal, Span largest) = 0;
  /// K: W scaled by s_i s_j, and the rest as it is given. @return all values, finished when stream() is
  virtual const double* complete(ConstSpan scale, ConstSpan rest) = 0;
  /// The scales of a K that was assembled on the host: make_vectors() serves its factor, too.
  virtual void set_scale(ConstSpan scale) = 0;
  /// W as it was before the scaling, to the host.
  virtual void fetch_w(Span values) const = 0;
  /// out_i = the sum of |W_ij| x_j over j, to some digits, of W before the scaling. The same bits in every run.
  /// @param x  not negative
  virtual void sum_rows(ConstSpan x, Span out) const = 0;
  [[nodiscard]] virtual void* stream() const = 0;
  /// Vectors of the scales that complete() or set_scale() got last.
  virtual std::unique_ptr<DeviceVectors> make_vectors() = 0;
};

/// The GPUs that share a factor. The first one has K and vectors, and states come to it; bodies are divided among all
/// (divided_body.hpp). What is made here must not outlive it.
class DeviceAssembly {
 public:
  virtual ~DeviceAssembly() = default;
  /// Bodies of fewer elements are not divided: waiting for other GPUs takes longer. Of bodies that are made later.
  void divide_from(Index elements) { fewest_ = elements; }
  virtual std::unique_ptr<DeviceBody> make_body(const DeviceBodyTables& tables) = 0;
  virtual std::unique_ptr<DeviceMatrix> make_matrix(const DeviceMatrixLayout& layout) = 0;
  /// @param sizes  of the system @param share  lent for the call
  virtual std::unique_ptr<DeviceMotion> make_motion(const Sizes& sizes, const MotionDemand& demand,
                                                    const DeviceShare& share) = 0;

 protected:
  static constexpr Index kFewestElements = 50000;  // 47,000 tetrahedra gained nothing on two H200s
  Index fewest_ = kFewestElements;
};

/// @param places  one GPU at least
/// @param pool  outlives the object; null: the calling thread alone
/// @return null: this build has none
/// @throws Error(device_error, out_of_memory), as all of the above do
[[nodiscard]] std::unique_ptr<DeviceAssembly> make_device_assembly(const GpuPlaces& places, base::ThreadPool* pool);

}  // namespace espalier::dynamics
