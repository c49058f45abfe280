/// \file
/// What the page shows beside bodies: joints, forces and contacts, with what they exert.
#pragma once

#include <string>
#include <vector>

#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::page {

class Marks {
 public:
  Marks(const model::Mechanism& mechanism, const model::Description& model);
  /// [{"name", "what": "joint", "kind": "revolute", "between": ["rod", "piston"]}, ...] in the order of place():
  /// joints, forces, cables, pressures (what: "force"), supports, contacts. A cable is one for each of its parts; a
  /// curve on the ground has its points as "path".
  [[nodiscard]] const std::string& json() const { return json_; }
  [[nodiscard]] Index count() const { return count_; }
  /// Appends, for each: its places on the first and on the second body, its axis, force and moment on the second one;
  /// 3 numbers each. NaN where there is none.
  /// @param end  the end of the step that `s` is in: forces of contacts, which remember, are those there
  void place(const StateView& s, const StateView& end, std::vector<double>& out) const;
  /// Shapes on the ground: planes as places with normals, others as triangles.
  [[nodiscard]] std::string ground_json() const;

 private:
  struct Reaction {
    const Support* support;
    VectorFunctionPtr force, moment;
  };
  void place_pressures(const StateView& s, std::vector<double>& out) const;
  void place_supports(const StateView& s, std::vector<double>& out) const;

  const model::Mechanism& mechanism_;
  std::vector<const model::BuiltBody*> pressed_;  // of each pressure; null: what its coordinates are is not known
  std::vector<Reaction> reactions_;
  std::string json_;
  Index count_ = 0;
};

}  // namespace espalier::dynamics::page
