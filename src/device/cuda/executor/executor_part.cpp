// Factorizations that make some fronts again and keep the others.
#include <algorithm>
#include <cmath>
#include <vector>

#include "device/cuda/executor/executor_on_devices.hpp"
#include "device/cuda/kernels/factor/pivot_limits.hpp"
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
  for (const auto& side : sides_) at(*side, [&] { side->set_limits(limits); });
  return run_part(values, reached);
}

template <class T>
bool ExecutorOnDevices<T>::goes_on() const {
  return plan_.options.keep_contributions && last_.sound && options_.timeline == nullptr;
}

// Whether pivots of kept fronts, of which none failed, would be the same by these limits.
template <class T>
bool ExecutorOnDevices<T>::judges_alike(const PivotLimits<T>& now) const {
  const bool firm = !last_.near && last_.least >= kFarFromTiny * last_.of_all[0];
  return judged_alike<T>(kind_, last_.of_all, now, !last_.varied, firm);
}

template <class T>
void ExecutorOnDevices<T>::note_run(const FactorOutcome& out, const SideFlags& flags, const PivotLimits<T>& limits,
                                    bool all) {
  const FactorEnd& end = first().factor_end();
  const bool near =
      std::any_of(sides_.begin(), sides_.end(), [&](const auto& side) { return counters_of(*side)[kNear] != 0; });
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
  for (const auto& side : sides_) at(*side, [&] { side->choose_part(made); });
  if (several())
    run_part_on_all(values, out, flags);
  else
    at(first(), [&] {
      first().enqueue_renewal();
      first().enqueue_part();
      first().enqueue_judge(values, addresses(), nullptr);
      first().stream().wait();
    });
  out.seconds = base::now_seconds() - began;
  if (!several()) read_counters(out, flags);
  if (context_.pair_sign != 0 && flags.replaced) return run(filled);  // a whole one makes no pairs then
  read_marks(out, flags);
  finish_run(filled, flags, out);
  note_run(out, flags, filled ? limits_of_filled(first().factor_end().largest) : limits_, false);
  made_.clear();
  out.share = plan::share_of_work(plan_, made);
  return out;
}

template <class T>
void ExecutorOnDevices<T>::run_part_on_all(const FilledValues& values, FactorOutcome& out, SideFlags& flags) {
  if (common_.top != nullptr) send_values();
  bool open = false;  // what is to be made
  run_on_all(
      open, true,
      [&](Side& side) {
        if (peers_) side.enqueue_take(first(), {});
        side.enqueue_part();
        side.enqueue_counters();
      },
      [&] {
        at(first(), [&] {
          first().enqueue_judge(values, addresses(), owner_.data());
          first().stream().wait();
        });
        read_counters(out, flags);
      },
      [&] {
        for (const auto& side : sides_) at(*side, [&] { side->enqueue_renewal(); });
      });
}

template class ExecutorOnDevices<double>;
template class ExecutorOnDevices<float>;

}  // namespace espalier::device::cuda
