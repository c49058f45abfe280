#include "dynamics/integrators/statics/statics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/stage.hpp"
#include "dynamics/integrators/statics/relaxation.hpp"
#include "dynamics/integrators/statics/static_path.hpp"

namespace espalier::dynamics {
namespace {

const char* text_of(StaticOutcome outcome) {
  switch (outcome) {
    case StaticOutcome::not_finite:
      return "the first trial turned elements inside out or gave forces that are no numbers";
    case StaticOutcome::singular:
      return "Newton's matrix is singular";
    case StaticOutcome::no_progress:
      return "no part of Newton's step brought it nearer";
    case StaticOutcome::too_many:
      return "Newton needed too many iterations";
    case StaticOutcome::other_branch:
      return "Newton jumped to another branch";
    case StaticOutcome::converged:
      break;
  }
  return "max_steps allows no more";
}

class Statics {
 public:
  Statics(Equations& equations, State& state, const StaticsOptions& options, const StaticsObserver& observer,
          const StaticsWatch& watch)
      : options_(options),
        state_(state),
        watch_(watch),
        problem_(equations, at_rest(state), options.load),
        path_(problem_, options, observer) {
    problem_.set_watch([this](const StaticPoint& x) { check_limits(x); });
  }

  StaticsResult run() {
    StaticPoint x = problem_.start();
    if (!problem_.evaluate(x))
      throw Error(StatusCode::accuracy_not_reached, "statics: the forces on the given configuration are no numbers (" +
                                                        problem_.worst(x) +
                                                        "); its elements must not be inverted, its loads finite");
    if (options_.path == StaticPath::relaxation) return relaxed(x, "");
    if (!path_.begin()) {
      if (options_.path == StaticPath::load_steps) fail_loose();
      return relaxed(x, fmt::format("nothing holds the unloaded system ({}); ", path_.loose_end()));
    }
    const bool arrived = path_.follow();
    std::string why_not;
    if (arrived && lost_balance()) {
      if (auto better = relaxed_from_path(why_not)) return *better;  // else the end of the path shows its residual
    }
    if (arrived || path_.stopped()) {
      state_ = path_.point().state;
      return result(path_.point());
    }
    // The path breaks off where contacts let a body go that others catch: there is no equilibrium on the way.
    if (options_.path == StaticPath::automatic && path_.critical().empty()) {
      if (path_.steps() == 0) return relaxed(x, "no step of the path was possible; ");
      if (auto found = relaxed_from_path(why_not)) return *found;
      why_not.insert(0, "; from there: ");
    }
    state_ = path_.point().state;
    fail_path(why_not);
  }

 private:
  void check_limits(const StaticPoint& x) {
    const StaticPoint& last = path_.point();
    const double load = problem_.load(last), trial = problem_.load(x);
    StatusCode code = StatusCode::ok;
    if (factorizations_ == options_.max_factorizations) code = StatusCode::accuracy_not_reached;
    if (watch_ && !watch_({path_.steps(), load, trial, factorizations_, relative(x)})) code = StatusCode::cancelled;
    ++factorizations_;
    if (code == StatusCode::ok) return;
    const std::string place = problem_.worst(x);
    state_ = last.state;
    problem_.equations().system().set_load_factor(load);
    throw Error(code,
                fmt::format("{} after {} factorizations and {} steps, at load factor {:.6g} of {:.6g}; the trial at "
                            "{:.6g} has {:.3g} of the loads out of balance, most of all {}{}",
                            code == StatusCode::cancelled ? "statics was stopped" : "no static equilibrium",
                            factorizations_ - 1, path_.steps(), load, options_.load, trial, relative(x), place,
                            code == StatusCode::cancelled ? "" : "; max_factorizations allows no more" + criticals()));
  }

  static const State& at_rest(State& state) {
    std::fill(state.v.begin(), state.v.end(), 0.0);
    std::fill(state.a.begin(), state.a.end(), 0.0);
    return state;
  }

  StaticsResult result(StaticPoint x) {
    static_cast<void>(problem_.evaluate(x));  // the factor of the load, and the constraints, of this point
    StaticsResult r;
    r.steps = path_.steps();
    r.iterations = path_.iterations();
    r.load = problem_.load(x);
    r.residual = max_norm(x.motion);
    r.position = max_norm(x.phi);
    r.critical = path_.critical();
    return r;
  }

  StaticsResult relaxed(StaticPoint x, const std::string& because) {
    const RelaxationResult r = relax(problem_, x, options_);
    const std::string name = problem_.worst(x);
    if (r.runs_away)
      throw Error(
          StatusCode::accuracy_not_reached,
          fmt::format("no static equilibrium: nothing holds the system against its loads; after {} steps it had "
                      "moved many times its size, most of all {}; join it to the ground",
                      r.iterations, fastest(r.last)));
    if (!std::isfinite(relative(x)))
      throw Error(StatusCode::accuracy_not_reached,
                  fmt::format("no static equilibrium: {}the whole load gives forces that are no numbers, or whose "
                              "squares overflow, first at {}",
                              because, name));
    if (!r.converged)
      throw Error(
          StatusCode::accuracy_not_reached,
          fmt::format("no static equilibrium: {}relaxation at the whole load ended after {} steps with {:.3g} of "
                      "the loads out of balance, most of all {}; give a start nearer to it, or add damping and "
                      "let it swing down",
                      because, r.iterations, relative(x), name));
    state_ = x.state;
    path_.take(x, {1, problem_.load(x), problem_.load(x) - problem_.load(path_.point()), r.iterations, r.factorizations,
                   r.failures, relative(x), false});
    StaticsResult result = this->result(x);
    result.relaxed = true;
    return result;
  }

  /// Whether what an accepted step changes (points of contact that are made anew) has put the end out of balance.
  [[nodiscard]] bool lost_balance() {
    if (options_.path != StaticPath::automatic) return false;
    StaticPoint x = path_.point();
    return problem_.evaluate(x) && !problem_.balanced(x, kLost * options_.tolerance) && !problem_.at_rounding(x);
  }

  /// None where there is nothing to find.
  std::optional<StaticsResult> relaxed_from_path(std::string& why_not) {
    try {
      return relaxed(path_.point(), "");
    } catch (const Error& error) {
      if (error.status().code != StatusCode::accuracy_not_reached) throw;
      why_not = error.status().message;
    }
    return {};
  }

  [[nodiscard]] double relative(const StaticPoint& x) const {
    return problem_.residual(x) / std::max(problem_.reference(), 1e-300);
  }

  /// Name of the coordinate with the largest part in a motion.
  [[nodiscard]] std::string fastest(const StaticIncrement& d) const {
    const std::size_t n = state_.v.size();
    std::size_t at = 0;
    for (std::size_t i = 0; i < n; ++i)
      if (std::abs(d.x[i]) > std::abs(d.x[at])) at = i;
    return n == 0 || d.x.empty() ? "" : problem_.equations().system().coordinate_name(static_cast<Index>(at));
  }

  [[noreturn]] void fail_loose() {
    throw Error(
        StatusCode::accuracy_not_reached,
        fmt::format("no load path: nothing holds the unloaded system ({}); hold it, or let path = \"relaxation\" "
                    "find its place",
                    path_.loose_end()));
  }

  [[noreturn]] void fail_path(const std::string& more) {
    const StaticPoint& x = path_.point();
    problem_.equations().system().set_load_factor(problem_.load(x));
    throw Error(
        StatusCode::accuracy_not_reached,
        fmt::format("no static equilibrium beyond load factor {:.6g} of {:.6g} after {} steps: {} at a step of "
                    "{:.3g}{}{}{}{}",
                    problem_.load(x), options_.load, path_.steps(), text_of(path_.failure()), path_.last_try(),
                    path_.where().empty() ? "" : ", furthest out of balance ", path_.where(), criticals(), more));
  }

  [[nodiscard]] std::string criticals() const {
    std::string text;
    for (const CriticalPoint& c : path_.critical())
      text += fmt::format("{}{} at load factor {:.9g}", text.empty() ? "; " : ", ",
                          c.limit ? "limit point" : "bifurcation", c.load);
    return text;
  }

  static constexpr double kLost = 1e3;

  const StaticsOptions& options_;
  State& state_;
  const StaticsWatch& watch_;
  int factorizations_ = 0;
  StaticProblem problem_;
  StaticFollower path_;
};

}  // namespace

StaticsResult static_equilibrium(Equations& equations, State& state, const StaticsOptions& options,
                                 const StaticsObserver& observer, const StaticsWatch& watch) {
  base::Stage stage("statics", options.load, "load factor");
  const StaticsObserver told = [&](const StaticsStep& step, const State& at) {
    stage.reach(step.load);
    return !observer || observer(step, at);
  };
  return Statics(equations, state, options, told, watch).run();
}

}  // namespace espalier::dynamics
