#include <algorithm>
#include <bit>
#include <chrono>
#include <limits>
#include <span>

#include "base/named.hpp"
#include "device/cuda/executor/executor_on_devices.hpp"

namespace espalier::device::cuda {

namespace {

bool is_finite(double largest) { return largest <= std::numeric_limits<double>::max(); }

}  // namespace

// The devices have room for values up to the last one that the plan uses; behind it there may be others, of the second
// triangle of a symmetric matrix.
template <class T>
void ExecutorOnDevices<T>::take_values(std::span<const T> values) {
  to_device(first().values(), values.data(), std::min(context_.values, static_cast<Offset>(values.size())));
}

template <class T>
FactorOutcome ExecutorOnDevices<T>::factorize(std::span<const T> values) {
  take_values(values);
  return run(false);
}

template <class T>
std::optional<FactorOutcome> ExecutorOnDevices<T>::factorize_filled(const FilledValues& values) {
  if (!(values == filled_) || filled_graphs_.sides.empty()) {
    filled_ = {};
    filled_graphs_ = record_factorization(values);
    filled_ = values;
  }
  limits_known_ = false;  // the GPU sets its own
  if (common_.top != nullptr && !set_limits_here(values)) return std::nullopt;
  const FactorOutcome out = run(true);
  if (!is_finite(first().factor_end().largest)) return std::nullopt;
  return out;
}

template <class T>
FactorOutcome ExecutorOnDevices<T>::run(bool filled) {
  SideFlags flags;
  FactorOutcome out = run_once(filled, flags);
  if (context_.pair_sign == 0 || !flags.replaced) return out;
  forget_pairs();
  flags = {};
  return run_once(filled, flags);
}

template <class T>
void ExecutorOnDevices<T>::forget_pairs() {
  context_.pair_sign = 0;
  for (const auto& side : sides_) at(*side, [&] { side->forget_pairs(); });
  graphs_ = record_factorization({});
  if (filled_.largest != nullptr) filled_graphs_ = record_factorization(filled_);
}

template <class T>
FactorOutcome ExecutorOnDevices<T>::run_once(bool filled, SideFlags& flags) {
  const FactorGraphs& graphs = filled ? filled_graphs_ : graphs_;
  last_.sound = false;
  made_.clear();
  FactorOutcome out;
  if (options_.timeline != nullptr)
    for (const auto& side : sides_) at(*side, [&] { side->clear_record(); });
  last_filled_ = filled;
  const double began = base::now_seconds();
  const auto read = [&] {
    read_counters(out, flags);
    read_marks(out, flags);
  };
  if (several()) {
    if (common_.top != nullptr) send_values();
    out.seconds = launch_on_all(graphs, read);
  } else {  // one launch, one wait
    const DeviceGuard guard(first().device());
    graphs.sides.front().launch(first().stream().get());
    first().stream().wait();
    out.seconds = base::now_seconds() - began;
    if (is_finite(first().factor_end().largest)) read();
  }
  if (!is_finite(first().factor_end().largest)) return out;
  if (options_.timeline != nullptr) record(began);
  finish_run(filled, flags, out);
  note_run(out, flags, filled ? limits_of_filled(first().factor_end().largest) : limits_, true);
  return out;
}

template <class T>
void ExecutorOnDevices<T>::finish_run(bool filled, const SideFlags& flags, FactorOutcome& out) {
  if (flags.stopped) throw stalled("factorization");
  if (out.not_positive >= 0) return;
  if (smallest_.empty() || filled)
    take_determinant(first().factor_end(), out);
  else
    judge_pivots_here(out);
}

template <class T>
std::vector<std::vector<TaskTime>> ExecutorOnDevices<T>::task_times() const {
  std::vector<std::vector<TaskTime>> times;
  if (options_.timeline != nullptr)
    for (const auto& side : sides_) at(*side, [&] { times.push_back(side->task_times()); });
  return times;
}

template <class T>
void ExecutorOnDevices<T>::record(double began) {
  constexpr base::Named<Work> kWork[] = {{"whole front", Work::whole},
                                         {"diagonal tile", Work::diagonal},
                                         {"row block", Work::block},
                                         {"row block of two columns", Work::two_columns}};
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
          track, {name_of(kWork, task.work), task.front, task.block, task.column,
                  began + 1e-9 * static_cast<double>(t.begin - first),
                  began + 1e-9 * static_cast<double>(t.end - first), 0, 0, 1e-9 * static_cast<double>(t.waited)});
    }
  }
}

template <class T>
void ExecutorOnDevices<T>::send_values() {
  std::vector<T> values(static_cast<std::size_t>(context_.values));
  const Offset bytes = context_.values * static_cast<Offset>(sizeof(T));
  at(first(), [&] { first().copy_out(values.data(), first().values(), bytes); });
  for (const auto& side : sides_)
    if (side->self() != 0) at(*side, [&] { side->copy_in(side->values(), values.data(), bytes); });
}

template <class T>
bool ExecutorOnDevices<T>::set_limits_here(const FilledValues& values) {
  std::vector<double> parts(static_cast<std::size_t>(values.parts));
  at(first(),
     [&] { first().copy_out(parts.data(), values.largest, values.parts * static_cast<Offset>(sizeof(double))); });
  const double largest = *std::max_element(parts.begin(), parts.end());
  const PivotLimits<T> limits = {static_cast<T>(values.tiny * largest), limits_[1],
                                 static_cast<T>(values.rounding * largest), static_cast<T>(largest)};
  for (const auto& side : sides_) at(*side, [&] { side->set_limits(limits); });
  return is_finite(largest);
}

template <class T>
void ExecutorOnDevices<T>::read_counters(FactorOutcome& out, SideFlags& flags) {
  work_.clear();
  for (const auto& side : sides_) {
    const int* c = counters_of(*side);
    add_counters(c, plan_.tree.n, sides_.size(), out, flags);
    const auto bytes = static_cast<Offset>(moved_[static_cast<std::size_t>(side->self())] * sizeof(T));
    if (several()) work_.push_back(work_of(c, side->name(), side->held(), bytes));
  }
}

template <class T>
void ExecutorOnDevices<T>::read_marks(FactorOutcome& out, const SideFlags& flags) {
  if (flags.failed) take_failed(marks(true), out);
  const bool judged = out.not_positive < 0 && first().factor_end().small > 0;
  if (flags.replaced || judged) take_marks(marks(false), out);
}

template <class T>
std::vector<unsigned char> ExecutorOnDevices<T>::marks(bool failed) {
  std::vector<unsigned char> all;
  for (const auto& side : sides_) at(*side, [&] { side->marked(failed, all); });
  return all;
}

template <class T>
bool ExecutorOnDevices<T>::copy_inverse_pivots(std::span<T> d, std::span<T> e) const {
  if (kind_ != Kind::ldlt) return false;
  std::vector<T> mine_d, mine_e;
  for (const auto& side : sides_) {
    at(*side, [&] { side->inverse_pivots(mine_d, mine_e); });
    for (Index f = 0; f < plan_.fronts(); ++f) {
      if (several() && std::countr_zero(tables_.fronts[f].members) != side->self()) continue;
      const Index first = plan_.tree.first[f], count = plan_.tree.first[f + 1] - first;
      std::copy_n(mine_d.begin() + first, count, d.begin() + first);
      std::copy_n(mine_e.begin() + first, count, e.begin() + first);
    }
  }
  return true;
}

template <class T>
void ExecutorOnDevices<T>::judge_pivots_here(FactorOutcome& out) {
  pivots_host_.resize(sides_.size());
  for (const auto& side : sides_)
    at(*side, [&] { side->pivots(pivots_host_[static_cast<std::size_t>(side->self())]); });
  std::vector<T>& pivots = pivots_host_.front();
  for (Index f = 0; several() && f < plan_.fronts(); ++f) {
    const auto& from = pivots_host_[static_cast<std::size_t>(std::countr_zero(tables_.fronts[f].members))];
    if (&from != &pivots)
      std::copy(from.begin() + plan_.tree.first[f], from.begin() + plan_.tree.first[f + 1],
                pivots.begin() + plan_.tree.first[f]);
  }
  judge_pivots(pivots, smallest_, out);
}

template class ExecutorOnDevices<double>;
template class ExecutorOnDevices<float>;

}  // namespace espalier::device::cuda
