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
#include "dynamics/device/device_motion.hpp"
#include "dynamics/device/device_vectors.hpp"
#include "dynamics/elements/assembly.hpp"
#include "dynamics/elements/device_law.hpp"

namespace espalier::dynamics {

/// Elements of one law.
struct DeviceElements {
  DeviceLaw law;
  int nodes;
  std::vector<Index> vertices;  ///< `nodes` of each element, of the body
};

/// A flexible body as a GPU takes it. Lent for the call that makes a DeviceBody.
struct DeviceBodyTables {
  std::vector<DeviceElements> groups;
  std::span<const double> reference;  ///< 3 per vertex
  const VertexPattern* pattern = nullptr;
  std::span<const double> mass;    ///< per entry of the pattern
  std::span<const double> weight;  ///< M g, 3 per vertex
  double mass_damping = 0;         ///< alpha in 1/s
  double stiffness_damping = 0;    ///< beta in s
};

/// A body's own coordinates at some time, 3 per vertex. v and a may be null: zero.
struct BodyState {
  const double* q = nullptr;
  const double* v = nullptr;
  const double* a = nullptr;
  bool there = false;  ///< they lie in the memory of the body's GPU
};

/// The elements of one body in the memory of a GPU. start_*() returns at once; what it began is taken by the finish_*()
/// of the same name, or by put_forces() and finish().
class DeviceBody {
 public:
  virtual ~DeviceBody() = default;
  /// Where 3 x 3 blocks go; see BlockTarget. Lent for the call.
  virtual void bind(std::span<const Offset> column_start, std::span<const std::int32_t> shift) = 0;
  /// Internal forces and M (a + alpha v).
  virtual void start_forces(const BodyState& state) = 0;
  /// f += forces - load * weight, 3 per vertex. @return the first inverted element, counted over all groups, whose
  /// forces are NaN; -1: none
  virtual Offset finish_forces(double load, const double* weight, double* f) = 0;
  /// f := forces - load M g in the GPU's memory. Does not wait; finish() does. @pre start_forces() with a state there
  virtual void put_forces(double load, double* f) = 0;
  /// Writes (weights.a + alpha weights.v) M + weights.q df/dq + weights.v df/dv.
  /// @param values  in the GPU's memory, where bind() counts from
  virtual void start_tangent(const BodyState& state, const TangentWeights& weights, double* values) = 0;
  /// Waits for put_forces() or start_tangent(). @return as finish_forces()
  virtual Offset finish() = 0;
};

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
  /// Of the scales that complete() or set_scale() got last.
  virtual std::unique_ptr<DeviceVectors> make_vectors() = 0;
};

/// One GPU. Bodies and matrices must not outlive it.
class DeviceAssembly {
 public:
  virtual ~DeviceAssembly() = default;
  virtual std::unique_ptr<DeviceBody> make_body(const DeviceBodyTables& tables) = 0;
  virtual std::unique_ptr<DeviceMatrix> make_matrix(const DeviceMatrixLayout& layout) = 0;
  /// @param sizes  of the system @param share  lent for the call
  virtual std::unique_ptr<DeviceMotion> make_motion(const Sizes& sizes, const MotionDemand& demand,
                                                    const DeviceShare& share) = 0;
};

/// @param gpu  its number, from 0
/// @param pool  outlives the object; null: the calling thread alone
/// @return null: this build has none
/// @throws Error(device_error, out_of_memory), as all of the above do
[[nodiscard]] std::unique_ptr<DeviceAssembly> make_device_assembly(int gpu, base::ThreadPool* pool);

}  // namespace espalier::dynamics
