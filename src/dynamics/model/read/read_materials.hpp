/// \file
/// The materials of a model by name, and how bodies come to them.
#pragma once

#include <map>

#include "dynamics/model/description.hpp"

namespace espalier::dynamics::model {

inline constexpr const char* kNeedsMaterial =
    "needs 'material', a name of [materials] or a table { young = ..., poisson = ..., density = ... }";

/// What the readers of bodies share.
class BodyMaterials {
 public:
  /// Reads [materials]. @param model  outlives this
  BodyMaterials(Section& root, const Description& model);

  [[nodiscard]] const Description& model() const { return model_; }
  /// The material under the key `material`: a name, or a table.
  [[nodiscard]] std::optional<Material> material(Section& s);
  /// The same; an error where the key is missing.
  [[nodiscard]] Material needed(Section& s);
  /// The materials of element sets.
  void read_sets(Section& s, SolidSpec& solid);
  /// Density and the like: > 0; statics alone does without and takes 1, 0 stands for that here.
  [[nodiscard]] double inertia(Section& s, const std::string& key) const;
  /// The same as a number that bodies can be made with.
  [[nodiscard]] double noted(double density);
  /// Whether noted() has met a density that is not given since the last call.
  [[nodiscard]] bool take_massless() { return std::exchange(massless_, false); }

 private:
  [[nodiscard]] Material read_material(const Value& value) const;
  void check_material(const Section& s, const Value& value) const;
  [[nodiscard]] Material material_of(const Value& value) const;

  const Description& model_;
  std::map<std::string, Material> materials_;
  bool massless_ = false;  // the body that is being read
};

}  // namespace espalier::dynamics::model
