#include "dynamics/model/run/events.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/integrators/interpolation.hpp"

namespace espalier::dynamics::model {

std::vector<std::size_t> EventWatch::happening(const StateView& s) const {
  std::vector<std::size_t> found;
  for (std::size_t k = 0; k < model_.events.size(); ++k) {
    const Controls::Event& memory = mechanism_.controls->events[k];
    if (!memory.held && !memory.spent && mechanism_.conditions[k]->value(s) >= 0) found.push_back(k);
  }
  return found;
}

void EventWatch::note(const StateView& s, const std::vector<std::size_t>& happened) {
  for (std::size_t k = 0; k < model_.events.size(); ++k)
    mechanism_.controls->events[k].held = mechanism_.conditions[k]->value(s) >= 0;
  for (const std::size_t k : happened) {
    mechanism_.controls->events[k].held =
        true;  // its own action may have ended the condition: that counts as having been
    mechanism_.controls->events[k].spent = model_.events[k].once;
  }
}

EventWatch::Memory EventWatch::remember(const Integrator& integrator) const {
  Memory memory{integrator.clone(), {}};
  mechanism_.system.save(memory.components);
  return memory;
}

void EventWatch::go_back(const Memory& memory, std::unique_ptr<Integrator>& integrator) const {
  integrator = memory.integrator->clone();
  ConstSpan numbers = memory.components;
  mechanism_.system.restore(numbers);
}

// From the beginning of the step to t; the integrator may need more than one.
StepReport EventWatch::step_again(const Memory& memory, double t, std::unique_ptr<Integrator>& integrator) const {
  go_back(memory, integrator);
  StepReport report;
  do {
    report = integrator->step(t);
  } while (t - integrator->state().t > 4e-16 * std::abs(t));
  return report;
}

double EventWatch::closing(const StateView& s) const {
  double most = -std::numeric_limits<double>::infinity();
  for (contact::RigidContact* c : mechanism_.impacts) most = std::max(most, c->closing(s));
  return most;
}

double EventWatch::largest(const StateView& s, const Watched& watched) const {
  double most = watched.impact ? closing(s) : -std::numeric_limits<double>::infinity();
  for (const std::size_t k : watched.events) most = std::max(most, mechanism_.conditions[k]->value(s));
  return most;
}

double EventWatch::tolerance(const Watched& watched, double t, double step) const {
  double least = std::numeric_limits<double>::infinity();
  for (const std::size_t k : watched.events)
    if (model_.events[k].tolerance > 0) least = std::min(least, model_.events[k].tolerance);
  if (std::isinf(least)) least = 1e-6 * step;
  // The depth that is left is speed times this: the energy of an impact is met to it.
  constexpr double kImpact = 1e-9;
  if (watched.impact) least = std::min(least, kImpact * step);
  return std::max(least, 16 * std::numeric_limits<double>::epsilon() * std::abs(t));
}

// The share of a step at which a condition holds that holds at neither end, or something strikes.
double EventWatch::unseen(const State& begin, const State& end) const {
  const StepPath path(
      begin, end, [&](double t) { return between(mechanism_.system, begin, end, t); }, 0,
      model_.integrator.method == Method::bdf ? model_.integrator.bdf.absolute : 0);
  return first_unseen(path, [this](const StateView& s, Branches& out) {
    for (std::size_t k = 0; k < model_.events.size(); ++k)
      if (!mechanism_.controls->events[k].spent) out.push_back({.value = mechanism_.conditions[k]->value(s)});
    if (!mechanism_.impacts.empty()) out.push_back({.value = closing(s)});
  });
}

StepReport EventWatch::step(std::unique_ptr<Integrator>& integrator, double t_limit) {
  const Memory memory = remember(*integrator);
  const double begin = integrator->state().t;
  for (contact::RigidContact* c : mechanism_.impacts) {
    const double safe = begin + c->safe_time(integrator->state().view());
    if (safe > begin) t_limit = std::min(t_limit, safe);
  }
  StepReport report = integrator->step(t_limit);
  constexpr int kMostUnseen = 10;
  for (int k = 0; k < kMostUnseen; ++k) {
    const State& end = integrator->state();
    const double share = unseen(memory.integrator->state(), end);
    if (share >= 1) break;
    report = step_again(memory, begin + share * (end.t - begin), integrator);
  }
  const Watched watched{happening(integrator->state().view()), strikes(integrator->state().view())};
  if (watched.events.empty() && !watched.impact) return report;
  // Illinois: the secant between a (no condition holds) and b (one does); the weight of an end that stays is halved.
  double a = begin, b = integrator->state().t;
  double at_a = largest(memory.integrator->state().view(), watched),
         at_b = largest(integrator->state().view(), watched);
  const double wanted = tolerance(watched, b, b - a);
  double end = b;
  for (int side = 0; b - a > wanted;) {
    // A touch that has just bounced, or lies beside the one that strikes, is next to zero and tells no secant anything.
    const bool worthless = watched.impact && at_a > -1e-3 * at_b;
    const double secant = at_a < 0 && !worthless ? b - at_b * (b - a) / (at_b - at_a) : 0.5 * (a + b);
    const double t = std::clamp(std::isfinite(secant) ? secant : 0.5 * (a + b), a + 0.4 * wanted, b - 0.4 * wanted);
    report = step_again(memory, t, integrator);
    end = t;
    const double value = largest(integrator->state().view(), watched);
    if (value >= 0) {
      b = t, at_b = value;
      if (side == 1) at_a *= 0.5;
      side = 1;
    } else {
      a = t, at_a = value;
      if (side == -1) at_b *= 0.5;
      side = -1;
    }
  }
  if (end != b) report = step_again(memory, b, integrator);
  return report;
}

}  // namespace espalier::dynamics::model
