#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "device/cuda/executor/device_linear_system.hpp"
#include "device/cuda/executor/device_side.hpp"
#include "device/cuda/executor/differing_values.cuh"
#include "device/cuda/executor/linear_system_memory.cuh"
#include "device/cuda/executor/part_residuals.cuh"
#include "device/cuda/executor/residual_launch.cuh"
#include "device/cuda/executor/system_vectors.hpp"
#include "device/cuda/executor/vector_entries.cuh"
#include "device/cuda/kernels/linear_system_kernels.cuh"
#include "device/cuda/kernels/residual_kernels.cuh"
#include "device/cuda/runtime/device_memory.hpp"
#include "device/cuda/runtime/host_transfer.hpp"
#include "device/cuda/runtime/pinned_values.hpp"

namespace espalier::device::cuda {

namespace {

constexpr Index kMostColumns = 64;               // right-hand sides of one substitution
constexpr Index kColumnGroup = 8;                // several right-hand sides come in multiples of it
constexpr int kGroups = 8;                       // passes of residuals before the host looks at them
constexpr Offset kLinkBuffer = Offset{1} << 19;  // doubles that go through the link at a time: 4 MiB

// Pinning takes 0.4 s per GiB; what it saves each time are 30 ms of copying into pinned buffers.
constexpr int kPinFrom = 16;

double ratio(double above, double below) {
  const double infinity = std::numeric_limits<double>::infinity();
  if (above == infinity) return infinity;
  if (below > 0) return above / below;
  return above == 0 ? 0 : infinity;
}

// By what ResidualSizes holds.
BackwardError error_of(const double* f) { return {ratio(f[0], f[4] * f[2] + f[3]), f[1]}; }

template <class T>
class LinearSystemOnGpu final : public DeviceLinearSystem {
 public:
  LinearSystemOnGpu(const LinearSystemArrays& a, CudaExecutor<T>& executor, int device, Offset memory_bytes)
      : executor_(executor),
        device_(device),
        rounding_(a.rounding),
        values_(a.values),
        host_copy_(a.copy),
        memory_(a, executor, device, memory_bytes),
        doubles_(memory_.vector_doubles()),
        guard_(device),
        ends_(kGroups),
        dot_(1),
        magnitudes_(kLargestVectors),
        aborted_(1),
        link_(std::min<Offset>(kLinkBuffer, kColumnGroup * Offset{doubles_})),
        vectors_(memory_.budget(), device, doubles_) {
    guard_.leave();
  }
  ~LinearSystemOnGpu() override { settle(); }

  void take_values(const double* values) override {
    const DeviceGuard guard(device_);
    enqueue_values(values, memory_.copy());
    sent_ = false;
    has_values_ = !executor_.on_ranks();
  }
  void send_values(Offset first, Offset count) override {
    const DeviceGuard guard(device_);
    if (first == 0) {
      has_values_ = false;  // until the last ones have come
      if (++sendings_ == kPinFrom) pinned_values_.pin(values_);
    }
    const double* from = values_.data() + first;
    double* to = memory_.given() + first;
    if (!pinned_values_.are_pinned())
      link_.send(to, from, count, stream(), host_copy_);
    else
      call("cudaMemcpyAsync(values)", [&] {
        return cudaMemcpyAsync(to, from, static_cast<std::size_t>(count) * sizeof(double), cudaMemcpyHostToDevice,
                               stream());
      });
    sent_ = true;
    if (first + count == memory_.value_doubles()) has_values_ = !executor_.on_ranks();
  }
  [[nodiscard]] bool has_values() const override { return has_values_; }
  void replace_values(std::span<const Offset> places, std::span<const double> values) override {
    const DeviceGuard guard(device_);
    entries_.enqueue_scatter(places, values, memory_.given(), 0, stream());
    sent_ = true;
  }
  bool mark_differing(const double* values, std::span<unsigned char> rows,
                      std::span<unsigned char> columns) const override {
    const DeviceGuard guard(device_);
    return differing_.mark(memory_, values, rows, columns, stream());
  }
  [[nodiscard]] bool on_ranks() const override { return executor_.on_ranks(); }
  void copy_values(const double* from, Offset first, Offset count) override {
    const DeviceGuard guard(device_);
    call("cudaMemcpyAsync(values)", [&] {
      return cudaMemcpyAsync(memory_.given() + first, from, static_cast<std::size_t>(count) * sizeof(double),
                             cudaMemcpyDefault, stream());
    });
    sent_ = true;
  }
  void share_values(Offset first, Offset count) override {
    const DeviceGuard guard(device_);
    executor_.share_values(memory_.given(), first, count);
    sent_ = true;
  }
  std::optional<FactorOutcome> factorize(double smallest_pivot) override {
    return executor_.factorize_filled(filled_values(smallest_pivot));
  }
  std::optional<FactorOutcome> factorize_changed(double smallest_pivot, std::span<const char> reached) override {
    return executor_.factorize_part(filled_values(smallest_pivot), reached);
  }
  void read_values(std::span<double> to) const override { read(to.data(), memory_.given(), memory_.value_doubles()); }

  void substitute(const double* b, double* x, Index columns, bool transpose) override {
    const DeviceGuard guard(device_);
    for (Index first = 0; first < columns; first += kMostColumns) {
      if (first > 0) finish();  // each of them tells whether it was given up
      pending_ = unreported_ = true;
      const Index now = std::min(kMostColumns, columns - first);
      const Index width = now == 1 ? 1 : (now + kColumnGroup - 1) / kColumnGroup * kColumnGroup;
      const Passage p = memory_.passage(now, width, transpose);
      T* rhs = executor_.device_rhs(width);
      const SolveClear clear = executor_.clear_before_solve(width);
      const unsigned blocks = blocks_for(static_cast<Offset>(doubles_) * width);
      const Offset at = static_cast<Offset>(first) * doubles_;
      gather_kernel<T><<<blocks, kSystemThreads, 0, stream()>>>(p, b + at, rhs, clear, memory_.clock());
      call("launch of the gather kernel", [&] { return cudaGetLastError(); });
      executor_.enqueue_solve(rhs, width, transpose);
      scatter_kernel<T><<<blocks, kSystemThreads, 0, stream()>>>(p, rhs, x + at);
      call("launch of the scatter kernel", [&] { return cudaGetLastError(); });
    }
  }

  void compute(std::span<ResidualColumn> columns, bool transpose) const override {
    const DeviceGuard guard(device_);
    pending_ = true;
    constexpr std::size_t kEach = kResidualColumns;
    for (std::size_t first = 0; first < columns.size(); first += kGroups * kEach) {
      const std::size_t end = std::min(columns.size(), first + kGroups * kEach);
      for (std::size_t at = first; at < end; at += kEach)
        enqueue_residuals(memory_, executor_, columns.subspan(at, std::min(kEach, end - at)), transpose, aborted(),
                          ends_.data() + (at - first) / kEach);
      wait();
      for (std::size_t at = first; at < end; ++at) {
        columns[at].error = error_of(ends_.data()[(at - first) / kEach].found[(at - first) % kEach]);
      }
      if (first == 0 && substitution_seconds_ < 0) substitution_seconds_ = ends_.data()->substitution;
      unreported_ = false;
      if (ends_.data()->aborted != 0) throw executor_.solve_given_up();
    }
  }
  void compute_parts(const ResidualColumns& columns, std::span<BackwardError> errors, bool transpose) const override {
    const DeviceGuard guard(device_);
    pending_ = true;
    const auto parts = static_cast<Index>(errors.size()) / columns.columns;
    parts_.enqueue(memory_.pattern(), memory_.short_rows(), columns, transpose, parts, stream());
    wait_for_vectors();
    const double* found = parts_.found();
    for (BackwardError& e : errors) {
      e = error_of(found);
      found += ResidualSizes::kCount;
    }
  }
  void copy_parts(const double* from, double* to, Index columns, std::span<const char> taken) const override {
    const DeviceGuard guard(device_);
    pending_ = true;
    parts_.enqueue_copy(from, to, doubles_ / (static_cast<Index>(taken.size()) / columns), taken, stream());
  }
  double take_substitution_seconds() override { return std::exchange(substitution_seconds_, -1); }

  [[nodiscard]] Index size() const override { return doubles_; }
  void copy(const double* from, double* to) const override { enqueue_copy(from, to, doubles_); }
  void copy_vectors(const double* from, double* to, Offset count) override { enqueue_copy(from, to, count); }

  std::shared_ptr<double[]> host_memory(Offset count) override {
    const DeviceGuard guard(device_);
    const auto memory = std::make_shared<PinnedArray<double>>(count);
    return {memory, memory->data()};
  }

  [[nodiscard]] int number() const override { return device_; }
  bool add(const double* from, double* to) const override {
    const DeviceGuard guard(device_);
    pending_ = true;
    add_kernel<<<blocks_for(doubles_), kSystemThreads, 0, stream()>>>(doubles_, from, to);
    call("launch of the addition kernel", [&] { return cudaGetLastError(); });
    return true;
  }

  void multiply(const double* x, double* y, bool transpose) const override {
    const DeviceGuard guard(device_);
    pending_ = true;
    const unsigned blocks = memory_.residual_blocks(false);
    if (memory_.complex())
      complex_multiply_kernel<<<blocks, kSystemThreads, 0, stream()>>>(memory_.pattern(), memory_.system().hermitian, x,
                                                                       y, transpose);
    else
      multiply_kernel<<<blocks, kSystemThreads, 0, stream()>>>(memory_.pattern(), x, y, transpose);
    call("launch of the multiplication kernel", [&] { return cudaGetLastError(); });
  }
  void combine(double a, const double* x, double b, double* y) const override {
    const DeviceGuard guard(device_);
    pending_ = true;
    combine_kernel<<<blocks_for(doubles_), kSystemThreads, 0, stream()>>>(doubles_, a, x, b, y);
    call("launch of the combination kernel", [&] { return cudaGetLastError(); });
  }
  [[nodiscard]] double dot(const double* a, const double* b) const override {
    const DeviceGuard guard(device_);
    const DotJob job{doubles_,  a,          b, memory_.dot_sums(), reinterpret_cast<int*>(memory_.clock() + 2),
                     aborted(), dot_.data()};
    dot_kernel<<<dot_blocks(doubles_), kSystemThreads, 0, stream()>>>(job);
    call("launch of the kernel of scalar products", [&] { return cudaGetLastError(); });
    wait();
    unreported_ = false;
    if (dot_.data()->aborted != 0) throw executor_.solve_given_up();
    return dot_.data()->sum;
  }

  void finish() override {
    if (!pending_) return;
    const DeviceGuard guard(device_);
    wait_for_vectors();
  }
  void settle() noexcept override {
    if (pending_) (void)cudaStreamSynchronize(stream());
    pending_ = unreported_ = false;
  }

  [[nodiscard]] Vectors vectors(Index slot, Index columns) const override {
    return {vectors_.slot(slot, columns), nullptr};
  }
  std::shared_ptr<double[]> memory(Index columns) const override { return vectors_.take(columns); }
  void scatter(std::span<const Offset> places, std::span<const double> values, double* y,
               Index cleared) const override {
    const DeviceGuard guard(device_);
    pending_ = true;
    entries_.enqueue_scatter(places, values, y, static_cast<Offset>(doubles_) * cleared, stream());
  }
  void gather(const double* y, std::span<const Offset> places, double* to) const override {
    if (places.empty()) return;
    const DeviceGuard guard(device_);
    pending_ = true;
    entries_.enqueue_gather(y, places, stream());
    wait_for_vectors();
    std::copy_n(entries_.found(), places.size(), to);
  }
  void add_columns(const double* z, std::span<const double> factors, double* y) const override {
    const DeviceGuard guard(device_);
    pending_ = true;
    enqueue_added_columns(doubles_, z, factors, y, stream());
  }
  void largest(std::span<const double* const> vectors, std::span<double> found) const override {
    const DeviceGuard guard(device_);
    for (std::size_t first = 0; first < vectors.size(); first += kLargestVectors) {
      const auto some = vectors.subspan(first, std::min<std::size_t>(kLargestVectors, vectors.size() - first));
      pending_ = true;
      enqueue_largest(doubles_, some, memory_.maxima(), magnitudes_.data(), stream());
      wait_for_vectors();
      std::copy_n(magnitudes_.data(), some.size(), found.begin() + static_cast<std::ptrdiff_t>(first));
    }
  }
  double* right_hand_sides(Index columns) override { return vectors_.right_hand_sides(columns); }
  double* solutions(Index columns) override { return vectors_.solutions(columns); }

  void send(double* to, const double* from, Offset count) override {
    const DeviceGuard guard(device_);
    pending_ = true;
    link_.send(to, from, count, stream(), host_copy_);
  }
  void fetch(double* to, const double* from, Offset count) override {
    const DeviceGuard guard(device_);
    link_.fetch(to, from, count, stream(), host_copy_);
    pending_ = unreported_;
  }
  void expect_reachable(const double* array, const char* what) const override {
    cudaPointerAttributes found{};
    call("cudaPointerGetAttributes", [&] { return cudaPointerGetAttributes(&found, array); });
    if (found.type == cudaMemoryTypeUnregistered)
      throw std::invalid_argument(std::string(what) + " are not in the memory of a GPU; use the calls for host arrays");
  }
  void wait_for(void* other) override {
    const DeviceGuard guard(device_);
    wait_for_stream(static_cast<cudaStream_t>(other));
  }

 private:
  // Makes the device current while the members are made.
  class ConstructionGuard {
   public:
    explicit ConstructionGuard(int device) : guard_(std::make_unique<DeviceGuard>(device)) {}
    void leave() { guard_.reset(); }

   private:
    std::unique_ptr<DeviceGuard> guard_;
  };

  void wait_for_vectors() const {
    const int* from = aborted();
    *aborted_.data() = 0;
    if (from != nullptr)
      call("cudaMemcpyAsync(aborted)",
           [&] { return cudaMemcpyAsync(aborted_.data(), from, sizeof(int), cudaMemcpyDeviceToHost, stream()); });
    wait();
    unreported_ = false;
    if (*aborted_.data() != 0) throw executor_.solve_given_up();
  }

  FilledValues filled_values(double smallest_pivot) {
    if (std::exchange(sent_, false)) {
      const DeviceGuard guard(device_);
      enqueue_values(memory_.given(), nullptr);
    }
    const auto parts = static_cast<int>(memory_.largest().size());
    return {memory_.largest().data(), parts, smallest_pivot, memory_.diagonal(), rounding_};
  }

  void enqueue_values(const double* values, double* copy) {
    const ValuesJob<T> job = memory_.values_job(values, copy);
    const auto blocks = static_cast<unsigned>(memory_.largest().size());
    if (memory_.complex())
      scale_complex_kernel<T><<<blocks, kSystemThreads, 0, stream()>>>(memory_.pattern(), memory_.system(), job);
    else if (memory_.scales())
      scale_kernel<T><<<blocks, kSystemThreads, 0, stream()>>>(memory_.pattern(), job);
    else
      take_kernel<T><<<blocks, kSystemThreads, 0, stream()>>>(job);
    call("launch of the scaling kernel", [&] { return cudaGetLastError(); });
  }
  void enqueue_copy(const double* from, double* to, Offset count) const {
    const DeviceGuard guard(device_);
    pending_ = true;
    call("cudaMemcpyAsync(vectors)", [&] {
      return cudaMemcpyAsync(to, from, static_cast<std::size_t>(count) * sizeof(double), cudaMemcpyDefault, stream());
    });
  }

  [[nodiscard]] const int* aborted() const { return unreported_ ? executor_.solve_aborted() : nullptr; }

  void read(double* to, const double* from, Offset count) const {
    const DeviceGuard guard(device_);
    call("cudaMemcpyAsync(to host)", [&] {
      return cudaMemcpyAsync(to, from, static_cast<std::size_t>(count) * sizeof(double), cudaMemcpyDeviceToHost,
                             stream());
    });
    call("cudaStreamSynchronize", [&] { return cudaStreamSynchronize(stream()); });
  }
  void wait() const {
    call("cudaStreamSynchronize", [&] { return cudaStreamSynchronize(stream()); });
    pending_ = false;
  }
  [[nodiscard]] cudaStream_t stream() const { return static_cast<cudaStream_t>(executor_.stream()); }

  CudaExecutor<T>& executor_;
  int device_;
  double rounding_;
  std::span<const double> values_;  // of the host
  HostCopy host_copy_;
  mutable LinearSystemMemory<T> memory_;
  Index doubles_;  // of a vector
  ConstructionGuard guard_;
  mutable PinnedArray<ResidualEnd> ends_;
  mutable PinnedArray<DotEnd> dot_;
  PinnedArray<double> magnitudes_;
  mutable PartResiduals parts_;
  mutable VectorEntries entries_;
  PinnedArray<int> aborted_;
  HostTransfer link_;
  PinnedValues pinned_values_;
  mutable SystemVectors vectors_;
  bool sent_ = false;        // values that are not scaled yet
  bool has_values_ = false;  // all have come
  mutable DifferingValues differing_;
  int sendings_ = 0;
  mutable bool pending_ = false;     // work on vectors is enqueued
  mutable bool unreported_ = false;  // a substitution among it
  mutable double substitution_seconds_ = -1;
};

}  // namespace

template <class T>
std::unique_ptr<DeviceLinearSystem> make_device_linear_system(const LinearSystemArrays& arrays,
                                                              CudaExecutor<T>& executor, int device,
                                                              Offset memory_bytes) {
  return std::make_unique<LinearSystemOnGpu<T>>(arrays, executor, device, memory_bytes);
}

template std::unique_ptr<DeviceLinearSystem> make_device_linear_system(const LinearSystemArrays&, CudaExecutor<double>&,
                                                                       int, Offset);
template std::unique_ptr<DeviceLinearSystem> make_device_linear_system(const LinearSystemArrays&, CudaExecutor<float>&,
                                                                       int, Offset);

}  // namespace espalier::device::cuda
