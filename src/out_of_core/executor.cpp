#include "out_of_core/executor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <utility>

#include "base/thread_pool.hpp"
#include "base/timeline.hpp"
#include "out_of_core/device_run.hpp"
#include "out_of_core/disk_fronts.hpp"
#include "out_of_core/partial_run.hpp"
#include "out_of_core/pinned_store.hpp"
#include "out_of_core/store_uses.hpp"
#include "plan/reached_fronts.hpp"

namespace espalier::out_of_core {

namespace {

using device::FactorOutcome;
using device::OutOfCoreReport;

// Sums of what the devices' pivots came to, in the order of the devices.
device::FactorOutcome together(const std::vector<device::FactorOutcome>& parts) {
  device::FactorOutcome all = parts.front();
  const auto join = [](std::vector<Index>& to, const std::vector<Index>& more) {
    to.insert(to.end(), more.begin(), more.end());
    std::sort(to.begin(), to.end());
  };
  for (std::size_t d = 1; d < parts.size(); ++d) {
    const device::FactorOutcome& o = parts[d];
    if (o.not_positive >= 0 && (all.not_positive < 0 || o.not_positive < all.not_positive))
      all.not_positive = o.not_positive;
    all.negative += o.negative;
    all.two_by_two += o.two_by_two;
    join(all.replaced, o.replaced);
    join(all.replaced_rows, o.replaced_rows);
    join(all.small, o.small);
    all.small_negative += o.small_negative;
    join(all.failed, o.failed);
    all.determinant_sign *= o.determinant_sign;
    all.determinant_log += o.determinant_log;
    all.busy_seconds += o.busy_seconds;
    all.waiting_seconds += o.waiting_seconds;
  }
  all.busy_seconds /= static_cast<double>(parts.size());
  all.waiting_seconds /= static_cast<double>(parts.size());
  return all;
}

void expect_window(const OutOfCorePlan& plan, const OutOfCoreLayout& layout, const DiskOptions& disk) {
  const Offset window = disk.window_bytes;
  const Offset block = disk.block_bytes > 0 ? disk.block_bytes : DiskStore::block_for(window);
  const Offset least = DiskFronts::least_window(plan, layout, block);
  if (window >= least) return;
  throw WindowTooSmall(fmt::format("a factor on disk needs {} of the host's memory beside all else, the budget leaves "
                                   "{}; raise it by {} (--host-memory)",
                                   base::format_bytes(least), base::format_bytes(std::max<Offset>(0, window)),
                                   base::format_bytes(least - window)),
                       least - window);
}

template <class T>
class OutOfCoreExecutor final : public device::Executor<T> {
 public:
  OutOfCoreExecutor(std::vector<std::unique_ptr<OutOfCoreBackend<T>>> backends, const OutOfCoreOptions& options,
                    base::MemoryBudget* budget)
      : options_(options),
        progress_(static_cast<Index>(backends.size())),
        crew_(kRoles * static_cast<int>(backends.size()), options.interruption),
        plans_(plan_out_of_core(*backends.front(), options.devices, options.rates, options.pool)) {
    if (crew_.size() < kRoles * static_cast<int>(backends.size()))
      throw Error(StatusCode::out_of_memory,
                  "the system refuses the threads that bring a factor out of core to its device; raise the limit "
                  "(ulimit -u), or give the device a larger budget");
    for (std::size_t d = 0; d < backends.size(); ++d)
      devices_.emplace_back(std::move(backends[d]), static_cast<Index>(d), options_, progress_);
    for (auto& d : devices_) backends_.push_back(&d.backend());
    for (std::size_t d = 0; d < devices_.size(); ++d) devices_[d].prepare(plans_[d], backends_);
    make_store(budget);
    pin_store_later();
  }

  void set_pivot_rule(const device::PivotRule& rule) override {
    for (auto& d : devices_) d.backend().set_pivot_rule(rule);
  }

  device::FactorOutcome factorize(std::span<const T> values) override { return run(values, PartialRun()); }

  device::FactorOutcome factorize_changed(std::span<const T> values, std::span<const T> before) override {
    if (!complete_ || !options_.rates.keep_contributions) return factorize(values);
    const plan::Plan& plan = backends_.front()->plan();
    std::vector<char> changed(static_cast<std::size_t>(plan.fronts()), 0);
    for (OutOfCoreBackend<T>* backend : backends_) {
      const std::vector<char> there = backend->changed_fronts(values, before);
      if (there.empty()) return factorize(values);
      std::transform(there.begin(), there.end(), changed.begin(), changed.begin(),
                     [](char x, char y) { return static_cast<char>(x != 0 || y != 0); });
    }
    PartialRun part(plan, plans_, changed);
    const double kept = plan::share_of_work(plan, part.kept());
    device::FactorOutcome outcome = run(values, std::move(part));
    outcome.share = 1 - kept;
    return outcome;
  }

  void solve(T* x, Index columns, bool transpose) override {
    devices_.front().backend().solve(store(), reachable(), x, columns, transpose);
  }
  bool solve_on_paths(const device::PathSolve<T>& solve) override {
    return devices_.front().backend().solve_on_paths(store(), reachable(), solve);
  }
  bool invert_at(const device::InverseEntries<T>& entries) override {
    if (disk_ != nullptr) disk_->hold_all(plans_.front().factor_elements * static_cast<Offset>(sizeof(T)));
    return devices_.front().backend().invert_at(store(), entries);
  }
  [[nodiscard]] std::string name() const override { return devices_.front().backend().name(); }
  [[nodiscard]] Offset peak_bytes() const override {
    Offset most = 0;
    for (const auto& d : devices_) most = std::max(most, d.backend().peak_bytes());
    return most;
  }
  [[nodiscard]] device::OutOfCoreReport out_of_core() const override { return report(0); }
  [[nodiscard]] std::vector<device::DeviceWork> device_work() const override {
    std::vector<device::DeviceWork> list;
    if (devices_.size() == 1) return list;
    for (std::size_t d = 0; d < devices_.size(); ++d) {
      device::DeviceWork w;
      w.name = devices_[d].backend().name();
      if (d < outcomes_.size()) {
        w.busy_seconds =
            outcomes_[d].busy_seconds > 0 ? outcomes_[d].busy_seconds : devices_[d].backend().times().sum();
        w.waiting_seconds = outcomes_[d].waiting_seconds;
      }
      w.peak_bytes = devices_[d].backend().peak_bytes();
      w.out_of_core = report(d);
      list.push_back(std::move(w));
    }
    return list;
  }

 private:
  device::FactorOutcome run(std::span<const T> values, PartialRun part) {
    const double start = base::now_seconds();
    complete_ = false;
    part_ = std::move(part);
    progress_.reset();
    error_ = nullptr;
    if (again_) pinned_->start();
    again_ = true;
    if (disk_ != nullptr) {
      before_ = disk_->traffic();
      if (options_.rates.keep_contributions) plan_disk();
      disk_->begin_plan(!part_.makes_all());
    }
    base::Stage* const stage = base::Stage::current("factorization");
    for (auto& d : devices_) d.begin(values, store(), *pinned_, disk_.get(), part_);
    crew_.run([&](int worker) {
      auto& d = devices_[static_cast<std::size_t>(worker / kRoles)];
      switch (worker % kRoles) {
        case 0:
          return guarded(d, [&] { d.run_all(stage, 1.0 / static_cast<double>(devices_.size())); });
        case 1:
          return guarded(d, [&] { d.load_all(); });
        default:
          return guarded(d, [&] { d.store_all(); });
      }
    });
    if (disk_ != nullptr) disk_->end();
    if (error_ != nullptr) {
      for (auto& d : devices_) d.backend().abandon();
      std::rethrow_exception(error_);
    }
    outcomes_.clear();
    for (auto& d : devices_) outcomes_.push_back(d.backend().outcome());
    for (auto& d : devices_)
      if (&d != &devices_.front()) devices_.front().backend().take_pivots(d.backend());
    device::FactorOutcome outcome = together(outcomes_);
    complete_ = true;
    outcome.seconds = base::now_seconds() - start;
    if (outcome.busy_seconds <= 0) {
      for (const auto& d : devices_) outcome.busy_seconds += d.backend().times().sum();
      outcome.busy_seconds /= static_cast<double>(devices_.size());
    }
    return outcome;
  }

  // Not in part: then the sums of a solve, and so the bits, would depend on how far the pinning is.
  [[nodiscard]] bool reachable() { return !plans_.front().streamed.empty() && pinned_->complete(); }
  [[nodiscard]] device::OutOfCoreReport report(std::size_t d) const {
    device::OutOfCoreReport r = devices_[d].report(options_.devices[d].budget_bytes);
    if (disk_ != nullptr) {
      const DiskTraffic t = disk_->traffic();
      r.disk_written_bytes = t.written_bytes - before_.written_bytes;
      r.disk_read_bytes = t.read_bytes - before_.read_bytes;
    }
    return r;
  }

  [[nodiscard]] T* store() { return disk_ != nullptr ? reinterpret_cast<T*>(disk_->data()) : store_.data(); }

  // In memory where it fits, else on disk.
  void make_store(base::MemoryBudget* budget) {
    const OutOfCorePlan& plan = plans_.front();
    constexpr auto kSize = static_cast<Offset>(sizeof(T));
    DiskOptions disk = options_.disk;
    if (budget != nullptr && budget->limit() > 0)
      disk.window_bytes = std::min(disk.window_bytes, budget->limit() - budget->held() - options_.left_bytes);
    if (disk.folder.empty() || plan.store_elements * kSize <= disk.window_bytes) {
      store_ = base::Buffer<T>(plan.store_elements, budget);
      touch_store();
      return;
    }
    const OutOfCoreBackend<T>& first = *backends_.front();
    expect_window(plan, first, disk);
    disk_ = std::make_unique<DiskStore>(plan.store_elements * kSize, disk, budget);
    plan_disk();
    fronts_.emplace(*disk_, plan, first);
    backends_.front()->set_reader(&*fronts_);
    options_.pinned_bytes = 0;
  }

  // For the run at hand.
  void plan_disk() {
    const OutOfCorePlan& plan = plans_.front();
    const Index steps = steps_of(plans_);
    const Offset lasts = options_.rates.keep_contributions ? plan.store_elements : plan.factor_elements;
    disk_->set_plan(store_uses(plans_, *backends_.front(), steps, part_), lasts * static_cast<Offset>(sizeof(T)),
                    DeviceRun<T>::kDiskQueues * static_cast<int>(plans_.size()), steps);
  }

  // The machine finds pages on the first write, one by one: by all threads, before it hurts.
  void touch_store() {
    constexpr Offset kPage = 4096 / static_cast<Offset>(sizeof(T));
    constexpr std::int64_t kPagesPerRange = 4096;
    const Offset pages = (store_.size() + kPage - 1) / kPage;
    devices_.front().crew().for_each_range(pages, kPagesPerRange, [&](std::int64_t b, std::int64_t e) {
      for (Offset p = b; p < e; ++p) store_[p * kPage] = T(0);
    });
  }

  // From the second factorization on.
  void pin_store_later() {
    OutOfCoreBackend<T>& first = *backends_.front();
    pinned_.emplace(reinterpret_cast<std::byte*>(store()),
                    plans_.front().store_elements * static_cast<Offset>(sizeof(T)), options_.pinned_bytes,
                    options_.pinned_block_bytes,
                    PinnedStore::Calls{[&first] { first.enter_thread(); },
                                       [&first](std::byte* at, Offset bytes) { return first.pin(at, bytes); },
                                       [&first](std::byte* at) { first.unpin(at); }});
  }

  // What one thread throws ends all of them.
  template <class Work>
  void guarded(DeviceRun<T>& device, Work&& work) {
    try {
      device.backend().enter_thread();
      work();
    } catch (const Stopped&) {
    } catch (...) {
      const std::lock_guard lock(error_mutex_);
      if (error_ == nullptr) error_ = std::current_exception();
      progress_.stop();
      if (disk_ != nullptr) disk_->give_up();
    }
  }

  static constexpr int kRoles = 3;  // threads per device: one computes, one loads, one stores

  OutOfCoreOptions options_;
  QueueProgress progress_;
  base::ThreadPool crew_;
  std::vector<OutOfCorePlan> plans_;
  std::deque<DeviceRun<T>> devices_;
  std::vector<OutOfCoreBackend<T>*> backends_;  // of the devices
  base::Buffer<T> store_;
  std::unique_ptr<DiskStore> disk_;              // or this one
  std::optional<DiskFronts> fronts_;             // of it
  DiskTraffic before_;                           // the last factorization
  std::optional<PinnedStore> pinned_;            // of the store; ends before it
  bool again_ = false;                           // a factorization was asked for before
  bool complete_ = false;                        // the last one has ended well
  PartialRun part_;                              // the last factorization
  std::vector<device::FactorOutcome> outcomes_;  // devices; of the last factorization
  std::mutex error_mutex_;
  std::exception_ptr error_;
};

}  // namespace

template <class T>
std::unique_ptr<device::Executor<T>> make_out_of_core_executor(
    std::vector<std::unique_ptr<OutOfCoreBackend<T>>> backends, const OutOfCoreOptions& options,
    base::MemoryBudget* budget) {
  return std::make_unique<OutOfCoreExecutor<T>>(std::move(backends), options, budget);
}

template <class T>
Offset host_bytes(const std::vector<std::unique_ptr<OutOfCoreBackend<T>>>& backends, const OutOfCoreOptions& options) {
  const std::vector<OutOfCorePlan> plans =
      plan_out_of_core(*backends.front(), options.devices, options.rates, options.pool);
  Offset bytes = plans.front().store_elements * static_cast<Offset>(sizeof(T));
  for (std::size_t d = 0; d < backends.size(); ++d)
    bytes += backends[d]->host_bytes(plans[d], 2 * options.slots, options.slot_bytes);
  return bytes;
}

template <class T>
DiskPrediction predict_disk(const std::vector<std::unique_ptr<OutOfCoreBackend<T>>>& backends,
                            const OutOfCoreOptions& options) {
  constexpr auto kSize = static_cast<Offset>(sizeof(T));
  const std::vector<OutOfCorePlan> plans =
      plan_out_of_core(*backends.front(), options.devices, options.rates, options.pool);
  const OutOfCorePlan& plan = plans.front();
  DiskOptions disk = options.disk;
  Offset& window = disk.window_bytes;
  for (std::size_t d = 0; d < backends.size(); ++d)
    window -= backends[d]->host_bytes(plans[d], 2 * options.slots, options.slot_bytes);
  const Offset bytes = plan.store_elements * kSize;
  const Offset lasts = options.rates.keep_contributions ? bytes : plan.factor_elements * kSize;
  DiskPrediction p;
  if (bytes <= window) return p;
  expect_window(plan, *backends.front(), disk);
  p.file_bytes = bytes - window;
  p.factorization = traffic_of(store_uses(plans, *backends.front(), steps_of(plans)), bytes, lasts, window);
  // A way begins with what the one before has ended with.
  p.way_read_bytes = std::max<Offset>(
      0, plan.factor_elements * kSize / (backends.front()->plan().options.unsymmetric ? 2 : 1) - window);
  return p;
}

#define ESPALIER_INSTANTIATE(T)                                                                                  \
  template std::unique_ptr<device::Executor<T>> make_out_of_core_executor(                                       \
      std::vector<std::unique_ptr<OutOfCoreBackend<T>>>, const OutOfCoreOptions&, base::MemoryBudget*);          \
  template Offset host_bytes(const std::vector<std::unique_ptr<OutOfCoreBackend<T>>>&, const OutOfCoreOptions&); \
  template DiskPrediction predict_disk(const std::vector<std::unique_ptr<OutOfCoreBackend<T>>>&,                 \
                                       const OutOfCoreOptions&);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::out_of_core
