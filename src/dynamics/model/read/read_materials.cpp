#include "dynamics/model/read/read_materials.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace espalier::dynamics::model {

BodyMaterials::BodyMaterials(Section& root, const Description& model) : model_(model) {
  root.named("materials",
             [&](const std::string& name, const Value& value) { materials_[name] = read_material(value); });
}

Material BodyMaterials::read_material(const Value& value) const {
  Section s(value);
  Material m;
  check_material(s, value);
  m.law = s.one_of("law", kSolidLaws, m.law);
  m.young = s.positive("young");
  m.poisson = s.number("poisson", 0);
  if (!(m.poisson > -1 && m.poisson < 0.5))
    fail(s.place("poisson"), fmt::format("must lie in (-1, 0.5), not {}", m.poisson));
  m.density = inertia(s, "density");
  s.finish();
  return m;
}

/// All that a material lacks in one message; what is misspelt is told where it is read.
void BodyMaterials::check_material(const Section& s, const Value& value) const {
  const std::vector<std::string> known = {"law", "young", "poisson", "density"};
  for (const auto& entry : value.entries)
    if (std::find(known.begin(), known.end(), entry.first) == known.end()) return;
  std::string lacks;
  if (!s.has("young")) lacks = "'young' (Young's modulus)";
  if (!s.has("density") && !model_.statics)
    lacks += fmt::format(
        "{}'density' (mass over volume; only statics does without: [statics] instead of a motion, and "
        "no gravity)",
        lacks.empty() ? "" : " and ");
  if (!lacks.empty()) fail(s.place(), fmt::format("the material needs {}", lacks));
}

double BodyMaterials::inertia(Section& s, const std::string& key) const {
  if (s.has(key)) return s.positive(key);
  if (!model_.statics)
    fail(s.place(), fmt::format("needs '{}', a number greater than 0 (only statics does without: [statics] instead of "
                                "a motion, and no gravity)",
                                key));
  return 0;
}

double BodyMaterials::noted(double density) {
  massless_ = massless_ || density == 0;
  return density == 0 ? 1 : density;
}

std::optional<Material> BodyMaterials::material(Section& s) {
  const Value* value = s.value("material");
  if (value == nullptr) return std::nullopt;
  Material found = material_of(*value);
  found.density = noted(found.density);
  return found;
}

Material BodyMaterials::material_of(const Value& value) const {
  if (value.type != Value::Type::text) return read_material(value);
  const auto it = materials_.find(value.text);
  if (it != materials_.end()) return it->second;
  std::vector<std::string> names;
  for (const auto& [name, m] : materials_) names.push_back(name);
  fail(value.place, fmt::format("unknown material '{}'{}", value.text, suggestion(value.text, names)));
}

Material BodyMaterials::needed(Section& s) {
  const auto found = material(s);
  if (!found) fail(s.place(), kNeedsMaterial);
  return *found;
}

void BodyMaterials::read_sets(Section& s, SolidSpec& solid) {
  const Value* table = s.value("materials");
  if (table == nullptr) return;
  if (!table->is_table() || table->entries.empty())
    fail(table->place, "must be a table: { SET = \"steel\", OTHER = { young = ..., poisson = ..., density = ... } }");
  for (const auto& [set, value] : table->entries) {
    solid.set_materials.emplace_back(set, material_of(value));
    Material& made = solid.set_materials.back().second;
    made.density = noted(made.density);
  }
}

}  // namespace espalier::dynamics::model
