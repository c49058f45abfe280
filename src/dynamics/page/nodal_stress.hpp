/// \file
/// Stress and strain at the surface of solids, for colours.
#pragma once

#include <memory>
#include <vector>

#include "dynamics/model/fields/sampled_body.hpp"
#include "dynamics/page/drawn.hpp"
#include "espalier/dynamics.hpp"

namespace espalier::dynamics::page {

/// At the nodes of outer faces what the quantities BODY[node ...].stress and .strain are: the mean of what the elements
/// around a node say, which are sampled where their stresses are best (model/fields).
class NodalStress {
 public:
  NodalStress(const model::Mechanism& mechanism, const Drawn& drawn);
  [[nodiscard]] bool empty() const { return bodies_.empty(); }

  /// What has to be kept of a state until evaluate().
  struct Kept {
    std::vector<double> q;
    std::vector<double> tensors;            ///< in linear statics, where these are linear in the loads, not in q
    std::vector<std::vector<char>> failed;  ///< of each solid, as ElementAssembly::failed()
  };
  [[nodiscard]] Kept keep(const State& s) const;

  /// At all points of flexible bodies; NaN on those that are no solids.
  struct Values {
    std::vector<double> von_mises;
    std::vector<double> principal;  ///< stress of the largest magnitude, with its sign
    std::vector<double> strain;     ///< likewise
  };
  /// May run beside the simulation.
  [[nodiscard]] Values evaluate(const Kept& kept) const;

  /// The point of the largest von Mises stress of each solid.
  struct Peak {
    double value = 0;
    std::size_t point = 0;  ///< of the solid; of those without a number: none
    bool found = false;
  };
  [[nodiscard]] std::vector<Peak> peaks(const Values& values) const;
  [[nodiscard]] SimulationExtreme describe(std::size_t solid, const Peak& peak, double t) const;

 private:
  struct Solid {
    const model::BuiltBody* body;
    std::unique_ptr<const model::SampledBody> samples;
    std::size_t first_point;      // among those of flexible bodies
    std::vector<Index> nodes;     // of each point
    std::vector<Index> elements;  // with a node that is drawn
    std::vector<Index> point_of;  // of the nodes of those, one element after the other; -1: it is not drawn
  };
  /// What stands at a node is the mean of what has not failed around it. @param failed  see Kept; may be empty
  [[nodiscard]] std::vector<double> tensors(const State& s, const std::vector<std::vector<char>>& failed) const;

  const model::Mechanism& mechanism_;
  std::vector<Solid> bodies_;
  std::size_t points_ = 0;
};

}  // namespace espalier::dynamics::page
