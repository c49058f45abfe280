#include <algorithm>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "device/cuda/executor/device_equations.hpp"
#include "device/cuda/executor/device_side.hpp"
#include "device/cuda/kernels/equation_kernels.cuh"
#include "device/cuda/kernels/residual_kernels.cuh"
#include "device/cuda/runtime/device_memory.hpp"
#include "device/cuda/runtime/host_link.hpp"

namespace espalier::device::cuda {

namespace {

constexpr Index kMostColumns = 64;  // right-hand sides of one substitution
constexpr Index kColumnGroup = 8;   // several right-hand sides come in multiples of it
constexpr int kResidualNumbers = kResidualColumns * ResidualSizes::kCount;
constexpr int kGroups = 8;                  // passes of residuals before the host looks at them
constexpr Offset kPiece = Offset{1} << 19;  // doubles that go through the link at a time: 4 MiB

unsigned blocks_for(Offset threads) {
  return static_cast<unsigned>((threads + kEquationThreads - 1) / kEquationThreads);
}

Offset budget_for(int device, Offset memory_bytes) {
  const DeviceGuard guard(device);
  std::size_t free = 0, total = 0;
  call("cudaMemGetInfo", [&] { return cudaMemGetInfo(&free, &total); });
  const auto all = static_cast<Offset>(free);
  return memory_bytes > 0 ? std::min(memory_bytes, all) : all;
}

// Blocks of the kernel that are on the device at a time.
template <class Kernel>
unsigned resident_blocks(Kernel* kernel, int device) {
  int multiprocessors = 0, each = 0;
  call("cudaDeviceGetAttribute",
       [&] { return cudaDeviceGetAttribute(&multiprocessors, cudaDevAttrMultiProcessorCount, device); });
  call("cudaOccupancyMaxActiveBlocksPerMultiprocessor",
       [&] { return cudaOccupancyMaxActiveBlocksPerMultiprocessor(&each, kernel, kEquationThreads, 0); });
  return static_cast<unsigned>(std::max(1, each * multiprocessors));
}

template <class T>
class Equations final : public DeviceEquations<T> {
 public:
  using typename DeviceEquations<T>::Column;

  Equations(const EquationArrays& a, CudaExecutor<T>& executor, int device, Offset memory_bytes)
      : executor_(executor),
        device_(device),
        budget_(budget_for(device, memory_bytes)),
        guard_(device),
        n_(a.pattern.cols),
        nonzeros_(a.pattern.nonzeros()),
        general_(a.pattern.storage == Storage::general),
        scales_(!a.row_scale.empty() || !a.col_scale.empty()),
        ends_(kGroups),
        aborted_(1),
        link_(std::min<Offset>(kPiece, kColumnGroup * Offset{n_})) {
    constexpr Offset kMost = std::numeric_limits<std::uint32_t>::max() - 64;  // kernels look so far ahead
    if (nonzeros_ > kMost) throw Error(StatusCode::out_of_memory, "more than 2^32 entries are not indexed on a device");
    upload(col_ptr_, a.pattern.col_ptr);
    upload(row_ind_, a.pattern.row_ind);
    upload(row_ptr_, a.row_ptr);
    upload(row_col_, a.row_col);
    upload_source(a.row_source);
    upload(order_, a.order);
    upload(row_of_col_, a.row_of_col);
    upload(row_scale_, a.row_scale);
    upload(col_scale_, a.col_scale);
    upload(diagonal_, a.diagonal);
    take_values_memory();
    take_residual_memory();
    guard_.leave();
  }
  ~Equations() override { settle(); }

  void take_values(const double* values) override {
    const DeviceGuard guard(device_);
    enqueue_values(values, copy_.size() > 0 ? copy_.data() : nullptr);
  }
  void send_values(const double* values, Offset first, Offset count, const HostCopy& copy) override {
    const DeviceGuard guard(device_);
    if (!pinned_values_) return link_.send(given() + first, values + first, count, stream(), copy);
    call("cudaMemcpyAsync(values)", [&] {
      return cudaMemcpyAsync(given() + first, values + first, static_cast<std::size_t>(count) * sizeof(double),
                             cudaMemcpyHostToDevice, stream());
    });
  }
  void take_sent_values() override {
    const DeviceGuard guard(device_);
    enqueue_values(given(), nullptr);
  }
  FilledValues filled() const override {
    return {largest_.data(), static_cast<int>(largest_.size()), 0, diagonal_.data(), 0};
  }
  void read_values(std::span<double> to) const override { read(to.data(), given(), nonzeros_); }

  void substitute(const double* b, double* x, Index columns, bool transpose) override {
    const DeviceGuard guard(device_);
    for (Index first = 0; first < columns; first += kMostColumns) {
      if (first > 0) finish();  // each of them tells whether it was given up
      pending_ = unreported_ = true;
      const Index now = std::min(kMostColumns, columns - first);
      const Index width = now == 1 ? 1 : (now + kColumnGroup - 1) / kColumnGroup * kColumnGroup;
      const Passage p{order_.data(), row_of_col_.data(), row_scale_.data(), col_scale_.data(), n_, now,
                      width,         transpose};
      T* rhs = executor_.device_rhs(width);
      const SolveClear clear = executor_.clear_before_solve(width);
      const unsigned blocks = blocks_for(static_cast<Offset>(n_) * width);
      const Offset at = static_cast<Offset>(first) * n_;
      gather_kernel<T><<<blocks, kEquationThreads, 0, stream()>>>(p, b + at, rhs, clear, clock());
      call("launch of the gather kernel", [&] { return cudaGetLastError(); });
      executor_.enqueue_solve(rhs, width, transpose);
      scatter_kernel<T><<<blocks, kEquationThreads, 0, stream()>>>(p, rhs, x + at);
      call("launch of the scatter kernel", [&] { return cudaGetLastError(); });
    }
  }

  void residuals(std::span<const Column> columns, bool transpose, std::span<DeviceResidual> found) override {
    const DeviceGuard guard(device_);
    pending_ = true;
    constexpr std::size_t kEach = kResidualColumns;
    for (std::size_t first = 0; first < columns.size(); first += kGroups * kEach) {
      const std::size_t end = std::min(columns.size(), first + kGroups * kEach);
      for (std::size_t at = first; at < end; at += kEach)
        enqueue_residuals(columns.subspan(at, std::min(kEach, end - at)), transpose,
                          ends_.data() + (at - first) / kEach);
      wait();
      for (std::size_t at = first; at < end; ++at) {
        const double* f = ends_.data()[(at - first) / kEach].found[(at - first) % kEach];
        found[at] = {f[0], f[1], f[2], f[3], f[4]};
      }
      if (first == 0) substitution_seconds_ = ends_.data()->substitution;
      unreported_ = false;
      if (ends_.data()->aborted != 0) throw executor_.solve_given_up();
    }
  }
  [[nodiscard]] double substitution_seconds() const override { return substitution_seconds_; }

  void copy(const double* from, double* to, Offset count) override {
    const DeviceGuard guard(device_);
    pending_ = true;
    call("cudaMemcpyAsync(vectors)", [&] {
      return cudaMemcpyAsync(to, from, static_cast<std::size_t>(count) * sizeof(double), cudaMemcpyDefault, stream());
    });
  }

  void add(const double* from, double* to) override {
    const DeviceGuard guard(device_);
    pending_ = true;
    add_kernel<<<blocks_for(n_), kEquationThreads, 0, stream()>>>(n_, from, to);
    call("launch of the addition kernel", [&] { return cudaGetLastError(); });
  }

  void finish() override {
    if (!pending_) return;
    const DeviceGuard guard(device_);
    const int* aborted = unreported_ ? executor_.solve_aborted() : nullptr;
    *aborted_.data() = 0;
    if (aborted != nullptr)
      call("cudaMemcpyAsync(aborted)",
           [&] { return cudaMemcpyAsync(aborted_.data(), aborted, sizeof(int), cudaMemcpyDeviceToHost, stream()); });
    wait();
    unreported_ = false;
    if (*aborted_.data() != 0) throw executor_.solve_given_up();
  }
  void settle() noexcept override {
    if (pending_) (void)cudaStreamSynchronize(stream());
    pending_ = unreported_ = false;
  }

  double* vectors(Index slot, Index columns) override {
    DeviceArray<double>& s = slots_[static_cast<std::size_t>(slot)];
    if (s.size() < static_cast<Offset>(n_) * columns) {
      const DeviceGuard guard(device_);
      s = DeviceArray<double>();
      s = take<double>(static_cast<Offset>(n_) * columns);
    }
    return s.data();
  }

  void send(double* to, const double* from, Offset count, const HostCopy& copy) override {
    const DeviceGuard guard(device_);
    pending_ = true;
    link_.send(to, from, count, stream(), copy);
  }
  void fetch(double* to, const double* from, Offset count, const HostCopy& copy) override {
    const DeviceGuard guard(device_);
    link_.fetch(to, from, count, stream(), copy);
    pending_ = unreported_;
  }
  // Where pinning is refused, copies are slower, but nothing else changes.
  void pin(std::span<const double> values) override {
    const DeviceGuard guard(device_);
    auto* p = const_cast<double*>(values.data());  // the device only reads
    if (!values.empty() && cudaHostRegister(p, values.size_bytes(), cudaHostRegisterDefault) == cudaSuccess)
      pinned_values_.reset(p);
    (void)cudaGetLastError();
  }
  void expect_reachable(const double* array, const char* what) const override {
    cudaPointerAttributes found{};
    call("cudaPointerGetAttributes", [&] { return cudaPointerGetAttributes(&found, array); });
    if (found.type == cudaMemoryTypeUnregistered)
      throw std::invalid_argument(std::string(what) + " are not in the memory of a GPU; use the calls for host arrays");
  }
  // A stream that is done, as after every call of a caller that waits itself, costs one question.
  void wait_for(void* other) override {
    const DeviceGuard guard(device_);
    auto* const theirs = static_cast<cudaStream_t>(other);
    const cudaError_t state = attempt("cudaStreamQuery(caller's stream)", [&] { return cudaStreamQuery(theirs); });
    if (state == cudaErrorNotReady)
      call("cudaStreamSynchronize(caller's stream)", [&] { return cudaStreamSynchronize(theirs); });
    else
      check(state, "cudaStreamQuery(caller's stream)");
  }
  [[nodiscard]] Offset bytes() const override { return budget_.held(); }

 private:
  struct Unpin {
    void operator()(double* p) const { (void)cudaHostUnregister(p); }
  };

  // Makes the device current while the members are made.
  class ConstructionGuard {
   public:
    explicit ConstructionGuard(int device) : guard_(std::make_unique<DeviceGuard>(device)) {}
    void leave() { guard_.reset(); }

   private:
    std::unique_ptr<DeviceGuard> guard_;
  };

  template <class U>
  DeviceArray<U> take(Offset count) {
    return DeviceArray<U>(count, budget_, budget_.held() + count * static_cast<Offset>(sizeof(U)));
  }
  template <class U>
  void upload(DeviceArray<U>& to, std::span<const U> from) {
    to = take<U>(static_cast<Offset>(from.size()));
    executor_.uploads().copy(to.data(), from.data(), to.bytes(), stream());
  }
  // In 32 bits: half the memory and half the traffic of every residual.
  void upload_source(std::span<const Offset> source) {
    row_source_ = take<std::uint32_t>(static_cast<Offset>(source.size()));
    executor_.uploads().make(row_source_.data(), row_source_.size(), sizeof(std::uint32_t), stream(),
                             [source](std::byte* stage, Offset first, Offset end) {
                               auto* to = reinterpret_cast<std::uint32_t*>(stage);
                               for (Offset k = first; k < end; ++k)
                                 *to++ = static_cast<std::uint32_t>(source[static_cast<std::size_t>(k)]);
                             });
  }

  // FP64 values that nothing scales are factored as they are; all others need a place of their own.
  void take_values_memory() {
    if (sizeof(T) != sizeof(double) || scales_ || executor_.values_size() < nonzeros_) copy_ = take<double>(nonzeros_);
    const unsigned most =
        scales_ ? resident_blocks(scale_kernel<T>, device_) : resident_blocks(take_kernel<T>, device_);
    const Offset threads = scales_ ? static_cast<Offset>(n_) * kLanes : nonzeros_;
    largest_ = take<double>(std::clamp<Offset>(blocks_for(threads), 1, most));
  }
  void take_residual_memory() {
    const unsigned rows = blocks_for(static_cast<Offset>(n_) * kLanes);
    const auto blocks = [&](auto* kernel) { return std::clamp(resident_blocks(kernel, device_), 1U, rows); };
    residual_blocks_[0] = blocks(short_rows() ? residual_kernel<1, 2> : residual_kernel<1, 4>);
    residual_blocks_[1] = blocks(residual_kernel<kResidualColumns, 1>);
    residual_control_ = take<unsigned long long>(kResidualNumbers + 3);
    call("cudaMemset",
         [&] { return cudaMemset(residual_control_.data(), 0, static_cast<std::size_t>(residual_control_.bytes())); });
  }
  // Both halves of most rows fit into a batch of two: more rows at a time then serve better than more entries.
  [[nodiscard]] bool short_rows() const { return nonzeros_ <= 2 * kLanes * Offset{n_}; }
  [[nodiscard]] unsigned long long* clock() const { return residual_control_.data() + kResidualNumbers; }

  // The values as they were given.
  [[nodiscard]] double* given() const {
    if constexpr (std::is_same_v<T, double>)
      if (copy_.size() == 0) return executor_.values();
    return copy_.data();
  }
  void enqueue_values(const double* values, double* copy) {
    const ValuesJob<T> job{values,
                           copy,
                           executor_.values(),
                           row_scale_.data(),
                           col_scale_.data(),
                           nonzeros_,
                           executor_.values_size(),
                           largest_.data()};
    const auto blocks = static_cast<unsigned>(largest_.size());
    if (scales_)
      scale_kernel<T><<<blocks, kEquationThreads, 0, stream()>>>(pattern(), job);
    else
      take_kernel<T><<<blocks, kEquationThreads, 0, stream()>>>(job);
    call("launch of the scaling kernel", [&] { return cudaGetLastError(); });
  }

  void enqueue_residuals(std::span<const Column> columns, bool transpose, ResidualEnd* end) {
    ResidualJob job{};
    for (std::size_t k = 0; k < columns.size(); ++k) {
      job.b[k] = columns[k].b;
      job.x[k] = columns[k].x;
      job.r[k] = columns[k].r;
    }
    job.columns = static_cast<int>(columns.size());
    job.transpose = transpose;
    job.largest = residual_control_.data();
    job.ticket = reinterpret_cast<int*>(clock() + 2);
    job.clock = clock();
    job.aborted = unreported_ ? executor_.solve_aborted() : nullptr;
    job.end = end;
    if (columns.size() == 1 && short_rows()) {
      residual_kernel<1, 2><<<residual_blocks_[0], kEquationThreads, 0, stream()>>>(pattern(), job);
    } else if (columns.size() == 1) {
      residual_kernel<1, 4><<<residual_blocks_[0], kEquationThreads, 0, stream()>>>(pattern(), job);
    } else {
      // Right-hand sides of the factorization are not needed now; their memory is.
      constexpr Index kWidth = kResidualColumns * static_cast<Index>(sizeof(double) / sizeof(T));
      auto* packed = reinterpret_cast<double*>(executor_.device_rhs(kWidth));
      job.packed = packed;
      pack_kernel<<<blocks_for(static_cast<Offset>(n_) * kResidualColumns), kEquationThreads, 0, stream()>>>(n_, job,
                                                                                                             packed);
      call("launch of the packing kernel", [&] { return cudaGetLastError(); });
      residual_kernel<kResidualColumns, 1><<<residual_blocks_[1], kEquationThreads, 0, stream()>>>(pattern(), job);
    }
    call("launch of the residual kernel", [&] { return cudaGetLastError(); });
  }

  void read(double* to, const double* from, Offset count) const {
    const DeviceGuard guard(device_);
    call("cudaMemcpyAsync(to host)", [&] {
      return cudaMemcpyAsync(to, from, static_cast<std::size_t>(count) * sizeof(double), cudaMemcpyDeviceToHost,
                             stream());
    });
    call("cudaStreamSynchronize", [&] { return cudaStreamSynchronize(stream()); });
  }
  void wait() {
    call("cudaStreamSynchronize", [&] { return cudaStreamSynchronize(stream()); });
    pending_ = false;
  }
  [[nodiscard]] cudaStream_t stream() const { return static_cast<cudaStream_t>(executor_.stream()); }
  [[nodiscard]] DevicePattern pattern() const {
    return {col_ptr_.data(), row_ind_.data(), row_ptr_.data(), row_col_.data(), row_source_.data(), given(), n_,
            general_};
  }

  CudaExecutor<T>& executor_;
  int device_;
  DeviceBudget budget_;
  ConstructionGuard guard_;
  Index n_;
  Offset nonzeros_;
  bool general_, scales_;
  PinnedArray<ResidualEnd> ends_;
  PinnedArray<int> aborted_;
  HostLink link_;
  DeviceArray<Offset> col_ptr_, row_ptr_, diagonal_;
  DeviceArray<Index> row_ind_, row_col_, order_, row_of_col_;
  DeviceArray<std::uint32_t> row_source_;
  DeviceArray<double> row_scale_, col_scale_;
  DeviceArray<double> copy_;     // values as they were given; empty: the executor has them
  DeviceArray<double> largest_;  // of the blocks of the scaling kernel
  // Maxima; when right-hand sides were gathered, when residuals began; ticket.
  DeviceArray<unsigned long long> residual_control_;
  unsigned residual_blocks_[2] = {};  // for one right-hand side, for several
  std::unique_ptr<double, Unpin> pinned_values_;
  DeviceArray<double> slots_[DeviceEquations<T>::kSlots];
  bool pending_ = false;     // work on vectors is enqueued
  bool unreported_ = false;  // a substitution among it
  double substitution_seconds_ = 0;
};

}  // namespace

template <class T>
std::unique_ptr<DeviceEquations<T>> make_device_equations(const EquationArrays& arrays, CudaExecutor<T>& executor,
                                                          int device, Offset memory_bytes) {
  return std::make_unique<Equations<T>>(arrays, executor, device, memory_bytes);
}

template std::unique_ptr<DeviceEquations<double>> make_device_equations(const EquationArrays&, CudaExecutor<double>&,
                                                                        int, Offset);
template std::unique_ptr<DeviceEquations<float>> make_device_equations(const EquationArrays&, CudaExecutor<float>&, int,
                                                                       Offset);

}  // namespace espalier::device::cuda
