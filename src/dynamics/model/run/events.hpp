/// \file
/// Conditions that are watched during a run, impacts among them, and the time at which they come to hold.
#pragma once

#include <memory>

#include "dynamics/integrators/integrator.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

/// Watches the conditions of a mechanism's events. An event happens when its condition, which did not hold at the last
/// accepted state, holds at the next; at the start when it holds there.
class EventWatch {
 public:
  /// @pre mechanism.controls is not null where there are events
  EventWatch(const Description& model, Mechanism& mechanism) : model_(model), mechanism_(mechanism) {}
  [[nodiscard]] bool empty() const { return model_.events.empty() && mechanism_.impacts.empty(); }

  /// Events that happen at a state, by their numbers.
  [[nodiscard]] std::vector<std::size_t> happening(const StateView& s) const;
  /// Remembers which conditions hold; those of `happened` that come only once are spent.
  void note(const StateView& s, const std::vector<std::size_t>& happened);
  /// Whether something strikes at a state (contacts with law = "impulse").
  [[nodiscard]] bool strikes(const StateView& s) const { return !mechanism_.impacts.empty() && closing(s) >= 0; }

  /// One step of the integrator up to t_limit. Where something happens or strikes in it, it is taken again, shorter: it
  /// ends within the tolerance after the first event, in a state where its condition holds. Bracketing with secants
  /// (Illinois) on steps from the beginning of this one, so the state is that of the integrator, not one of
  /// interpolation. The integrator is replaced by a copy whenever the step is taken again.
  StepReport step(std::unique_ptr<Integrator>& integrator, double t_limit);

 private:
  /// Integrator and memories of the components at the beginning of a step.
  struct Memory {
    std::unique_ptr<Integrator> integrator;
    std::vector<double> components;
  };
  [[nodiscard]] Memory remember(const Integrator& integrator) const;
  void go_back(const Memory& memory, std::unique_ptr<Integrator>& integrator) const;
  StepReport step_again(const Memory& memory, double t, std::unique_ptr<Integrator>& integrator) const;
  /// What the search brings to zero.
  struct Watched {
    std::vector<std::size_t> events;
    bool impact = false;
  };
  [[nodiscard]] double closing(const StateView& s) const;
  [[nodiscard]] double unseen(const State& begin, const State& end) const;
  [[nodiscard]] double largest(const StateView& s, const Watched& watched) const;
  [[nodiscard]] double tolerance(const Watched& watched, double t, double step) const;

  const Description& model_;
  Mechanism& mechanism_;
};

}  // namespace espalier::dynamics::model
