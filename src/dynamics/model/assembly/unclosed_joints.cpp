#include "dynamics/model/assembly/unclosed_joints.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/model/assembly/nearest_positions.hpp"
#include "dynamics/model/units/unit_system.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr double kOpen = 1e-7;  // of the size of an equation's terms: far above rounding

/// Operations of one step in the search for the nearest positions, which is dense; 0: there is nothing to search.
double search_work(const System& system) {
  const double n = system.sizes().velocity, m = system.sizes().constraints;
  return m * m * n;
}
bool is_small(const System& system) {
  constexpr double kMostWork = 1e8;  // of some hundred steps: ten seconds
  return system.sizes().constraints > 0 && search_work(system) <= kMostWork;
}

bool is_length(const JointRow::Term& term) {
  if (!term.plain()) return term.rolling || term.function->is_length();
  return term.kind == Relative::global || term.kind == Relative::along || term.kind == Relative::distance;
}

class Closing {
 public:
  Closing(Mechanism& mechanism, const State& state, const std::string& units)
      : mechanism_(mechanism), state_(state), weights_(state.lambda.size(), 1.0) {
    if (mechanism.controls != nullptr) {
      const std::vector<char> absent = mechanism.controls->absent_rows(weights_.size());
      for (std::size_t i = 0; i < absent.size(); ++i)
        if (absent[i] != 0) weights_[i] = 0;
    }
    if (units.empty()) return;
    length_ = " " + UnitSystem(units).unit_of("length");
  }

  [[nodiscard]] bool closes(double t) {
    const NearestPositions found = nearest_positions(mechanism_.system, t, state_.q, weights_);
    return found.exhausted || worst_of(found) <= kOpen;  // too far to know
  }

  std::optional<std::string> explain(double t) {
    const NearestPositions all = nearest_positions(mechanism_.system, t, state_.q, weights_);
    if (worst_of(all) <= kOpen) return std::nullopt;
    // One joint left open, the others closed: does that explain it?
    constexpr double kMostTried = 24, kMostWork = 2e8;
    std::vector<const Joint*> tried = suspects(all);
    const auto most = static_cast<std::size_t>(std::clamp(kMostWork / search_work(mechanism_.system), 1.0, kMostTried));
    if (tried.size() > most) tried.resize(most);
    for (const Joint* joint : tried) {
      const NearestPositions found = nearest_positions(mechanism_.system, t, state_.q, weights_, rows_of(*joint));
      if (worst_of(found, joint) > kOpen) continue;
      if (worst_of(found) <= kOpen) return std::nullopt;  // from other positions all are closed
      return fmt::format(
          "{}. No positions satisfy all joints; with the others closed these are the nearest ({} "
          "iterations)",
          sentence(*joint, t, found), found.iterations);
    }
    std::string text;
    int count = 0;
    constexpr int kShown = 6;
    for (const Joint* joint : tried)
      if (const std::string gap = gap_of(*joint, all); !gap.empty() && ++count <= kShown)
        text += fmt::format("{}joint '{}' by {}", text.empty() ? "" : ", ", joint->name(), gap);
    return fmt::format("no positions satisfy all joints; in the nearest ({} iterations) these stay open: {}{}",
                       all.iterations, text.empty() ? worst_name(all) : text, count > kShown ? ", ..." : "");
  }

 private:
  /// Those that ask for a number first, then the later ones before the earlier ones: a loop is closed by its last.
  std::vector<const Joint*> suspects(const NearestPositions& all) const {
    std::vector<const Joint*> list;
    for (const Joint* joint : mechanism_.joints)
      if (!gap_of(*joint, all).empty()) list.push_back(joint);
    std::reverse(list.begin(), list.end());
    std::stable_partition(list.begin(), list.end(), [](const Joint* joint) { return asks_for_number(*joint); });
    return list;
  }

  static bool asks_for_number(const Joint& joint) {
    return std::any_of(joint.rows().begin(), joint.rows().end(),
                       [](const JointRow& row) { return row.driven || row.terms.front().kind == Relative::distance; });
  }
  /// Its row that does.
  static std::optional<std::size_t> asked_row(const Joint& joint) {
    for (std::size_t r = 0; r < joint.rows().size(); ++r)
      if (joint.rows()[r].driven || joint.rows()[r].terms.front().kind == Relative::distance) return r;
    return std::nullopt;
  }

  [[nodiscard]] static RowRange rows_of(const Joint& joint) { return {at(joint.placement().c), joint.rows().size()}; }
  [[nodiscard]] static std::size_t first_row(const Joint& joint) { return rows_of(joint).first; }

  /// The largest relative violation, but for one joint.
  [[nodiscard]] double worst_of(const NearestPositions& found, const Joint* but = nullptr) const {
    double worst = 0;
    for (std::size_t i = 0; i < found.part.size(); ++i) {
      if (weights_[i] == 0) continue;
      if (but != nullptr && rows_of(*but).has(i)) continue;
      if (!(found.part[i] <= worst)) worst = found.part[i];
    }
    return worst;
  }

  [[nodiscard]] std::string worst_name(const NearestPositions& found) const {
    std::size_t worst = 0;
    for (std::size_t i = 0; i < found.part.size(); ++i)
      if (weights_[i] != 0 && found.part[i] > found.part[worst]) worst = i;
    return fmt::format("{} by {:.4g}", mechanism_.system.constraint_name(static_cast<Index>(worst)),
                       std::abs(found.phi[worst]));
  }

  /// "0.2 m and 0.1 rad"; empty where it is closed.
  [[nodiscard]] std::string gap_of(const Joint& joint, const NearestPositions& found) const {
    double lengths = 0, turns = 0;
    bool open = false;
    for (std::size_t r = 0; r < joint.rows().size(); ++r) {
      const std::size_t i = first_row(joint) + r;
      if (weights_[i] == 0) continue;
      open = open || found.part[i] > kOpen;
      const JointRow::Term& term = joint.rows()[r].terms.front();
      (is_length(term) ? lengths : turns) += found.phi[i] * found.phi[i];
    }
    if (!open) return "";
    lengths = std::sqrt(lengths), turns = std::sqrt(turns);
    const double shown = 1e-6 * std::max(lengths, turns);
    std::string text;
    if (lengths > shown) text = fmt::format("{:.4g}{}", lengths, length_);
    if (turns > shown) text += fmt::format("{}{:.4g} rad", text.empty() ? "" : " and ", turns);
    return text;
  }

  [[nodiscard]] std::string sentence(const Joint& joint, double t, const NearestPositions& found) const {
    const std::optional<std::size_t> row = asked_row(joint);
    if (row && joint.rows().size() == 1 && joint.rows()[0].terms.size() == 1) {
      const JointRow& asks = joint.rows()[*row];
      const bool length = is_length(asks.terms.front());
      const double missing = found.phi[first_row(joint) + *row];
      const double asked = asks.driven ? asks.offset + asks.function.value(t)
                                       : joint.coordinate(found.q, static_cast<int>(*row)) - missing;
      const std::string unit = length ? length_ : " rad", what = length ? "a displacement of" : "an angle of";
      return fmt::format("joint '{}': {} {:.6g}{} is asked{}, the mechanism reaches {:.6g}{} ({:.4g}{} missing)",
                         joint.name(), asks.driven ? what : "length", asked, unit,
                         asks.driven ? fmt::format(" at t = {:.6g}", t) : "", asked + missing, unit, std::abs(missing),
                         unit);
    }
    return fmt::format("joint '{}' stays open by {}", joint.name(), gap_of(joint, found));
  }

  Mechanism& mechanism_;
  const State& state_;
  std::vector<double> weights_;
  std::string length_;
};

bool is_led(const Mechanism& mechanism) {
  return !mechanism.supports.empty() ||
         std::any_of(mechanism.joints.begin(), mechanism.joints.end(), [](const Joint* joint) {
           return std::any_of(joint->rows().begin(), joint->rows().end(),
                              [](const JointRow& row) { return row.driven; });
         });
}

}  // namespace

std::optional<std::string> unclosed_joints(Mechanism& mechanism, const State& state, const std::string& units) {
  if (!is_small(mechanism.system)) return std::nullopt;
  return Closing(mechanism, state, units).explain(state.t);
}

std::optional<std::string> unreached_motion(Mechanism& mechanism, const State& state, double until,
                                            const std::string& units) {
  if (!is_small(mechanism.system) || !is_led(mechanism) || !(until > state.t) || !std::isfinite(until))
    return std::nullopt;
  Closing closing(mechanism, state, units);
  // Just ahead: what lies far ahead is reached, or not, from other positions.
  for (const double part : {1e-4, 1e-3, 1e-2}) {
    double good = state.t, bad = state.t + part * (until - state.t);
    if (closing.closes(bad)) continue;
    constexpr int kHalvings = 20;
    for (int k = 0; k < kHalvings; ++k) {
      const double middle = 0.5 * (good + bad);
      (closing.closes(middle) ? good : bad) = middle;
    }
    const double ahead = state.t + part * (until - state.t);
    const std::optional<std::string> why = closing.explain(ahead);
    if (!why) return std::nullopt;
    return fmt::format("from t = {:.6g} on the mechanism cannot follow what leads it: {}", good, *why);
  }
  return std::nullopt;
}

}  // namespace espalier::dynamics::model
