#include "out_of_core/executor.hpp"

#include <algorithm>
#include <deque>
#include <exception>
#include <mutex>
#include <optional>
#include <utility>

#include "base/thread_pool.hpp"
#include "base/timeline.hpp"
#include "out_of_core/device_run.hpp"
#include "out_of_core/pinned_store.hpp"

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
    store_ = base::Buffer<T>(plans_.front().store_elements, budget);
    touch_store();
    pin_store_later();
  }

  void set_pivot_rule(const device::PivotRule& rule) override {
    for (auto& d : devices_) d.backend().set_pivot_rule(rule);
  }

  device::FactorOutcome factorize(std::span<const T> values) override {
    const double start = base::now_seconds();
    progress_.reset();
    error_ = nullptr;
    if (again_) pinned_->start();
    again_ = true;
    base::Stage* const stage = base::Stage::current("factorization");
    for (auto& d : devices_) d.begin(values, store_.data(), *pinned_);
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
    if (error_ != nullptr) {
      for (auto& d : devices_) d.backend().abandon();
      std::rethrow_exception(error_);
    }
    outcomes_.clear();
    for (auto& d : devices_) outcomes_.push_back(d.backend().outcome());
    for (auto& d : devices_)
      if (&d != &devices_.front()) devices_.front().backend().take_pivots(d.backend());
    device::FactorOutcome outcome = together(outcomes_);
    outcome.seconds = base::now_seconds() - start;
    if (outcome.busy_seconds <= 0) {
      for (const auto& d : devices_) outcome.busy_seconds += d.backend().times().sum();
      outcome.busy_seconds /= static_cast<double>(devices_.size());
    }
    return outcome;
  }

  void solve(T* x, Index columns, bool transpose) override {
    // Not in part: then the sums, and so the bits, would depend on how far the pinning is.
    const bool reachable = !plans_.front().streamed.empty() && pinned_->complete();
    devices_.front().backend().solve(store_.data(), reachable, x, columns, transpose);
  }
  bool invert_at(const device::InverseEntries<T>& entries) override {
    return devices_.front().backend().invert_at(store_.data(), entries);
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
  [[nodiscard]] device::OutOfCoreReport report(std::size_t d) const {
    return devices_[d].report(options_.devices[d].budget_bytes);
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
    pinned_.emplace(reinterpret_cast<std::byte*>(store_.data()), store_.bytes(), options_.pinned_bytes,
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
  std::optional<PinnedStore> pinned_;            // of the store; ends before it
  bool again_ = false;                           // a factorization was asked for before
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

#define ESPALIER_INSTANTIATE(T)                                                                         \
  template std::unique_ptr<device::Executor<T>> make_out_of_core_executor(                              \
      std::vector<std::unique_ptr<OutOfCoreBackend<T>>>, const OutOfCoreOptions&, base::MemoryBudget*); \
  template Offset host_bytes(const std::vector<std::unique_ptr<OutOfCoreBackend<T>>>&, const OutOfCoreOptions&);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::out_of_core
