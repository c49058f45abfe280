#include "device/cuda/cuda_executor.hpp"

#if ESPALIER_WITH_CUDA

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>
#include <map>
#include <span>
#include <tuple>

#include "device/cuda/device_side.hpp"
#include "device/determinant.hpp"

namespace espalier::device::cuda {

namespace {

double now_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

Offset values_of(const analysis::Plan& plan) {
  Offset values = 0;
  for (const auto& e : plan.entries) values = std::max(values, e.source() + 1);
  return values;
}

Offset largest_stealable(const DevicePlan& tables) {
  Offset most = 0;
  for (auto r = static_cast<std::size_t>(tables.first_stealable); r < tables.regions.size(); ++r)
    most = std::max(most, tables.regions[r]);
  return most;
}

// How many of the sides are on the same GPU as each.
std::vector<int> sharing(const std::vector<int>& devices) {
  std::vector<int> count;
  for (const int d : devices) count.push_back(static_cast<int>(std::count(devices.begin(), devices.end(), d)));
  return count;
}

// Whether every device can reach every other one's memory.
bool peers_open(const std::vector<int>& devices) {
  for (const int a : devices)
    for (const int b : devices) {
      int can = 1;
      if (a != b) check(cudaDeviceCanAccessPeer(&can, a, b), "cudaDeviceCanAccessPeer");
      if (can == 0) return false;
    }
  return true;
}

/// One GPU or several. With one, a graph clears what the kernels need clear, and runs them. With several, a side may
/// write to another one as soon as its kernels run, so everything is cleared after a run, when all have finished, and
/// the next run begins when all are clear.
template <class T>
class ExecutorOnDevices final : public CudaExecutor<T> {
  using Side = DeviceSide<T>;

 public:
  ExecutorOnDevices(const analysis::Plan& plan, Kind kind, const PivotRule& rule, const CudaOptions& options)
      : plan_(plan),
        kind_(kind),
        options_(options),
        devices_(options.devices.empty() ? std::vector<int>{options.device} : options.devices),
        tables_(make_device_plan(plan, kind, !options.staging && peers_open(devices_))),
        context_{
            plan_,          kind_, tables_, options.patience_seconds, largest_stealable(tables_), sharing(devices_),
            values_of(plan)} {
    if (static_cast<Index>(devices_.size()) != plan.assignment.devices)
      throw std::invalid_argument(fmt::format("make_cuda_executor: the plan is for {} devices, not for {}",
                                              plan.assignment.devices, devices_.size()));
    if (devices_.size() > kMostDevices)
      throw std::invalid_argument(fmt::format("make_cuda_executor: at most {} devices", kMostDevices));
    if (several()) open_paths();
    for (std::size_t d = 0; d < devices_.size(); ++d) add_side(static_cast<int>(d));
    for (const auto& side : sides_) at(*side, [&] { side->connect(sides_); });
    moved_ = transferred_elements(plan_, kind_, tables_);
    set_up_tests();
    set_pivot_rule(rule);
    if (several()) {
      clear_factor();
      clear_solve(1);
    }
    for (const auto& side : sides_)
      at(*side,
         [&] { factor_graphs_.push_back(Graph::record(side->stream().get(), [&] { enqueue_factorization(*side); })); });
  }

  void set_pivot_rule(const PivotRule& rule) override {
    smallest_ = rule.smallest;
    const T limits[2] = {static_cast<T>(rule.tiny), static_cast<T>(1 / rule.threshold)};
    if (limits_known_ && limits[0] == limits_[0] && limits[1] == limits_[1]) return;
    limits_[0] = limits[0];
    limits_[1] = limits[1];
    limits_known_ = true;
    for (const auto& side : sides_) at(*side, [&] { side->set_limits(limits_); });
  }

  FactorOutcome factorize(std::span<const T> values) override {
    to_device(first().values(), values.data(), static_cast<Offset>(values.size()));
    return run_factorization();
  }

  FactorOutcome factorize_device(const T* values) override {
    at(first(), [&] {
      check(cudaMemcpyAsync(first().values(), values, static_cast<std::size_t>(first().values_size()) * sizeof(T),
                            cudaMemcpyDefault, first().stream().get()),
            "cudaMemcpyAsync(values)");
      if (several()) first().stream().wait();
    });
    return run_factorization();
  }

  double refactorize_again() override {
    if (several()) return run_on_all([&](Side& s) { launch_factor(s); }, [&] { clear_factor(); });
    const DeviceGuard guard(first().device());
    return first().stream().timed([&] { launch_factor(first()); });
  }

  void solve(T* x, Index columns, bool transpose) override {
    const Offset count = static_cast<Offset>(plan_.tree.n) * columns;
    T* rhs = device_rhs(columns);
    to_device(rhs, x, count);
    solve_device(rhs, columns, transpose);
    from_device(x, rhs, count);
  }

  double solve_device(T* x, Index columns, bool transpose) override {
    take_solve_memory(columns > 1 ? kManyColumns : 1);
    if (several()) return solve_on_all(x, columns, transpose);
    const DeviceGuard guard(first().device());
    const Graph& graph = solve_graph({x, columns, transpose, 0, 0}, first(), [&] {
      for (Index c = 0; c < columns; c += at_once_) {
        first().enqueue_clear_solve(at_once_);
        first().enqueue_solve(sides_, x, x, columns, c, transpose);
      }
    });
    const double seconds = first().stream().timed([&] { graph.launch(first().stream().get()); });
    first().enqueue_counters();
    first().stream().wait();
    if (first().solve_counters()[1] != 0) throw stalled("solve");
    return seconds;
  }

  T* device_rhs(Index columns) override {
    const Offset count = static_cast<Offset>(plan_.tree.n) * columns;
    if (rhs_.size() < count) {
      at(first(), [&] {
        solve_graphs_.clear();
        rhs_ = DeviceArray<T>();
        rhs_ = DeviceArray<T>(count, first().budget(), first().held() + count * static_cast<Offset>(sizeof(T)));
      });
    }
    return rhs_.data();
  }

  void to_device(T* to, const T* from, Offset count) override {
    at(first(), [&] { first().copy_in(to, from, count * static_cast<Offset>(sizeof(T))); });
  }
  void from_device(T* to, const T* from, Offset count) override {
    at(first(), [&] { first().copy_out(to, from, count * static_cast<Offset>(sizeof(T))); });
  }

  [[nodiscard]] std::string name() const override {
    if (!several()) return first().name();
    return fmt::format("{} GPUs, the first {}", sides_.size(), first().name());
  }
  [[nodiscard]] Offset peak_bytes() const override {
    Offset most = 0;
    for (const auto& side : sides_) most = std::max(most, side->held());
    return most;
  }
  [[nodiscard]] std::vector<DeviceWork> device_work() const override { return work_; }

 private:
  struct SolveKey {
    T* x;
    Index columns;
    bool transpose;
    int side;
    Index first_column;
    bool operator<(const SolveKey& o) const {
      return std::tie(x, columns, transpose, side, first_column) <
             std::tie(o.x, o.columns, o.transpose, o.side, o.first_column);
    }
  };

  [[nodiscard]] bool several() const { return devices_.size() > 1; }
  [[nodiscard]] Side& first() const { return *sides_.front(); }
  template <class Use>
  void at(const Side& side, Use&& use) const {
    const DeviceGuard guard(side.device());
    use();
  }

  [[nodiscard]] Error stalled(const char* what) const {
    return {StatusCode::device_error,
            fmt::format("the {} on {} was given up after waiting {} s for one of its own blocks", what, name(),
                        options_.patience_seconds)};
  }

  // ---- construction ------------------------------------------------------------------------------------------------

  // Access from every device to every other; where that is refused, memory on the host that all of them see.
  void open_paths() {
    if (options_.staging || !peers_open(devices_)) {
      take_common();
      return;
    }
    for (const int a : devices_) {
      const DeviceGuard guard(a);
      for (const int b : devices_) {
        if (a == b) continue;
        const auto e = cudaDeviceEnablePeerAccess(b, 0);
        if (e == cudaErrorPeerAccessAlreadyEnabled)
          (void)cudaGetLastError();
        else
          check(e, "cudaDeviceEnablePeerAccess");
      }
    }
  }

  void take_common() {
    Offset places = 0;
    for (const auto space : tables_.place_space) places += space;
    const Offset parts = kind_ == Kind::lu ? 2 : 1;
    common_top_ = PinnedArray<T>(std::max<Offset>(1, tables_.regions[0]));
    common_places_ = PinnedArray<T>(std::max<Offset>(1, places));
    common_pivot_ = PinnedArray<T>(3 * static_cast<Offset>(plan_.tree.n));
    common_updates_ = PinnedArray<T>(std::max<Offset>(1, static_cast<Offset>(plan_.relative.size())) * kManyColumns);
    common_flag_ = PinnedArray<int>(parts * tables_.flags);
    common_ = {common_top_.data(), common_places_.data(), common_pivot_.data(), common_updates_.data(),
               common_flag_.data()};
  }

  void add_side(int self) {
    const int device = devices_[static_cast<std::size_t>(self)];
    const DeviceGuard guard(device);
    try {
      const Side* twin = sides_.empty() || common_.top != nullptr ? nullptr : sides_.front().get();
      const auto& budgets = options_.memory_bytes;
      const Offset budget = budgets.empty() ? 0 : budgets[static_cast<std::size_t>(self)];
      sides_.push_back(std::make_unique<Side>(context_, self, device, budget, common_, twin));
    } catch (const Error& e) {
      if (!several()) throw;
      throw Error(e.status().code, fmt::format("GPU {}: {}", device, e.what()));
    }
  }

  void set_up_tests() {
    for (const auto& side : sides_)
      at(*side, [&] {
        const auto d = static_cast<std::size_t>(side->self());
        if (d < options_.delays.size()) side->delay_tasks(options_.delays[d]);
        if (options_.timeline != nullptr) side->record_tasks();
      });
  }

  void enqueue_factorization(Side& side) {
    if (!several()) {
      side.enqueue_clear_factor();
      side.enqueue_factor();
      return;
    }
    if (side.self() != 0 && common_.top == nullptr) side.enqueue_values_from(first());
    side.enqueue_factor(side.self() == options_.fail_device);
    side.enqueue_counters();
  }

  // ---- runs --------------------------------------------------------------------------------------------------------

  void launch_factor(Side& side) { factor_graphs_[static_cast<std::size_t>(side.self())].launch(side.stream().get()); }

  // Launches on every side and waits for all. What goes wrong on one ends the others. clear(): what the next run needs.
  template <class Launch, class Clear>
  double run_on_all(Launch&& launch, Clear&& clear) {
    const double start = now_seconds();
    std::string what;
    const auto fail = [&](const Side& side, const char* text) {
      if (what.empty()) what = fmt::format("{}: {}", side.name(), text);
      for (const auto& other : sides_) other->abort();
    };
    for (const auto& side : sides_) side->stream().wait();  // clear of the run before
    std::vector<char> running(sides_.size(), 0);
    for (const auto& side : sides_) {
      try {
        at(*side, [&] { launch(*side); });
        running[static_cast<std::size_t>(side->self())] = 1;
      } catch (const Error& e) {
        fail(*side, e.what());
      }
    }
    for (auto left = std::count(running.begin(), running.end(), 1); left > 0;)
      for (const auto& side : sides_) {
        char& runs = running[static_cast<std::size_t>(side->self())];
        if (runs == 0) continue;
        const auto e = cudaStreamQuery(side->stream().get());
        if (e == cudaErrorNotReady) continue;
        runs = 0;
        --left;
        if (e != cudaSuccess) {
          (void)cudaGetLastError();
          fail(*side, cudaGetErrorString(e));
        } else if (side->self() == options_.fail_device) {
          fail(*side, "failed halfway, as asked for");
        }
      }
    const double seconds = now_seconds() - start;
    try {
      clear();
    } catch (const Error&) {
      if (what.empty()) throw;  // else the first failure tells more
    }
    if (!what.empty()) throw Error(StatusCode::device_error, what);
    return seconds;
  }

  void clear_factor() {
    if (common_.flag != nullptr) std::fill(common_.flag, common_.flag + common_flag_.size(), 0);
    for (const auto& side : sides_) at(*side, [&] { side->enqueue_clear_factor(); });
  }
  void clear_solve(Index at_once) {
    if (common_.updates != nullptr)
      std::memset(common_.updates, 0xff, static_cast<std::size_t>(common_updates_.size()) * sizeof(T));
    for (const auto& side : sides_) at(*side, [&] { side->enqueue_clear_solve(at_once); });
  }

  FactorOutcome run_factorization() {
    FactorOutcome out;
    bool stopped = false;
    if (options_.timeline != nullptr)
      for (const auto& side : sides_) at(*side, [&] { side->clear_record(); });
    const double began = base::now_seconds();
    if (several()) {
      if (common_.top != nullptr) send_values();
      // Counters are on the host when a run ends; marks are read before they are cleared.
      out.seconds = run_on_all([&](Side& s) { launch_factor(s); },
                               [&] {
                                 read_counters(out, stopped);
                                 read_marks(out);
                                 clear_factor();
                               });
    } else {
      const DeviceGuard guard(first().device());
      out.seconds = first().stream().timed([&] { launch_factor(first()); });
      first().enqueue_counters();
      first().stream().wait();
      read_counters(out, stopped);
      read_marks(out);
    }
    if (options_.timeline != nullptr) record(began);
    if (stopped) throw stalled("factorization");
    if (out.not_positive < 0) judge_pivots(out);
    return out;
  }

  [[nodiscard]] std::vector<std::vector<TaskTime>> task_times() const override {
    std::vector<std::vector<TaskTime>> times;
    if (options_.timeline != nullptr)
      for (const auto& side : sides_) at(*side, [&] { times.push_back(side->task_times()); });
    return times;
  }
  [[nodiscard]] const DevicePlan& device_plan() const override { return tables_; }

  // The devices' clocks have nothing in common: each device's first task counts as the begin of the run.
  void record(double began) {
    constexpr const char* kNames[] = {"whole front", "diagonal tile", "row block"};
    const auto times = task_times();
    for (std::size_t d = 0; d < times.size(); ++d) {
      std::uint64_t first = ~std::uint64_t{0};
      for (const TaskTime& t : times[d])
        if (t.end != 0) first = std::min(first, t.begin);
      std::vector<int> tracks;  // by block
      for (std::size_t k = 0; k < times[d].size(); ++k) {
        const TaskTime& t = times[d][k];
        if (t.end == 0) continue;
        const FactorTask& task = tables_.lists[d].tasks[k];
        if (t.block >= tracks.size()) tracks.resize(t.block + 1, -1);
        int& track = tracks[t.block];
        if (track < 0) track = options_.timeline->add_track(sides_[d]->name(), fmt::format("block {}", t.block));
        options_.timeline->record(
            track, {kNames[static_cast<int>(task.work)], task.front, task.block, task.column,
                    began + 1e-9 * static_cast<double>(t.begin - first),
                    began + 1e-9 * static_cast<double>(t.end - first), 0, 0, 1e-9 * static_cast<double>(t.waited)});
      }
    }
  }

  void send_values() {
    std::vector<T> values(static_cast<std::size_t>(context_.values));
    const Offset bytes = context_.values * static_cast<Offset>(sizeof(T));
    at(first(), [&] { first().copy_out(values.data(), first().values(), bytes); });
    for (const auto& side : sides_)
      if (side->self() != 0) at(*side, [&] { side->copy_in(side->values(), values.data(), bytes); });
  }

  void read_counters(FactorOutcome& out, bool& stopped) {
    const Index n = plan_.tree.n;
    work_.clear();
    replaced_ = failed_ = false;
    for (const auto& side : sides_) {
      const int* c = side->factor_counters();
      stopped = stopped || c[kAborted] != 0;
      if (c[kNotPositive] > 0) {
        const Index at = n - c[kNotPositive];
        out.not_positive = out.not_positive < 0 ? at : std::min(out.not_positive, at);
      }
      out.negative += c[kNegative];
      out.two_by_two += c[kTwoByTwo];
      replaced_ = replaced_ || c[kReplaced] > 0;
      failed_ = failed_ || c[kFailed] > 0;
      std::uint64_t taken = 0, waited = 0;
      std::memcpy(&taken, c + kBusy, sizeof taken);
      std::memcpy(&waited, c + kWaited, sizeof waited);
      const auto bytes = static_cast<Offset>(moved_[static_cast<std::size_t>(side->self())] * sizeof(T));
      const double waiting = 1e-9 * static_cast<double>(waited), busy = 1e-9 * static_cast<double>(taken) - waiting;
      out.busy_seconds += busy / static_cast<double>(sides_.size());
      out.waiting_seconds += waiting / static_cast<double>(sides_.size());
      if (several()) work_.push_back({side->name(), busy, waiting, c[kStolen], side->held(), bytes});
    }
  }

  void read_marks(FactorOutcome& out) {
    if (replaced_) out.replaced = marked(false);
    if (failed_) out.failed = marked(true);
  }

  std::vector<Index> marked(bool failed) {
    std::vector<unsigned char> marks;
    for (const auto& side : sides_) at(*side, [&] { side->marked(failed, marks); });
    std::vector<Index> list;
    for (std::size_t k = 0; k < marks.size(); ++k)
      if (marks[k] != 0) list.push_back(static_cast<Index>(k));
    return list;
  }

  // The determinant, and the positive pivots (llt) that count as zero.
  void judge_pivots(FactorOutcome& out) {
    Determinant determinant;
    pivots_host_.resize(sides_.size());
    for (const auto& side : sides_)
      at(*side, [&] { side->pivots(pivots_host_[static_cast<std::size_t>(side->self())]); });
    for (Index f = 0; f < plan_.fronts(); ++f) {
      const auto& pivots = pivots_host_[static_cast<std::size_t>(std::countr_zero(tables_.fronts[f].members))];
      for (Index k = plan_.tree.first[f]; k < plan_.tree.first[f + 1]; ++k) {
        const T p = pivots[static_cast<std::size_t>(k)];
        determinant.multiply(static_cast<double>(p));
        if (!smallest_.empty() && static_cast<double>(p) <= smallest_[static_cast<std::size_t>(k)])
          out.replaced.push_back(k);
      }
    }
    out.determinant_sign = determinant.sign();
    out.determinant_log = determinant.log();
  }

  // ---- solve -------------------------------------------------------------------------------------------------------

  void take_solve_memory(Index at_once) {
    if (at_once_ == at_once) return;
    at_once_ = at_once;
    for (const auto& side : sides_)
      at(*side, [&] {
        side->stream().wait();
        if (side->take_solve_memory(at_once)) solve_graphs_.clear();
      });
    if (several()) clear_solve(at_once);
  }

  template <class Record>
  const Graph& solve_graph(const SolveKey& key, const Side& side, Record&& record) {
    const auto found = solve_graphs_.find(key);
    if (found != solve_graphs_.end()) return found->second;
    constexpr std::size_t kMostGraphs = 64;
    if (solve_graphs_.size() >= kMostGraphs) solve_graphs_.clear();
    return solve_graphs_.emplace(key, Graph::record(side.stream().get(), record)).first->second;
  }

  // Every side works on a copy of the right-hand sides; solutions go to x, on the first device or wherever it lies.
  double solve_on_all(T* x, Index columns, bool transpose) {
    const Offset count = static_cast<Offset>(plan_.tree.n) * columns;
    side_rhs_.resize(sides_.size());
    std::vector<T> staged;
    for (const auto& side : sides_) {
      DeviceArray<T>& mine = side_rhs_[static_cast<std::size_t>(side->self())];
      if (mine.size() >= count) continue;
      at(*side, [&] {
        solve_graphs_.clear();
        mine = DeviceArray<T>();
        mine = DeviceArray<T>(count, side->budget(), side->held() + count * static_cast<Offset>(sizeof(T)));
      });
    }
    if (common_.updates != nullptr) stage_rhs(x, count);
    double seconds = 0;
    for (Index c = 0; c < columns; c += at_once_)
      seconds += run_on_all(
          [&](Side& side) {
            T* mine = side_rhs_[static_cast<std::size_t>(side.self())].data();
            T* result = common_.updates != nullptr ? mine : x;
            solve_graph({x, columns, transpose, side.self(), c}, side, [&] {
              if (c == 0 && common_.updates == nullptr)
                check(launch_copy(mine, static_cast<const T*>(x), count, side.stream().get()),
                      "copy of right-hand sides");
              side.enqueue_solve(sides_, mine, result, columns, c, transpose);
              side.enqueue_counters();
            }).launch(side.stream().get());
          },
          [&] { clear_solve(at_once_); });
    if (common_.updates != nullptr) collect_solution(x, columns);
    for (const auto& side : sides_)
      if (side->solve_counters()[1] != 0) throw stalled("solve");
    return seconds;
  }

  void stage_rhs(const T* x, Offset count) {
    std::vector<T> host(static_cast<std::size_t>(count));
    const Offset bytes = count * static_cast<Offset>(sizeof(T));
    at(first(), [&] { first().copy_out(host.data(), x, bytes); });
    for (const auto& side : sides_)
      at(*side, [&] { side->copy_in(side_rhs_[static_cast<std::size_t>(side->self())].data(), host.data(), bytes); });
  }

  // Every row from the device that speaks for its front.
  void collect_solution(T* x, Index columns) {
    const auto count = static_cast<std::size_t>(plan_.tree.n) * static_cast<std::size_t>(columns);
    const auto bytes = static_cast<Offset>(count * sizeof(T));
    std::vector<T> all(count), part(count);
    for (const auto& side : sides_) {
      at(*side, [&] { side->copy_out(part.data(), side_rhs_[static_cast<std::size_t>(side->self())].data(), bytes); });
      for (Index f = 0; f < plan_.fronts(); ++f)
        if (std::countr_zero(tables_.fronts[f].members) == side->self())
          std::copy(part.begin() + static_cast<std::ptrdiff_t>(plan_.tree.first[f]) * columns,
                    part.begin() + static_cast<std::ptrdiff_t>(plan_.tree.first[f + 1]) * columns,
                    all.begin() + static_cast<std::ptrdiff_t>(plan_.tree.first[f]) * columns);
    }
    to_device(x, all.data(), static_cast<Offset>(count));
  }

  const analysis::Plan& plan_;
  Kind kind_;
  CudaOptions options_;
  std::vector<int> devices_;
  DevicePlan tables_;
  SideContext context_;
  PinnedArray<T> common_top_, common_places_, common_pivot_, common_updates_;
  PinnedArray<int> common_flag_;
  CommonMemory<T> common_;
  std::vector<std::unique_ptr<Side>> sides_;
  DeviceArray<T> rhs_;
  std::vector<DeviceArray<T>> side_rhs_;
  std::vector<Graph> factor_graphs_;
  std::map<SolveKey, Graph> solve_graphs_;
  std::vector<DeviceWork> work_;
  std::vector<std::vector<T>> pivots_host_;
  T limits_[2] = {};
  bool limits_known_ = false;
  std::span<const double> smallest_;  // PivotRule::smallest
  bool replaced_ = false, failed_ = false;
  std::vector<double> moved_;  // devices; elements
  Index at_once_ = 1;
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
  return std::make_unique<ExecutorOnDevices<T>>(plan, kind, rule, options);
}

template std::unique_ptr<CudaExecutor<double>> make_cuda_executor(const analysis::Plan&, Kind, const PivotRule&,
                                                                  const CudaOptions&);
template std::unique_ptr<CudaExecutor<float>> make_cuda_executor(const analysis::Plan&, Kind, const PivotRule&,
                                                                 const CudaOptions&);

}  // namespace espalier::device::cuda

#endif
