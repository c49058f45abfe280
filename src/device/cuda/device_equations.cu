#include <algorithm>
#include <limits>
#include <type_traits>
#include <vector>

#include "device/cuda/device_equations.hpp"
#include "device/cuda/device_memory.hpp"
#include "device/cuda/device_side.hpp"
#include "device/cuda/equation_kernels.cuh"

namespace espalier::device::cuda {

namespace {

constexpr Index kMostColumns = 64;  // right-hand sides of one launch
constexpr Index kColumnGroup = 8;   // several right-hand sides come in multiples of it

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

template <class T>
class Equations final : public DeviceEquations<T> {
 public:
  using typename DeviceEquations<T>::Values;
  using typename DeviceEquations<T>::Column;

  Equations(const EquationArrays& a, CudaExecutor<T>& executor, int device, Offset memory_bytes)
      : executor_(executor),
        device_(device),
        budget_(budget_for(device, memory_bytes)),
        guard_(device),
        n_(a.pattern.cols),
        nonzeros_(a.pattern.nonzeros()),
        general_(a.pattern.storage == Storage::general),
        // FP64 without scaling factors the values as they are.
        scales_(sizeof(T) != sizeof(double) || !a.row_scale.empty() || !a.col_scale.empty()),
        pinned_(kFound + 3 * kMostColumns) {
    if (nonzeros_ > std::numeric_limits<std::uint32_t>::max())
      throw Error(StatusCode::out_of_memory, "more than 2^32 entries are not indexed on a device");
    upload(col_ptr_, a.pattern.col_ptr);
    upload(row_ind_, a.pattern.row_ind);
    upload(row_ptr_, a.row_ptr);
    upload(row_col_, a.row_col);
    const std::vector<std::uint32_t> source(a.row_source.begin(), a.row_source.end());
    upload(row_source_, std::span<const std::uint32_t>(source));
    upload(order_, a.order);
    upload(row_of_col_, a.row_of_col);
    upload(row_scale_, a.row_scale);
    upload(col_scale_, a.col_scale);
    upload(diagonal_, a.diagonal);
    values_ = take<double>(nonzeros_);
    if (scales_) scaled_ = take<T>(nonzeros_);
    found_ = take<double>(kFound);
    pointers_ = take<double*>(3 * kMostColumns);
    guard_.leave();
  }

  Values take_values(const double* values) override {
    const DeviceGuard guard(device_);
    const cudaStream_t stream = stream_.get();
    call("cudaMemcpyAsync(values)", [&] {
      return cudaMemcpyAsync(values_.data(), values, static_cast<std::size_t>(values_.bytes()), cudaMemcpyDefault,
                             stream);
    });
    clear_found();
    const unsigned blocks = blocks_for(static_cast<Offset>(n_) * kLanes);
    if constexpr (std::is_same_v<T, double>) {
      scale_kernel<T><<<blocks, kEquationThreads, 0, stream>>>(
          pattern(), row_scale_.data(), col_scale_.data(), scales_ ? scaled_.data() : values_.data(), found_.data());
    } else {
      scale_kernel<T><<<blocks, kEquationThreads, 0, stream>>>(pattern(), row_scale_.data(), col_scale_.data(),
                                                               scaled_.data(), found_.data());
    }
    norm_kernel<<<blocks, kEquationThreads, 0, stream>>>(pattern(), false, found_.data() + 1);
    if (general_) norm_kernel<<<blocks, kEquationThreads, 0, stream>>>(pattern(), true, found_.data() + 2);
    call("launch of the scaling kernels", [&] { return cudaGetLastError(); });
    const double* found = fetch_found(3);
    Values v;
    v.finite = found[0] <= std::numeric_limits<double>::max();
    v.largest = found[0];
    v.norm_inf = found[1];
    v.norm_one = general_ ? found[2] : found[1];
    return v;
  }

  const T* scaled_values() const override {
    if constexpr (std::is_same_v<T, double>)
      if (!scales_) return values_.data();
    return scaled_.data();
  }

  void read_values(std::span<double> to) const override {
    const DeviceGuard guard(device_);
    call("cudaMemcpy(values)",
         [&] { return cudaMemcpy(to.data(), values_.data(), to.size_bytes(), cudaMemcpyDeviceToHost); });
  }

  void read_diagonal(std::span<double> to) override {
    const DeviceGuard guard(device_);
    double* list = vectors(0, 1);
    diagonal_kernel<T>
        <<<blocks_for(n_), kEquationThreads, 0, stream_.get()>>>(n_, diagonal_.data(), scaled_values(), list);
    call("launch of the diagonal kernel", [&] { return cudaGetLastError(); });
    call("cudaMemcpyAsync(diagonal)",
         [&] { return cudaMemcpyAsync(to.data(), list, to.size_bytes(), cudaMemcpyDeviceToHost, stream_.get()); });
    stream_.wait();
  }

  void substitute(const double* b, double* x, Index columns, bool transpose) override {
    const DeviceGuard guard(device_);
    for (Index first = 0; first < columns; first += kMostColumns) {
      const Index now = std::min(kMostColumns, columns - first);
      const Index width = now == 1 ? 1 : (now + kColumnGroup - 1) / kColumnGroup * kColumnGroup;
      const Passage p{order_.data(), row_of_col_.data(), row_scale_.data(), col_scale_.data(), n_, now,
                      width,         transpose};
      T* rhs = executor_.device_rhs(width);
      const unsigned blocks = blocks_for(static_cast<Offset>(n_) * width);
      const Offset at = static_cast<Offset>(first) * n_;
      gather_kernel<T><<<blocks, kEquationThreads, 0, stream_.get()>>>(p, b + at, rhs);
      call("launch of the gather kernel", [&] { return cudaGetLastError(); });
      stream_.wait();
      executor_.solve_device(rhs, width, transpose);
      scatter_kernel<T><<<blocks, kEquationThreads, 0, stream_.get()>>>(p, rhs, x + at);
      call("launch of the scatter kernel", [&] { return cudaGetLastError(); });
    }
    stream_.wait();
  }

  void residuals(std::span<const Column> columns, bool transpose, std::span<DeviceResidual> found) override {
    const DeviceGuard guard(device_);
    for (std::size_t first = 0; first < columns.size(); first += kMostColumns) {
      const std::size_t now = std::min<std::size_t>(kMostColumns, columns.size() - first);
      auto* pointers = reinterpret_cast<const double**>(pinned_.data() + kFound);
      for (std::size_t k = 0; k < now; ++k) {
        pointers[k] = columns[first + k].b;
        pointers[kMostColumns + k] = columns[first + k].x;
        pointers[2 * kMostColumns + k] = columns[first + k].r;
      }
      call("cudaMemcpyAsync(columns)", [&] {
        return cudaMemcpyAsync(pointers_.data(), pointers, static_cast<std::size_t>(pointers_.bytes()),
                               cudaMemcpyHostToDevice, stream_.get());
      });
      clear_found();
      const dim3 grid(blocks_for(static_cast<Offset>(n_) * kLanes), static_cast<unsigned>(now));
      residual_kernel<<<grid, kEquationThreads, 0, stream_.get()>>>(
          pattern(), transpose,
          {pointers_.data(), pointers_.data() + kMostColumns, pointers_.data() + 2 * kMostColumns, found_.data()});
      call("launch of the residual kernel", [&] { return cudaGetLastError(); });
      const double* f = fetch_found(4 * now);
      for (std::size_t k = 0; k < now; ++k, f += 4) found[first + k] = {f[0], f[1], f[2], f[3]};
    }
  }

  void copy(const double* from, double* to) override {
    const DeviceGuard guard(device_);
    call("cudaMemcpyAsync(vector)", [&] {
      return cudaMemcpyAsync(to, from, static_cast<std::size_t>(n_) * sizeof(double), cudaMemcpyDefault, stream_.get());
    });
    stream_.wait();
  }

  bool add(const double* from, double* to) override {
    const DeviceGuard guard(device_);
    clear_found();
    add_kernel<<<blocks_for(n_), kEquationThreads, 0, stream_.get()>>>(n_, from, to, found_.data());
    call("launch of the addition kernel", [&] { return cudaGetLastError(); });
    return fetch_found(1)[0] == 0;
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

  void transfer(double* to, const double* from, Offset count) override {
    const DeviceGuard guard(device_);
    call("cudaMemcpyAsync(vectors)", [&] {
      return cudaMemcpyAsync(to, from, static_cast<std::size_t>(count) * sizeof(double), cudaMemcpyDefault,
                             stream_.get());
    });
    stream_.wait();
  }
  // Where pinning is refused, copies are slower, but nothing else changes.
  void pin(std::span<const double> values) override {
    const DeviceGuard guard(device_);
    auto* p = const_cast<double*>(values.data());  // the device only reads
    if (!values.empty() && cudaHostRegister(p, values.size_bytes(), cudaHostRegisterDefault) == cudaSuccess)
      pinned_values_.reset(p);
    (void)cudaGetLastError();
  }
  void wait_for(void* stream) override {
    const DeviceGuard guard(device_);
    call("cudaStreamSynchronize(caller's stream)",
         [&] { return cudaStreamSynchronize(static_cast<cudaStream_t>(stream)); });
  }
  [[nodiscard]] Offset bytes() const override { return budget_.held(); }

 private:
  struct Unpin {
    void operator()(double* p) const { (void)cudaHostUnregister(p); }
  };
  static constexpr Offset kFound = 4 * kMostColumns;

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
    if (!from.empty())
      call("cudaMemcpy(equations)",
           [&] { return cudaMemcpy(to.data(), from.data(), from.size_bytes(), cudaMemcpyHostToDevice); });
  }
  void clear_found() {
    call("cudaMemsetAsync",
         [&] { return cudaMemsetAsync(found_.data(), 0, static_cast<std::size_t>(found_.bytes()), stream_.get()); });
  }
  const double* fetch_found(std::size_t count) {
    call("cudaMemcpyAsync(found)", [&] {
      return cudaMemcpyAsync(pinned_.data(), found_.data(), count * sizeof(double), cudaMemcpyDeviceToHost,
                             stream_.get());
    });
    stream_.wait();
    return pinned_.data();
  }
  [[nodiscard]] DevicePattern pattern() const {
    return {col_ptr_.data(), row_ind_.data(), row_ptr_.data(), row_col_.data(), row_source_.data(), values_.data(), n_,
            general_};
  }

  CudaExecutor<T>& executor_;
  int device_;
  DeviceBudget budget_;
  ConstructionGuard guard_;
  Stream stream_;
  Index n_;
  Offset nonzeros_;
  bool general_, scales_;
  PinnedArray<double> pinned_;  // found numbers, then three lists of pointers
  DeviceArray<Offset> col_ptr_, row_ptr_, diagonal_;
  DeviceArray<Index> row_ind_, row_col_, order_, row_of_col_;
  DeviceArray<std::uint32_t> row_source_;
  DeviceArray<double> row_scale_, col_scale_, values_, found_;
  DeviceArray<T> scaled_;
  DeviceArray<double*> pointers_;
  std::unique_ptr<double, Unpin> pinned_values_;
  DeviceArray<double> slots_[DeviceEquations<T>::kSlots];
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
