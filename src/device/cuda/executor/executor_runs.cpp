#include <algorithm>
#include <bit>
#include <chrono>
#include <limits>
#include <span>

#include "device/cuda/executor/executor_on_devices.hpp"
#include "device/determinant.hpp"

namespace espalier::device::cuda {

namespace {

template <class Is>
std::vector<Index> positions(const std::vector<unsigned char>& marks, Is&& is) {
  std::vector<Index> list;
  for (std::size_t k = 0; k < marks.size(); ++k)
    if (is(marks[k])) list.push_back(static_cast<Index>(k));
  return list;
}

bool is_finite(double largest) { return largest <= std::numeric_limits<double>::max(); }

}  // namespace

template <class T>
FactorOutcome ExecutorOnDevices<T>::factorize(std::span<const T> values) {
  to_device(first().values(), values.data(), static_cast<Offset>(values.size()));
  return run(graphs_, false);
}

template <class T>
std::optional<FactorOutcome> ExecutorOnDevices<T>::factorize_filled(const FilledValues& values) {
  if (!(values == filled_)) {
    filled_ = {};
    filled_graphs_ = record_factorization(values);
    filled_ = values;
  }
  limits_known_ = false;  // the GPU sets its own
  if (common_.top != nullptr && !set_limits_here(values)) return std::nullopt;
  const FactorOutcome out = run(filled_graphs_, true);
  if (!is_finite(first().factor_end().largest)) return std::nullopt;
  return out;
}

template <class T>
FactorOutcome ExecutorOnDevices<T>::run(const FactorGraphs& graphs, bool filled) {
  FactorOutcome out;
  bool stopped = false;
  give_back_solve_memory();
  if (options_.timeline != nullptr)
    for (const auto& side : sides_) at(*side, [&] { side->clear_record(); });
  last_filled_ = filled;
  const double began = base::now_seconds();
  const auto read = [&] {
    read_counters(out, stopped);
    read_marks(out);
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
  if (stopped) throw stalled("factorization");
  if (out.not_positive >= 0) return out;
  if (smallest_.empty() || filled)
    take_judgement(out);
  else
    judge_pivots_here(out);
  return out;
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
void ExecutorOnDevices<T>::read_counters(FactorOutcome& out, bool& stopped) {
  const Index n = plan_.tree.n;
  work_.clear();
  replaced_ = failed_ = false;
  for (const auto& side : sides_) {
    const int* c = counters_of(*side);
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

template <class T>
void ExecutorOnDevices<T>::read_marks(FactorOutcome& out) {
  if (failed_) out.failed = positions(marks(true), [](unsigned char mark) { return mark != 0; });
  const bool judged = out.not_positive < 0 && first().factor_end().small > 0;
  if (!replaced_ && !judged) return;
  const std::vector<unsigned char> found = marks(false);
  out.replaced = positions(found, [](unsigned char mark) { return (mark & kPivotReplaced) != 0; });
  const auto small = [](unsigned char mark) { return (mark & (kPivotReplaced | kPivotSmall)) == kPivotSmall; };
  out.small = positions(found, small);
  out.small_negative = static_cast<Index>(std::count_if(found.begin(), found.end(), [&](unsigned char mark) {
    return small(mark) && (mark & kPivotSmallNegative) != 0;
  }));
}

template <class T>
std::vector<unsigned char> ExecutorOnDevices<T>::marks(bool failed) {
  std::vector<unsigned char> all;
  for (const auto& side : sides_) at(*side, [&] { side->marked(failed, all); });
  return all;
}

template <class T>
void ExecutorOnDevices<T>::take_judgement(FactorOutcome& out) {
  const FactorEnd& end = first().factor_end();
  out.determinant_sign = end.sign;
  out.determinant_log = Determinant(end.mantissa, end.exponent).log();
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
  Determinant determinant;
  determinant.multiply(std::span<const T>(pivots));
  for (std::size_t k = 0; k < smallest_.size(); ++k)
    if (static_cast<double>(pivots[k]) <= smallest_[k]) out.replaced.push_back(static_cast<Index>(k));
  out.determinant_sign = determinant.sign();
  out.determinant_log = determinant.log();
}

template class ExecutorOnDevices<double>;
template class ExecutorOnDevices<float>;

}  // namespace espalier::device::cuda
