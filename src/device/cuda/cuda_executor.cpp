#include "device/cuda/cuda_executor.hpp"

#if ESPALIER_WITH_CUDA

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <span>
#include <tuple>

#include "device/cuda/device_memory.hpp"
#include "device/cuda/factor_kernel.cuh"
#include "device/cuda/factor_parameters.hpp"
#include "device/cuda/solve_kernel.cuh"

namespace espalier::device::cuda {

namespace {

class DeviceGuard {
 public:
  explicit DeviceGuard(int device) {
    check(cudaGetDevice(&before_), "cudaGetDevice");
    check(cudaSetDevice(device), "cudaSetDevice");
  }
  DeviceGuard(const DeviceGuard&) = delete;
  DeviceGuard& operator=(const DeviceGuard&) = delete;
  ~DeviceGuard() { (void)cudaSetDevice(before_); }

 private:
  int before_ = 0;
};

Offset free_bytes(const CudaOptions& options) {
  std::size_t free = 0, total = 0;
  check(cudaMemGetInfo(&free, &total), "cudaMemGetInfo");
  const auto all = static_cast<Offset>(free);
  return options.memory_bytes > 0 ? std::min(options.memory_bytes, all) : all;
}

template <class T>
class ExecutorOnDevice final : public CudaExecutor<T> {
 public:
  ExecutorOnDevice(const analysis::Plan& plan, Kind kind, const PivotRule& rule, const CudaOptions& options)
      : plan_(plan),
        kind_(kind),
        options_(options),
        tables_(make_device_plan(plan, kind)),
        budget_(free_bytes(options)) {
    name_ = describe_device();
    take_memory();
    choose_shapes();
    fill_states();
    set_pivot_rule(rule);
    factor_graph_ = Graph::record(stream_.get(), [&] { enqueue_factorization(); });
  }

  void set_pivot_rule(const PivotRule& rule) override {
    const T limits[2] = {static_cast<T>(rule.tiny), static_cast<T>(1 / rule.threshold)};
    if (limits_known_ && limits[0] == limits_host_[0] && limits[1] == limits_host_[1]) return;
    const DeviceGuard guard(options_.device);
    limits_host_[0] = limits[0];
    limits_host_[1] = limits[1];
    limits_known_ = true;
    copy_in(limits_.data(), limits_host_, 2);
  }

  FactorOutcome factorize(std::span<const T> values) override {
    const DeviceGuard guard(options_.device);
    copy_in(values_.data(), values.data(), static_cast<Offset>(values.size()));
    return run_factorization();
  }

  FactorOutcome factorize_device(const T* values) override {
    const DeviceGuard guard(options_.device);
    check(cudaMemcpyAsync(values_.data(), values, static_cast<std::size_t>(values_.bytes()), cudaMemcpyDeviceToDevice,
                          stream_.get()),
          "cudaMemcpyAsync(values)");
    return run_factorization();
  }

  double refactorize_again() override {
    const DeviceGuard guard(options_.device);
    return stream_.timed([&] { factor_graph_.launch(stream_.get()); });
  }

  void solve(T* x, Index columns, bool transpose) override {
    const DeviceGuard guard(options_.device);
    const Offset count = static_cast<Offset>(plan_.tree.n) * columns;
    T* rhs = device_rhs(columns);
    copy_in(rhs, x, count);
    solve_device(rhs, columns, transpose);
    from_device(x, rhs, count);
  }

  double solve_device(T* x, Index columns, bool transpose) override {
    const DeviceGuard guard(options_.device);
    take_solve_memory(columns > 1 ? kManyColumns : 1);
    const SolveKey key{x, columns, transpose};
    auto found = solve_graphs_.find(key);
    if (found == solve_graphs_.end()) {
      constexpr std::size_t kMostGraphs = 16;
      if (solve_graphs_.size() >= kMostGraphs) solve_graphs_.clear();
      found =
          solve_graphs_.emplace(key, Graph::record(stream_.get(), [&] { enqueue_solve(x, columns, transpose); })).first;
    }
    const double seconds = stream_.timed([&] { found->second.launch(stream_.get()); });
    int control[2] = {};
    from_device_int(control, solve_control_.data(), 2);
    if (control[1] != 0) throw stalled("solve");
    return seconds;
  }

  T* device_rhs(Index columns) override {
    const Offset count = static_cast<Offset>(plan_.tree.n) * columns;
    if (rhs_.size() < count) {
      const DeviceGuard guard(options_.device);
      solve_graphs_.clear();
      rhs_ = DeviceArray<T>();
      rhs_ = DeviceArray<T>(count, budget_, budget_.held() + count * static_cast<Offset>(sizeof(T)));
    }
    return rhs_.data();
  }

  void to_device(T* to, const T* from, Offset count) override {
    const DeviceGuard guard(options_.device);
    copy_in(to, from, count);
  }
  void from_device(T* to, const T* from, Offset count) override {
    const DeviceGuard guard(options_.device);
    check(cudaMemcpyAsync(to, from, static_cast<std::size_t>(count) * sizeof(T), cudaMemcpyDeviceToHost, stream_.get()),
          "cudaMemcpyAsync(to host)");
    stream_.wait();
  }

  [[nodiscard]] std::string name() const override { return name_; }
  [[nodiscard]] Offset peak_bytes() const override { return budget_.held(); }

 private:
  struct SolveKey {
    T* x;
    Index columns;
    bool transpose;
    bool operator<(const SolveKey& o) const {
      return std::tie(x, columns, transpose) < std::tie(o.x, o.columns, o.transpose);
    }
  };

  [[nodiscard]] std::string describe_device() const {
    cudaDeviceProp p{};
    check(cudaGetDeviceProperties(&p, options_.device), "cudaGetDeviceProperties");
    return p.name;
  }

  [[nodiscard]] Error stalled(const char* what) const {
    return {StatusCode::device_error, std::string("the ") + what + " on " + name_ + " was given up after waiting " +
                                          std::to_string(options_.patience_seconds) + " s for one of its own blocks"};
  }

  template <class U>
  void copy_in(U* to, const U* from, Offset count) {
    if (count == 0) return;
    check(cudaMemcpyAsync(to, from, static_cast<std::size_t>(count) * sizeof(U), cudaMemcpyHostToDevice, stream_.get()),
          "cudaMemcpyAsync(to device)");
    stream_.wait();
  }
  void from_device_int(int* to, const int* from, int count) {
    check(
        cudaMemcpyAsync(to, from, static_cast<std::size_t>(count) * sizeof(int), cudaMemcpyDeviceToHost, stream_.get()),
        "cudaMemcpyAsync(control)");
    stream_.wait();
  }

  // An array of the plan, copied once.
  template <class U, class V, class A>
  void upload(DeviceArray<U>& to, const std::vector<V, A>& from) {
    static_assert(sizeof(U) == sizeof(V));
    to = DeviceArray<U>(static_cast<Offset>(from.size()), budget_, needed_);
    copy_in(to.data(), reinterpret_cast<const U*>(from.data()), to.size());
  }

  void take_memory() {
    const Offset n = plan_.tree.n;
    Offset values = 0;
    for (const auto& e : plan_.entries) values = std::max(values, e.source() + 1);
    const Offset parts = kind_ == Kind::lu ? 2 : 1;
    const auto bytes = [](const auto& v) { return static_cast<Offset>(v.size() * sizeof(v[0])); };
    needed_ = (std::accumulate(tables_.regions.begin(), tables_.regions.end(), Offset{0}) + values + 3 * n) *
                  static_cast<Offset>(sizeof(T)) +
              bytes(tables_.fronts) + bytes(tables_.links) + bytes(tables_.bounds) + bytes(tables_.waits) +
              bytes(tables_.tasks) + bytes(tables_.up) + bytes(tables_.down) + bytes(plan_.relative) +
              bytes(plan_.tree.rows) + bytes(plan_.entry_ptr) + bytes(plan_.entries) + parts * tables_.flags * 4 +
              plan_.fronts() * 4 + 2 * n +
              3 * (2 * n + static_cast<Offset>(plan_.relative.size())) * static_cast<Offset>(sizeof(T));
    std::vector<T*> bases;
    for (const Offset size : tables_.regions) {
      arenas_.emplace_back(size, budget_, needed_);
      bases.push_back(arenas_.back().data());
    }
    upload(base_, bases);
    values_ = DeviceArray<T>(values, budget_, needed_);
    pivot_ = DeviceArray<T>(n, budget_, needed_);
    if (kind_ == Kind::ldlt) {
      inverse_d_ = DeviceArray<T>(n, budget_, needed_);
      inverse_e_ = DeviceArray<T>(n, budget_, needed_);
    }
    marks_ = DeviceArray<unsigned char>(2 * n, budget_, needed_);
    limits_ = DeviceArray<T>(2, budget_, needed_);
    control_ = DeviceArray<int>(kFlagsAt + parts * tables_.flags + plan_.fronts(), budget_, needed_);
    solve_control_ = DeviceArray<int>(8, budget_, needed_);
    upload(fronts_, tables_.fronts);
    upload(links_, tables_.links);
    upload(bounds_, tables_.bounds);
    upload(waits_, tables_.waits);
    upload(tasks_, tables_.tasks);
    upload(up_, tables_.up);
    upload(down_, tables_.down);
    upload(relative_, plan_.relative);
    upload(rows_, plan_.tree.rows);
    upload(entry_ptr_, plan_.entry_ptr);
    upload(entries_, plan_.entries);
    take_solve_memory(1);
  }

  // Buffers of one pass of a solve with `columns` right-hand sides.
  void take_solve_memory(Index columns) {
    const Offset rows = 2 * static_cast<Offset>(plan_.tree.n) + static_cast<Offset>(plan_.relative.size());
    if (vectors_.size() >= rows * columns) return;
    solve_graphs_.clear();
    vectors_ = DeviceArray<T>();
    vectors_ = DeviceArray<T>(rows * columns, budget_, needed_);
  }

  void choose_shapes() {
    std::size_t whole = 0;
    for (const Front& f : tables_.fronts)
      if (f.whole != 0) {
        const auto size = static_cast<std::size_t>(f.total_pad), p = static_cast<std::size_t>(f.pivot_pad);
        whole = std::max(whole, size * (size + 4) + p * (p + 4));
      }
    for (const bool wide : {false, true})
      check(dispatch([&](auto kernel) { return decltype(kernel)::shape_for(wide, whole, shape_[wide ? 1 : 0]); }),
            "launch shape of the factorization kernel");
    for (const bool many : {false, true})
      check(SolveKernel<T>::resident(many, solve_shape_[many ? 1 : 0]), "launch shape of the solve kernel");
  }

  template <class Use>
  cudaError_t dispatch(Use&& use) const {
    switch (kind_) {
      case Kind::llt:
        return use(FactorKernel<T, Kind::llt>{});
      case Kind::ldlt:
        return use(FactorKernel<T, Kind::ldlt>{});
      default:
        return use(FactorKernel<T, Kind::lu>{});
    }
  }

  void fill_states() {
    const Offset n = plan_.tree.n;
    const Offset parts = kind_ == Kind::lu ? 2 : 1;
    const auto patience = static_cast<std::uint64_t>(options_.patience_seconds * 1e9);
    state_ = {fronts_.data(),
              tasks_.data(),
              links_.data(),
              bounds_.data(),
              waits_.data(),
              relative_.data(),
              entry_ptr_.data(),
              entries_.data(),
              values_.data(),
              base_.data(),
              inverse_d_.data(),
              inverse_e_.data(),
              pivot_.data(),
              marks_.data(),
              marks_.data() + n,
              control_.data(),
              control_.data() + kFlagsAt + parts * tables_.flags,
              limits_.data(),
              patience,
              tables_.flags};
  }

  void enqueue_factorization() {
    const cudaStream_t stream = stream_.get();
    check(cudaMemsetAsync(control_.data(), 0, static_cast<std::size_t>(control_.bytes()), stream), "cudaMemsetAsync");
    if (kind_ != Kind::llt)
      check(cudaMemsetAsync(marks_.data(), 0, static_cast<std::size_t>(marks_.bytes()), stream), "cudaMemsetAsync");
    const auto tasks = static_cast<int>(tables_.tasks.size()), narrow = static_cast<int>(tables_.narrow_tasks);
    const auto launch = [&](bool wide, int first, int end) {
      if (first == end) return;
      check(dispatch([&](auto kernel) {
              return decltype(kernel)::launch(wide, shape_[wide ? 1 : 0], state_, first, end, plan_.tree.n, stream);
            }),
            "launch of the factorization kernel");
    };
    launch(false, 0, narrow);
    launch(true, narrow, tasks);
  }

  void enqueue_solve(T* x, Index columns, bool transpose) {
    const cudaStream_t stream = stream_.get();
    const bool many = columns > 1, lu = kind_ == Kind::lu;
    const Index at_once = many ? kManyColumns : 1;
    const Offset n = plan_.tree.n, below = static_cast<Offset>(plan_.relative.size());
    const SolveState<T> s{fronts_.data(),
                          up_.data(),
                          down_.data(),
                          static_cast<int>(tables_.up.size()),
                          static_cast<int>(tables_.down.size()),
                          static_cast<int>(tables_.small_up),
                          static_cast<int>(tables_.small_down),
                          links_.data(),
                          bounds_.data(),
                          relative_.data(),
                          rows_.data(),
                          base_.data(),
                          inverse_d_.data(),
                          inverse_e_.data(),
                          lu && transpose,
                          lu && !transpose,
                          x,
                          columns,
                          vectors_.data(),
                          vectors_.data() + 2 * n * at_once,
                          vectors_.data() + n * at_once,
                          solve_control_.data(),
                          static_cast<std::uint64_t>(options_.patience_seconds * 1e9)};
    for (Index c = 0; c < columns; c += at_once) {
      check(cudaMemsetAsync(solve_control_.data(), 0, static_cast<std::size_t>(solve_control_.bytes()), stream),
            "cudaMemsetAsync");
      check(cudaMemsetAsync(vectors_.data(), 0xff, static_cast<std::size_t>((2 * n + below) * at_once) * sizeof(T),
                            stream),
            "cudaMemsetAsync");
      check(SolveKernel<T>::launch(many, solve_shape_[many ? 1 : 0], s, c, stream), "launch of the solve kernel");
    }
  }

  FactorOutcome run_factorization() {
    FactorOutcome out;
    out.seconds = stream_.timed([&] { factor_graph_.launch(stream_.get()); });
    out.busy_seconds = out.seconds;
    int control[kFlagsAt] = {};
    from_device_int(control, control_.data(), kFlagsAt);
    if (control[kAborted] != 0) throw stalled("factorization");
    const Index n = plan_.tree.n;
    if (control[kNotPositive] > 0) out.not_positive = n - control[kNotPositive];
    out.negative = control[kNegative];
    out.two_by_two = control[kTwoByTwo];
    if (control[kReplaced] > 0) out.replaced = marked(0);
    if (control[kFailed] > 0) out.failed = marked(n);
    if (out.not_positive < 0) add_determinant(out);
    return out;
  }

  std::vector<Index> marked(Offset from) {
    const Index n = plan_.tree.n;
    std::vector<unsigned char> marks(static_cast<std::size_t>(n));
    check(cudaMemcpy(marks.data(), marks_.data() + from, marks.size(), cudaMemcpyDeviceToHost), "cudaMemcpy(marks)");
    std::vector<Index> list;
    for (Index k = 0; k < n; ++k)
      if (marks[static_cast<std::size_t>(k)] != 0) list.push_back(k);
    return list;
  }

  void add_determinant(FactorOutcome& out) {
    pivots_host_.resize(static_cast<std::size_t>(plan_.tree.n));
    check(cudaMemcpy(pivots_host_.data(), pivot_.data(), pivots_host_.size() * sizeof(T), cudaMemcpyDeviceToHost),
          "cudaMemcpy(pivots)");
    for (const T p : pivots_host_) {
      if (p < T(0)) out.determinant_sign = -out.determinant_sign;
      out.determinant_log += std::log(std::abs(static_cast<double>(p)));
    }
  }

  const analysis::Plan& plan_;
  Kind kind_;
  CudaOptions options_;
  DevicePlan tables_;
  DeviceBudget budget_;
  Offset needed_ = 0;
  std::string name_;
  Stream stream_;
  std::vector<DeviceArray<T>> arenas_;  // regions
  DeviceArray<T*> base_;
  DeviceArray<T> values_, pivot_, inverse_d_, inverse_e_, limits_, vectors_, rhs_;
  DeviceArray<unsigned char> marks_;
  DeviceArray<int> control_, solve_control_;
  DeviceArray<Front> fronts_;
  DeviceArray<Link> links_;
  DeviceArray<std::int32_t> bounds_, waits_, relative_, rows_;
  DeviceArray<FactorTask> tasks_;
  DeviceArray<SolveTask> up_, down_;
  DeviceArray<std::int64_t> entry_ptr_;
  DeviceArray<std::uint64_t> entries_;
  LaunchShape shape_[2];
  SolveShape solve_shape_[2];
  FactorState<T> state_{};
  T limits_host_[2] = {};
  bool limits_known_ = false;
  Graph factor_graph_;
  std::map<SolveKey, Graph> solve_graphs_;
  std::vector<T> pivots_host_;
};

}  // namespace

Availability available_devices() {
  Availability a;
  int count = 0;
  const auto e = cudaGetDeviceCount(&count);
  if (e != cudaSuccess) {
    (void)cudaGetLastError();
    a.reason = std::string("no CUDA device: ") + cudaGetErrorString(e);
    return a;
  }
  int driver = 0;
  (void)cudaDriverGetVersion(&driver);
  for (int d = 0; d < count; ++d) {
    cudaDeviceProp p{};
    if (cudaGetDeviceProperties(&p, d) != cudaSuccess) continue;
    DeviceInfo info;
    info.name = p.name;
    info.driver = std::to_string(driver / 1000) + "." + std::to_string(driver % 1000 / 10);
    info.compute_major = p.major;
    info.compute_minor = p.minor;
    info.multiprocessors = p.multiProcessorCount;
    info.total_bytes = static_cast<Offset>(p.totalGlobalMem);
    a.devices.push_back(info);
  }
  if (a.devices.empty()) a.reason = "no CUDA device";
  return a;
}

template <class T>
std::unique_ptr<CudaExecutor<T>> make_cuda_executor(const analysis::Plan& plan, Kind kind, const PivotRule& rule,
                                                    const CudaOptions& options) {
  const DeviceGuard guard(options.device);
  return std::make_unique<ExecutorOnDevice<T>>(plan, kind, rule, options);
}

template std::unique_ptr<CudaExecutor<double>> make_cuda_executor(const analysis::Plan&, Kind, const PivotRule&,
                                                                  const CudaOptions&);
template std::unique_ptr<CudaExecutor<float>> make_cuda_executor(const analysis::Plan&, Kind, const PivotRule&,
                                                                 const CudaOptions&);

}  // namespace espalier::device::cuda

#endif
