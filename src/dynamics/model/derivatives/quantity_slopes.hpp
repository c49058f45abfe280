/// \file
/// Derivatives of quantities by the state that they are looked at in.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dynamics/integrators/derivatives/step_adjoint.hpp"
#include "dynamics/model/output/quantities.hpp"
#include "dynamics/model/output/scene.hpp"

namespace espalier::dynamics::model {

/// Central differences of fourth order by each number of the state that a quantity depends on. These are found by
/// bisection: a move of all other ones changes no bit of it. What was found for a quantity is tried first in the next
/// state, so that a number of a few bodies costs a few evaluations.
class QuantitySlopes {
 public:
  /// @param rows  constraints that are kept @param load  of an equilibrium, where positions and multipliers alone count
  QuantitySlopes(Mechanism& mechanism, std::vector<Index> rows, std::optional<double> load);

  [[nodiscard]] double value(const Quantity& quantity, const State& state) const;
  /// @throws Error where the quantity is no number beside the state
  [[nodiscard]] StateSlopes at(const Quantity& quantity, const State& state);
  /// The factor with which dq (n numbers) moves the fastest point by the extent of the model; 0 where dq is zero.
  [[nodiscard]] double extent_along(const State& state, const std::vector<double>& dq);
  /// The move of each of the n coordinates by which differences are made. @param coordinates  for which it is found,
  /// any of them more than once; the others get some number
  [[nodiscard]] std::vector<double> steps(const State& state, std::span<const Index> coordinates);

 private:
  /// Numbers of the state as one list: dq, v, a, multipliers of the kept rows.
  struct StateRange {
    std::size_t first, last;
    double size;  // the largest value; of dq: 0, the extent of the model counts
  };
  [[nodiscard]] std::vector<StateRange> parts(const State& state) const;
  [[nodiscard]] State moved(const State& state, const std::vector<double>& step) const;
  [[nodiscard]] bool changes(const Quantity& quantity, const State& state, const std::vector<double>& amounts);
  void find_support(const Quantity& quantity, const State& state, std::size_t first, std::size_t last,
                    std::vector<std::size_t>& found);
  [[nodiscard]] const std::vector<std::size_t>& support(const Quantity& quantity, const State& state);

  Mechanism& mechanism_;
  std::vector<Index> rows_;
  std::optional<double> load_;
  std::size_t n_;
  Scene scene_;
  std::map<std::string, std::vector<std::size_t>> support_;  // by name
};

}  // namespace espalier::dynamics::model
