#include <algorithm>
#include <limits>
#include <memory>
#include <vector>

#include "device/cuda/executor/tall_space.hpp"
#include "device/cuda/kernels/tall_kernels.cuh"
#include "device/cuda/runtime/device_guard.hpp"
#include "device/cuda/runtime/device_memory.hpp"

namespace espalier::device::cuda {

namespace {

constexpr Offset kChunk = Offset{1} << 16;  // rows that combine() makes at a time

unsigned blocks_of(Offset count, Offset each) { return static_cast<unsigned>((count + each - 1) / each); }

class TallSpaceOnGpu final : public TallSpace {
 public:
  TallSpaceOnGpu(Index rows, int device, Offset memory_bytes)
      : n_(rows), device_(device), budget_(memory_bytes > 0 ? memory_bytes : std::numeric_limits<Offset>::max()) {
    const DeviceGuard guard(device_);
    stream_ = std::make_unique<Stream>();
  }
  ~TallSpaceOnGpu() override {
    if (stream_) (void)cudaStreamSynchronize(stream());
  }

  [[nodiscard]] Index rows() const override { return static_cast<Index>(n_); }
  double* block(Index slot, Index columns) override {
    const DeviceGuard guard(device_);
    if (blocks_.size() <= static_cast<std::size_t>(slot)) blocks_.resize(static_cast<std::size_t>(slot) + 1);
    return grown(blocks_[static_cast<std::size_t>(slot)], n_ * columns);
  }
  Index add_matrix(std::span<const Offset> first, std::span<const Index> column,
                   std::span<const double> value) override {
    const DeviceGuard guard(device_);
    Matrix m{sent(first), sent(column), sent(value)};
    stream_->wait();
    matrices_.push_back(std::move(m));
    return static_cast<Index>(matrices_.size()) - 1;
  }
  [[nodiscard]] void* queue() const override { return stream(); }

  void send(double* to, const double* from, Index columns) override {
    move(to, from, n_ * columns, cudaMemcpyHostToDevice);
    stream_->wait();
  }
  void fetch(double* to, const double* from, Index columns) override {
    move(to, from, n_ * columns, cudaMemcpyDeviceToHost);
    stream_->wait();
  }
  void copy(const double* from, double* to, Index columns) override {
    for (Index j = 0; j < columns; ++j) move(to + j * n_, from + j * n_, n_, cudaMemcpyDeviceToDevice);
  }

  void multiply(Index matrix, const double* x, double* y, Index columns) override {
    const DeviceGuard guard(device_);
    const Matrix& a = matrices_.at(static_cast<std::size_t>(matrix));
    double* packed = grown(packed_, n_ * kTallColumns);
    for (Index c = 0; c < columns; c += kTallColumns) {
      const int b = std::min<Index>(kTallColumns, columns - c);
      pack_columns_kernel<<<blocks_of(n_ * kTallColumns, kTallThreads), kTallThreads, 0, stream()>>>(n_, x + c * n_, b,
                                                                                                     packed);
      sparse_times_kernel<<<blocks_of(n_ * 32, kTallThreads), kTallThreads, 0, stream()>>>(
          n_, a.first.data(), a.column.data(), a.value.data(), packed, b, y + c * n_);
      launched("the product of a sparse matrix");
    }
  }

  void gram(const double* v, Index p, const double* w, Index b, double* out) override {
    const DeviceGuard guard(device_);
    const Offset ranges = blocks_of(n_, kTallRows);
    const Index size = p * kTallColumns;
    if (size == 0 || b == 0) return;
    double* parts = grown(parts_, ranges * size);
    double* sums = grown(sums_, size);
    std::vector<double> host(static_cast<std::size_t>(size));
    for (Index c = 0; c < b; c += kTallColumns) {
      const int now = std::min<Index>(kTallColumns, b - c);
      gram_kernel<<<static_cast<unsigned>(ranges), kTallThreads, 0, stream()>>>(n_, v, p, w + c * n_, now, parts);
      add(parts, ranges, size, sums, host);
      for (Index j = 0; j < now; ++j)
        for (Index i = 0; i < p; ++i)
          out[static_cast<Offset>(c + j) * p + i] = host[static_cast<std::size_t>(i * kTallColumns + j)];
    }
  }
  void weighted_squares(const double* d, const double* w, Index b, double* out) override {
    const DeviceGuard guard(device_);
    const Offset ranges = blocks_of(n_, kTallRows);
    double* parts = grown(parts_, ranges * kTallColumns);
    double* sums = grown(sums_, kTallColumns);
    std::vector<double> host(kTallColumns);
    for (Index c = 0; c < b; c += kTallColumns) {
      const int now = std::min<Index>(kTallColumns, b - c);
      squares_kernel<<<static_cast<unsigned>(ranges), kTallThreads, 0, stream()>>>(n_, d, w + c * n_, now, parts);
      add(parts, ranges, kTallColumns, sums, host);
      std::copy_n(host.begin(), now, out + c);
    }
  }
  void subtract(const double* v, Index p, const double* h, Index b, double* w) override {
    const DeviceGuard guard(device_);
    for (Index c = 0; c < b && p > 0; c += kTallColumns)
      times_small<true>(n_, v, p, h + static_cast<Offset>(c) * p, std::min<Index>(kTallColumns, b - c), n_, w + c * n_);
  }
  // By chunks of rows, which go back when all their columns are made.
  void combine(const double* v, Index p, const double* s, Index k, double* out) override {
    const DeviceGuard guard(device_);
    if (k == 0) return;
    double* made = grown(made_, kChunk * k);
    for (Offset row = 0; row < n_; row += kChunk) {
      const Offset count = std::min(kChunk, n_ - row);
      for (Index c = 0; c < k; c += kTallColumns)
        times_small<false>(count, v + row, p, s + static_cast<Offset>(c) * p, std::min<Index>(kTallColumns, k - c),
                           kChunk, made + c * kChunk);
      call("cudaMemcpy2DAsync", [&] {
        return cudaMemcpy2DAsync(out + row, bytes(n_), made, bytes(kChunk), bytes(count), static_cast<std::size_t>(k),
                                 cudaMemcpyDeviceToDevice, stream());
      });
    }
  }

 private:
  struct Matrix {
    DeviceArray<Offset> first;
    DeviceArray<Index> column;
    DeviceArray<double> value;
  };

  static std::size_t bytes(Offset doubles) { return static_cast<std::size_t>(doubles) * sizeof(double); }
  [[nodiscard]] cudaStream_t stream() const { return stream_->get(); }
  static void launched(const char* what) {
    call(what, [&] { return cudaGetLastError(); });
  }

  // What waits in the stream may use the old one.
  double* grown(DeviceArray<double>& array, Offset size) {
    if (array.size() >= size) return array.data();
    stream_->wait();
    budget_.give_back(array.bytes());
    array = DeviceArray<double>();
    array = DeviceArray<double>(size, budget_, budget_.held() + size * static_cast<Offset>(sizeof(double)));
    return array.data();
  }
  template <class U>
  DeviceArray<U> sent(std::span<const U> from) {
    DeviceArray<U> to(static_cast<Offset>(from.size()), budget_,
                      budget_.held() + static_cast<Offset>(from.size_bytes()));
    call("cudaMemcpyAsync(matrix)",
         [&] { return cudaMemcpyAsync(to.data(), from.data(), from.size_bytes(), cudaMemcpyHostToDevice, stream()); });
    return to;
  }
  void move(double* to, const double* from, Offset count, cudaMemcpyKind kind) {
    const DeviceGuard guard(device_);
    call("cudaMemcpyAsync(block)", [&] { return cudaMemcpyAsync(to, from, bytes(count), kind, stream()); });
  }
  void add(const double* parts, Offset ranges, Index size, double* sums, std::vector<double>& host) {
    add_parts_kernel<<<blocks_of(static_cast<Offset>(size) * 32, kTallThreads), kTallThreads, 0, stream()>>>(
        parts, ranges, size, sums);
    launched("the sums of a block");
    call("cudaMemcpyAsync(sums)",
         [&] { return cudaMemcpyAsync(host.data(), sums, bytes(size), cudaMemcpyDeviceToHost, stream()); });
    stream_->wait();
  }
  // One small matrix follows another through the same memory: in the order of the stream.
  template <bool kSubtract>
  void times_small(Offset rows, const double* v, Index p, const double* small, Index b, Offset out_stride,
                   double* out) {
    std::vector<double> turned(static_cast<std::size_t>(p) * kTallColumns, 0.0);
    for (Index j = 0; j < b; ++j)
      for (Index i = 0; i < p; ++i)
        turned[static_cast<std::size_t>(i * kTallColumns + j)] = small[static_cast<Offset>(j) * p + i];
    double* on_device = grown(small_, static_cast<Offset>(turned.size()));
    call("cudaMemcpyAsync(small matrix)", [&] {  // pageable: it is read before the call returns
      return cudaMemcpyAsync(on_device, turned.data(), bytes(static_cast<Offset>(turned.size())),
                             cudaMemcpyHostToDevice, stream());
    });
    const std::size_t shared = bytes(static_cast<Offset>(turned.size()));
    if (shared > kUsualShared)
      call("cudaFuncSetAttribute", [&] {
        return cudaFuncSetAttribute(times_small_kernel<kSubtract>, cudaFuncAttributeMaxDynamicSharedMemorySize,
                                    static_cast<int>(shared));
      });
    times_small_kernel<kSubtract><<<blocks_of(rows, kTallThreads), kTallThreads, shared, stream()>>>(
        rows, n_, v, p, on_device, b, out_stride, out);
    launched("the product with a small matrix");
  }

  static constexpr std::size_t kUsualShared = 48 << 10;

  Offset n_;
  int device_;
  DeviceBudget budget_;
  std::unique_ptr<Stream> stream_;
  std::vector<DeviceArray<double>> blocks_;
  std::vector<Matrix> matrices_;
  DeviceArray<double> packed_, parts_, sums_, small_, made_;
};

}  // namespace

std::unique_ptr<TallSpace> make_tall_space(Index rows, int device, Offset memory_bytes) {
  return std::make_unique<TallSpaceOnGpu>(rows, device, memory_bytes);
}

}  // namespace espalier::device::cuda
