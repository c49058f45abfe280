// Factorizations of one GPU that make some fronts again and keep the others.
#include <algorithm>
#include <cmath>
#include <vector>

#include "device/cuda/executor/executor_on_devices.hpp"
#include "plan/reached_fronts.hpp"

namespace espalier::device::cuda {

template <class T>
FactorOutcome ExecutorOnDevices<T>::factorize_changed(std::span<const T> values, std::span<const T> before) {
  if (!goes_on() || last_filled_ || !judges_alike(limits_)) return factorize(values);
  base::ThreadPool alone(1);
  const std::vector<char> reached =
      plan::fronts_reached(plan_, values, before, options_.pool != nullptr ? *options_.pool : alone);
  take_values(values);
  return run_part({}, reached);
}

template <class T>
std::optional<FactorOutcome> ExecutorOnDevices<T>::factorize_part(const FilledValues& values,
                                                                  std::span<const char> reached) {
  if (!goes_on() || !last_filled_ || !takes_up(values)) return factorize_filled(values);
  std::vector<double> parts(static_cast<std::size_t>(values.parts));
  const Offset bytes = values.parts * static_cast<Offset>(sizeof(double));
  at(first(), [&] { first().copy_out(parts.data(), values.largest, bytes); });
  const double largest = *std::max_element(parts.begin(), parts.end());
  if (!std::isfinite(largest)) {
    last_ = {};
    return std::nullopt;
  }
  const PivotLimits<T> limits = limits_of_filled(largest);
  if (!judges_alike(limits)) return factorize_filled(values);
  limits_known_ = false;
  at(first(), [&] { first().set_limits(limits); });
  return run_part(values, reached);
}

template <class T>
bool ExecutorOnDevices<T>::goes_on() const {
  return plan_.options.keep_contributions && !several() && last_.sound && options_.timeline == nullptr;
}

// Whether pivots of kept fronts, of which none failed, would be the same by these limits.
template <class T>
bool ExecutorOnDevices<T>::judges_alike(const PivotLimits<T>& now) const {
  const PivotLimits<T>& was = last_.of_all;
  if (now[1] != was[1]) return false;
  if (!base::keeps_fp64<T> && std::ilogb(now[3]) != std::ilogb(was[3])) return false;  // see HalfScales
  if (kind_ == Kind::llt || (now[0] == was[0] && !last_.varied)) return true;
  constexpr int kRange = 2, kFar = 8;  // kNearTiny is farther
  const bool close = now[0] <= kRange * was[0] && was[0] <= kRange * now[0];
  return close && !last_.near && last_.least >= kFar * was[0];
}

template <class T>
void ExecutorOnDevices<T>::note_run(const FactorOutcome& out, const SideFlags& flags, const PivotLimits<T>& limits,
                                    bool all) {
  if (several()) return;
  const FactorEnd& end = first().factor_end();
  const bool near = end.counters[kNear] != 0;
  if (all)
    last_ = {false, near, false, limits, T(0)};
  else
    last_.near = last_.near || near;
  last_.varied = last_.varied || limits[0] != last_.of_all[0];
  last_.least = end.small == 0 ? limits[2] : T(0);
  last_.sound = out.not_positive < 0 && !flags.replaced && !flags.failed && !flags.stopped;
}

template <class T>
FactorOutcome ExecutorOnDevices<T>::run_part(const FilledValues& values, std::span<const char> reached) {
  const bool filled = values.largest != nullptr;
  const std::vector<char> made = open_fronts(reached);
  const double began = base::now_seconds();
  last_.sound = false;
  SideFlags flags;
  FactorOutcome out;
  at(first(), [&] {
    first().choose_part(made);
    first().enqueue_part();
    first().enqueue_judge(values, addresses(), nullptr);
    first().stream().wait();
  });
  out.seconds = base::now_seconds() - began;
  read_counters(out, flags);
  if (context_.pair_sign != 0 && flags.replaced) return run(filled);  // a whole one makes no pairs then
  read_marks(out, flags);
  finish_run(filled, flags, out);
  note_run(out, flags, filled ? limits_of_filled(first().factor_end().largest) : limits_, false);
  made_.clear();
  out.share = plan::share_of_work(plan_, made);
  return out;
}

template class ExecutorOnDevices<double>;
template class ExecutorOnDevices<float>;

}  // namespace espalier::device::cuda
