// Choosing among out-of-core plans: the tree is cut in several ways, every cut is written out as operations with
// predicted times, and the fastest is taken.
#include "out_of_core/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <utility>

#include "out_of_core/programmers.hpp"

namespace espalier::out_of_core {

namespace {

using Plans = std::vector<OutOfCorePlan>;

// The units and steps for some sizes of steps, made once each.
class Candidates {
 public:
  Candidates(const OutOfCoreLayout& layout, const std::vector<OutOfCoreDevice>& devices, const PlanningRates& rates,
             base::ThreadPool* pool)
      : layout_(layout), rates_(rates), pool_(pool), marks_(layout) {
    std::vector<double> speed;
    for (const OutOfCoreDevice& d : devices) speed.push_back(d.speed);
    sets_ = share_fronts(layout.plan(), speed);
  }

  // The plans of this shape, or none.
  bool make(const std::vector<OutOfCoreDevice>& devices, const PlanParameters& shape, Plans& plans) {
    std::vector<Offset> limits;
    for (const OutOfCoreDevice& d : devices)
      limits.push_back(static_cast<Offset>(shape.step * static_cast<double>(d.budget_bytes)));
    auto found = cuts_.find(limits);
    if (found == cuts_.end()) {
      Cut cut;
      cut.units = cut_into_units(layout_, {limits, sets_, rates_.share_seconds});
      cut.steps = make_in_core_steps(layout_, cut.units, marks_, pool_);
      found = cuts_.emplace(limits, std::move(cut)).first;
    }
    try {
      plans = write(found->second, devices, shape);
      return true;
    } catch (const NoRoom&) {
      return false;
    }
  }
  void forget() { cuts_.clear(); }

 private:
  struct Cut {
    std::vector<Unit> units;
    std::vector<InCoreStep> steps;
  };

  Plans write(const Cut& cut, const std::vector<OutOfCoreDevice>& devices, const PlanParameters& shape) {
    Program program(layout_, cut.units, cut.steps, devices, shape, rates_, pool_);
    StepProgrammer steps(program);
    FrontProgrammer fronts(program);
    for (std::size_t u = 0; u < cut.units.size(); ++u) {
      program.unit = static_cast<Index>(u);
      if (cut.units[u].large >= 0)
        fronts.write();
      else
        steps.write();
    }
    return program.finish();
  }

  const OutOfCoreLayout& layout_;
  PlanningRates rates_;
  base::ThreadPool* pool_;
  TaskMarks marks_;
  DeviceSets sets_;
  std::map<std::vector<Offset>, Cut> cuts_;
};

// What takes the least memory, for budgets near the floor.
bool make_frugal(Candidates& candidates, const std::vector<OutOfCoreDevice>& devices, Plans& plans) {
  for (const double step : {0.5, 0.25, 0.1, 0.03}) {
    PlanParameters shape;
    shape.step = step;
    shape.group = 0.3;
    shape.chunks = 1;
    shape.frugal = true;
    if (candidates.make(devices, shape, plans)) return true;
  }
  return false;
}

// Seconds of a factorization and one solve.
double seconds_of(const Plans& plans) { return plans.front().predicted_seconds + plans.front().solve_seconds; }

// Factors that stay on the device spare the link and the host, but leave less room for steps and groups. Tries how much
// of the budget they may take, with steps and groups that are smaller by as much, or by half of that again.
void keep_factors(Candidates& candidates, const std::vector<OutOfCoreDevice>& devices, const PlanningRates& rates,
                  const PlanParameters& shape, Plans& best) {
  Plans plans;
  // Predictions are some per cent off: what gains less is not worth smaller steps.
  constexpr double kGain = 0.98;
  double least = rates.resident > 0 ? std::numeric_limits<double>::infinity() : kGain * seconds_of(best), share = 0;
  const auto try_share = [&](double candidate_share) {
    candidates.forget();
    for (const double step : {1.0, 0.5})
      for (const double group : {1.0, 0.5}) {
        PlanParameters candidate = shape;
        candidate.resident = candidate_share;
        candidate.step *= step * (1 - candidate_share);
        candidate.group *= group * (1 - candidate_share);
        if (!candidates.make(devices, candidate, plans) || seconds_of(plans) >= least) continue;
        least = seconds_of(plans);
        share = candidate_share;
        best = std::move(plans);
      }
  };
  if (rates.resident >= 0) {
    if (rates.resident > 0) try_share(rates.resident);
    return;
  }
  for (const double s : {0.85, 0.7, 0.5, 0.3, 0.15}) {
    try_share(s);
    if (share > s) break;  // less was worse
  }
  if (share == 0) return;
  for (const double apart : {0.07, 0.035}) {
    const double middle = share;
    for (const double s : {middle + apart, middle - apart})
      if (s < 1) try_share(s);
  }
}

// The fastest of the shapes that need no frugality; none: empty. First the sizes of steps and groups, then, for the
// best of them, what matters less.
Plans fastest(Candidates& candidates, const std::vector<OutOfCoreDevice>& devices, const PlanningRates& rates) {
  Plans best, plans;
  PlanParameters shape;
  const auto try_shape = [&](const PlanParameters& candidate) {
    if (!candidates.make(devices, candidate, plans)) return false;
    if (best.empty() || plans.front().predicted_seconds < best.front().predicted_seconds) {
      best = std::move(plans);
      shape = candidate;
    }
    return true;
  };
  const int turns = devices.size() > 1 ? 2 : 1;
  for (const double step : {0.4, 0.3, 0.2, 0.1, 0.05})
    for (const double group : {0.45, 0.3, 0.2, 0.13, 0.09, 0.06}) {
      if ((rates.step > 0 && rates.step != step) || (rates.group > 0 && rates.group != group)) continue;
      PlanParameters candidate{step, group, turns, 3, 1.0 / 32, false, rates.lanes, true};
      if (try_shape(candidate)) continue;
      candidate.around = false;
      (void)try_shape(candidate);
    }
  if (best.empty()) return best;
  const auto with = [&](auto change) {
    PlanParameters candidate = shape;
    change(candidate);
    (void)try_shape(candidate);
  };
  with([](PlanParameters& x) { x.around = !x.around; });
  for (const double chunk : {1.0 / 64, 1.0 / 16}) with([&](PlanParameters& x) { x.chunk = chunk; });
  if (devices.size() > 1)
    for (const int t : {1, 4}) with([&](PlanParameters& x) { x.turns = t; });
  else if (!rates.keep_contributions)
    keep_factors(candidates, devices, rates, shape, best);
  return best;
}

// Certainly needed: of every front a block column, or all of it.
Offset least_bytes(const OutOfCoreLayout& layout) {
  Offset least = Arena::kAlignment;
  for (Index f = 0; f < layout.plan().fronts(); ++f)
    least = std::max(least, layout.factor_offset(f, 1) * layout.element_bytes());
  return least;
}

// The least budget of every device with which there is a plan, in steps of an eighth.
Offset floor_of(Candidates& candidates, const OutOfCoreLayout& layout, std::vector<OutOfCoreDevice> devices,
                Offset above) {
  Offset need = std::max(above, least_bytes(layout));
  Plans plans;
  do {
    candidates.forget();
    need += need / 8;
    for (OutOfCoreDevice& d : devices) d.budget_bytes = std::max(d.budget_bytes, need);
  } while (!make_frugal(candidates, devices, plans));
  return need;
}

}  // namespace

PlanningRates::PlanningRates(const plan::OutOfCoreRates& r, Kind kind, bool pinned)
    : bytes_in(r.bytes_in),
      bytes_out(r.bytes_out),
      host_bytes(r.host_bytes * (pinned ? r.pinned.value : 1.0)),
      flops(r.flops),
      start(r.start),
      copy_start(r.copy_start),
      chain(r.pivot.of(kind)),
      share_seconds(r.share) {}

Plans plan_out_of_core(const OutOfCoreLayout& layout, const std::vector<OutOfCoreDevice>& devices,
                       const PlanningRates& rates, base::ThreadPool* pool) {
  Candidates candidates(layout, devices, rates, pool);
  Plans best = fastest(candidates, devices, rates);
  if (!best.empty() || make_frugal(candidates, devices, best)) {
    give_tasks(layout, best);
    return best;
  }
  const auto poorest = std::min_element(devices.begin(), devices.end(),
                                        [](const auto& x, const auto& y) { return x.budget_bytes < y.budget_bytes; });
  const Offset needed = floor_of(candidates, layout, devices, poorest->budget_bytes);
  const bool several = devices.size() > 1;
  throw BudgetTooSmall(
      fmt::format(
          "the budget of {} bytes of device memory{} is below what a factorization out of core "
          "needs: {} bytes{}; give it as much with --device-memory",
          poorest->budget_bytes,
          several ? fmt::format(" (device {} of {}, counted from 0)", poorest - devices.begin(), devices.size()) : "",
          needed, several ? " on each device" : ""),
      needed);
}

}  // namespace espalier::out_of_core
