#include "device/cuda/executor/selected_inverse.hpp"

#include <algorithm>
#include <optional>
#include <vector>

#include "device/cuda/executor/executor_on_devices.hpp"
#include "device/cuda/kernels/selected_inverse.hpp"
#include "device/inverse_places.hpp"

namespace espalier::device::cuda {

namespace {

// Memory of the GPU that is given back at the end: taken for this call, or a part of a space that is there.
class Loan {
 public:
  Loan(DeviceBudget* budget, std::span<std::byte> space)
      : budget_(budget), before_(budget != nullptr ? budget->held() : 0), space_(space) {}
  ~Loan() {
    if (budget_ != nullptr) budget_->give_back(budget_->held() - before_);
  }
  Loan(const Loan&) = delete;
  Loan& operator=(const Loan&) = delete;

  template <class U>
  U* take(Offset count) {
    const Offset bytes = (count * static_cast<Offset>(sizeof(U)) + kAligned - 1) / kAligned * kAligned;
    if (budget_ != nullptr) {
      taken_.emplace_back(bytes, *budget_, budget_->held() + bytes);
      return reinterpret_cast<U*>(taken_.back().data());
    }
    if (bytes > static_cast<Offset>(space_.size()))
      throw Error(StatusCode::out_of_memory, "entries of the inverse need " + base::format_bytes(bytes) +
                                                 " more of device memory, but " +
                                                 base::format_bytes(static_cast<Offset>(space_.size())) +
                                                 " are free; give it more with --device-memory or use the host");
    std::byte* const at = space_.data();
    space_ = space_.subspan(static_cast<std::size_t>(bytes));
    return reinterpret_cast<U*>(at);
  }
  [[nodiscard]] Offset left() const {
    if (budget_ == nullptr) return static_cast<Offset>(space_.size());
    constexpr Offset kSpare = Offset{64} << 20;  // for others
    std::size_t free = 0, total = 0;
    call("cudaMemGetInfo", [&] { return cudaMemGetInfo(&free, &total); });
    return std::min(budget_->left(), static_cast<Offset>(free) - kSpare);
  }

 private:
  static constexpr Offset kAligned = 256;
  DeviceBudget* budget_;
  Offset before_;
  std::span<std::byte> space_;
  std::vector<DeviceArray<std::byte>> taken_;
};

template <class T>
class DeviceInverse {
 public:
  DeviceInverse(const DeviceInverseJob<T>& job, base::ThreadPool& pool, const InverseEntries<T>& entries)
      : job_(job), pool_(pool), entries_(entries), loan_(job.budget, job.space) {}

  void run() {
    const auto count = static_cast<Offset>(entries_.row.size());
    if (count == 0) return;
    address_ = loan_.take<std::int64_t>(count);
    entry_ = loan_.take<T>(count);
    relative_ = loan_.take<std::int32_t>(static_cast<Offset>(job_.plan.relative.size()));
    fronts_ = loan_.take<InverseFrontOf<T>>(job_.plan.fronts());
    if (job_.inverse_d != nullptr) pivots_ = loan_.take<T>(2 * Offset{job_.plan.tree.n});
    plan_launches();
    send_tables();
    launch_all();
    take_entries();
  }

 private:
  void plan_launches() {
    const std::vector<char> needed = fronts_to_make(job_.plan, entries_, pool_);
    std::vector<char> staged;
    for (const InverseSource<T>& source : job_.sources) staged.push_back(source.on_host ? 1 : 0);
    if (std::find(staged.begin(), staged.end(), 1) == staged.end()) staged.clear();
    const Offset left = loan_.left();
    const Offset room = std::max<Offset>(0, left - left / 16) / static_cast<Offset>(sizeof(T));  // and the tasks
    KeptInverseTables& kept = job_.kept != nullptr ? *job_.kept : own_;
    if (kept.needed != needed || kept.staged != staged || !suits(kept, room)) {
      kept = {};
      kept.tables = make_inverse_tables(job_.plan, job_.fronts, {job_.kind, staged}, needed, room, sizeof(T));
      kept.needed = needed;
      kept.staged = staged;
      kept.room = room;
    }
    tables_ = &kept.tables;
    stack_ = loan_.take<T>(tables_->stack);
    tasks_ = loan_.take<InverseTask>(static_cast<Offset>(tables_->tasks.size()));
  }
  // Fronts that all have room at once are read at once. Others are grouped by the room there was.
  static bool suits(const KeptInverseTables& kept, Offset room) {
    const std::vector<InverseLaunch>& launches = kept.tables.launches;
    const auto reads = std::count_if(launches.begin(), launches.end(),
                                     [](const InverseLaunch& l) { return l.work == InverseWork::read; });
    return kept.room == room || (reads == 1 && kept.tables.stack <= room);
  }

  void send_tables() {
    const auto send = [&](auto& to, const auto& from) {
      job_.uploads.copy(to, from.data(), static_cast<Offset>(from.size() * sizeof from[0]), job_.stream);
    };
    std::vector<InverseFrontOf<T>> fronts(tables_->spots.size());
    const bool lu = job_.kind == Kind::lu;
    for (std::size_t k = 0; k < fronts.size(); ++k) {
      const InverseTables::Spot& spot = tables_->spots[k];
      InverseFrontOf<T>& x = fronts[k];
      x.front = job_.fronts[static_cast<std::size_t>(spot.front)];
      x.parent = spot.parent;
      const InverseSource<T>& source = job_.sources[static_cast<std::size_t>(spot.front)];
      x.factor = source.on_host ? stack_ + spot.factor : source.factor;
      if (lu) x.second = source.on_host ? stack_ + spot.second : source.second;
      x.z = stack_ + spot.z;
      x.across = stack_ + spot.across;
      x.g = stack_ + spot.g;
      x.h = stack_ + spot.h;
      x.m = stack_ + spot.m;
      x.v = stack_ + spot.v;
    }
    send(fronts_, fronts);
    send(tasks_, tables_->tasks);
    send(relative_, job_.plan.relative);
    if (pivots_ != nullptr) {
      const auto copy = [&](T* to, const T* from) {
        return cudaMemcpyAsync(to, from, static_cast<std::size_t>(job_.plan.tree.n) * sizeof(T), cudaMemcpyDefault,
                               job_.stream);
      };
      call("copy of pivots", [&] { return copy(pivots_, job_.inverse_d); });
      call("copy of pivots", [&] { return copy(pivots_ + job_.plan.tree.n, job_.inverse_e); });
    }
    wait();  // `fronts` ends here
  }

  void wait() const {
    call("cudaStreamSynchronize", [&] { return cudaStreamSynchronize(job_.stream); });
  }

  // Where each entry stands in the stack, in the order in which fronts are read; beside the kernels.
  void send_addresses() {
    wanted_ = find_inverse_places(job_.plan, entries_, pool_, nullptr);
    const std::size_t spots = tables_->spots.size();
    read_.assign(spots + 1, 0);
    for (std::size_t k = 0; k < spots; ++k) {
      const auto f = static_cast<std::size_t>(tables_->spots[k].front);
      read_[k + 1] = read_[k] + wanted_.ptr[f + 1] - wanted_.ptr[f];
    }
    job_.uploads.make(address_, read_.back(), sizeof(std::int64_t), sending_.get(),
                      [&](std::byte* stage, Offset begin, Offset end) {
                        auto* to = reinterpret_cast<std::int64_t*>(stage);
                        for_each_read(begin, end, [&](std::size_t k, Offset q) { *to++ = address_of(k, q); });
                      });
    sent_.record(sending_.get());
    call("cudaStreamWaitEvent", [&] { return cudaStreamWaitEvent(job_.stream, sent_.get(), 0); });
  }
  // Where entry q of those in the order of spots stands; it belongs to spot k.
  [[nodiscard]] std::int64_t address_of(std::size_t k, Offset q) const {
    const InverseTables::Spot& spot = tables_->spots[k];
    const Front& f = job_.fronts[static_cast<std::size_t>(spot.front)];
    const InversePlaces::Place& p = place_of(k, q);
    const auto padded = [&](Index row) { return row < f.pivots ? row : row - f.pivots + f.pivot_pad; };
    return spot.z + chunked(f.total_pad, padded(p.row), padded(p.col));
  }
  [[nodiscard]] const InversePlaces::Place& place_of(std::size_t k, Offset q) const {
    return wanted_.places[wanted_.ptr[static_cast<std::size_t>(tables_->spots[k].front)] + (q - read_[k])];
  }

  void launch_all() {
    call("preparation of the kernels of the inverse", [] { return prepare_inverse<T>(); });
    InverseState<T> state;
    state.kind = job_.kind;
    state.fronts = fronts_;
    state.tasks = tasks_;
    state.relative = relative_;
    state.inverse_d = pivots_;
    state.inverse_e = pivots_ != nullptr ? pivots_ + job_.plan.tree.n : nullptr;
    state.stack = stack_;
    state.address = address_;
    state.entry = entry_;
    for (InverseLaunch launch : tables_->launches) {
      if (launch.work == InverseWork::bring) {
        bring(launch.begin, launch.end);
        continue;
      }
      if (launch.work == InverseWork::gather) pool_.check();
      if (launch.work == InverseWork::read) {
        if (read_.empty()) send_addresses();
        launch.begin = read_[static_cast<std::size_t>(launch.begin)];
        launch.end = read_[static_cast<std::size_t>(launch.end)];
      }
      call("launch of a kernel of the inverse", [&] { return launch_inverse(state, launch, job_.stream); });
    }
  }

  // The factors of fronts from the host.
  void bring(Offset begin, Offset end) {
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
      const InverseTables::Spot& spot = tables_->spots[k];
      const Front& f = job_.fronts[static_cast<std::size_t>(spot.front)];
      const InverseSource<T>& source = job_.sources[static_cast<std::size_t>(spot.front)];
      if (!source.on_host) continue;
      const auto copy = [&](Offset to, const T* from) {
        job_.uploads.copy(stack_ + to, from, f.factor_size() * static_cast<Offset>(sizeof(T)), job_.stream);
      };
      copy(spot.factor, source.factor);
      if (job_.kind == Kind::lu) copy(spot.second, source.second);
    }
  }

  void take_entries() {
    job_.uploads.fetch(entry_, read_.back(), sizeof(T), job_.stream,
                       [&](const std::byte* stage, Offset begin, Offset end) {
                         const auto* entry = reinterpret_cast<const T*>(stage);
                         for_each_read(begin, end, [&](std::size_t k, Offset q) {
                           entries_.value[static_cast<std::size_t>(place_of(k, q).number)] = *entry++;
                         });
                       });
  }
  // use(k, q) for the entries [begin, end) in the order of spots; q belongs to spot k.
  template <class Use>
  void for_each_read(Offset begin, Offset end, Use&& use) const {
    auto k = static_cast<std::size_t>(std::upper_bound(read_.begin(), read_.end(), begin) - read_.begin() - 1);
    for (Offset q = begin; q < end; ++q) {
      while (read_[k + 1] <= q) ++k;
      use(k, q);
    }
  }

  const DeviceInverseJob<T>& job_;
  base::ThreadPool& pool_;
  const InverseEntries<T>& entries_;
  Loan loan_;
  InversePlaces wanted_;
  KeptInverseTables own_;
  const InverseTables* tables_ = nullptr;
  std::vector<Offset> read_;  // spots + 1; places in address_
  Stream sending_;            // of addresses
  Event sent_;
  // Memory of the GPU.
  std::int64_t* address_ = nullptr;
  T *entry_ = nullptr, *stack_ = nullptr, *pivots_ = nullptr;
  std::int32_t* relative_ = nullptr;
  InverseFrontOf<T>* fronts_ = nullptr;
  InverseTask* tasks_ = nullptr;
};

}  // namespace

template <class T>
void invert_on_device(const DeviceInverseJob<T>& job, const InverseEntries<T>& entries) {
  std::optional<base::ThreadPool> own;
  if (job.pool == nullptr) own.emplace(1);
  DeviceInverse<T>(job, job.pool != nullptr ? *job.pool : *own, entries).run();
}

template <class T>
bool ExecutorOnDevices<T>::invert_at(const InverseEntries<T>& entries) {
  if (several()) return false;
  at(first(), [&] {
    const SideAddresses<T> own = first().addresses();
    const Offset n = plan_.tree.n;
    const T* d = kind_ == Kind::ldlt ? own.pivots + n : nullptr;
    std::vector<InverseSource<T>> sources;
    for (const Front& f : tables_.fronts) sources.push_back({own.top + f.factor, own.top + f.second, false});
    invert_on_device<T>({plan_,
                         kind_,
                         tables_.fronts,
                         std::move(sources),
                         d,
                         d != nullptr ? d + n : nullptr,
                         first().stream().get(),
                         &first().budget(),
                         {},
                         first().uploads(),
                         options_.pool,
                         &kept_inverse_},
                        entries);
  });
  return true;
}

template bool ExecutorOnDevices<double>::invert_at(const InverseEntries<double>&);
template bool ExecutorOnDevices<float>::invert_at(const InverseEntries<float>&);
template void invert_on_device(const DeviceInverseJob<double>&, const InverseEntries<double>&);
template void invert_on_device(const DeviceInverseJob<float>&, const InverseEntries<float>&);

}  // namespace espalier::device::cuda
