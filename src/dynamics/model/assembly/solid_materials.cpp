#include "dynamics/model/assembly/solid_materials.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "base/at.hpp"
#include "dynamics/mesh/names.hpp"

namespace espalier::dynamics::model {
namespace {

[[noreturn]] void refuse_material(const std::string& message) { throw Error(StatusCode::invalid_input, message); }

/// Elements of a mesh and the set that gave each its material.
class MaterialsOfSets {
 public:
  explicit MaterialsOfSets(const Mesh& mesh) : mesh_(mesh), of_(at(mesh.element_count()), -1) {}

  void give(const std::string& set, const std::vector<Index>& elements, Index material) {
    const auto number = static_cast<Index>(sets_.size());
    sets_.push_back({set, material});
    for (const Index e : elements) {
      if (Index& of = of_[at(e)]; of < 0) {
        of = number;
      } else if (sets_[at(of)].second != material) {
        refuse_material(fmt::format("element {} lies in the sets '{}' and '{}', which are of different materials",
                                    element_name(mesh_, e), sets_[at(of)].first, set));
      }
    }
  }
  [[nodiscard]] Index material(Index element) const {
    return of_[at(element)] < 0 ? -1 : sets_[at(of_[at(element)])].second;
  }

 private:
  const Mesh& mesh_;
  std::vector<Index> of_;                            // place in sets_, or -1
  std::vector<std::pair<std::string, Index>> sets_;  // with their materials
};

/// As the mesh file states it.
Material stated_material(const Mesh& mesh, const std::string& name, bool statics, bool& massless) {
  std::string lacks;
  for (const MeshMaterial& m : mesh.materials) {
    if (m.name != name) continue;
    if (m.young > 0 && (m.density > 0 || statics)) {
      massless = massless || !(m.density > 0);
      return {SolidLaw::st_venant_kirchhoff, m.young, m.poisson, m.density > 0 ? m.density : 1};
    }
    lacks = m.young > 0 ? "a density" : m.density > 0 ? "Young's modulus" : "Young's modulus and density";
  }
  std::string text =
      fmt::format("needs 'material': the mesh file states {}",
                  lacks.empty() ? "none of the name '" + name + "'" : fmt::format("'{}' without {}", name, lacks));
  for (const std::string& notice : mesh.notices)  // why
    if (notice.find("material " + name + ":") != std::string::npos) text += "; " + notice;
  refuse_material(text);
}

/// Materials of the mesh's sections; where all are of one, other elements are of it, too.
class MaterialSections {
 public:
  explicit MaterialSections(const Mesh& mesh) : of_(mesh) {
    for (const auto& [set, name] : mesh.section_material) {
      const auto number = static_cast<Index>(std::find(names_.begin(), names_.end(), name) - names_.begin());
      if (at(number) == names_.size()) names_.push_back(name);
      if (const auto elements = find_named(mesh.element_sets, set); elements != mesh.element_sets.end())
        of_.give(set, elements->second, number);
    }
  }
  /// -1: none.
  [[nodiscard]] Index material(Index element) const {
    const Index own = of_.material(element);
    return own < 0 && names_.size() == 1 ? 0 : own;
  }
  [[nodiscard]] const std::vector<std::string>& names() const { return names_; }

 private:
  MaterialsOfSets of_;
  std::vector<std::string> names_;
};

}  // namespace

ElementMaterials solid_materials(const Mesh& mesh, const SolidSpec& solid, std::span<const Index> elements,
                                 bool statics, bool& massless) {
  if (solid.material && solid.set_materials.empty()) return {{*solid.material}};
  std::vector<Index> all;
  if (elements.empty()) {
    all.resize(at(mesh.element_count()));
    std::iota(all.begin(), all.end(), 0);
    elements = all;
  }
  const MaterialSections sections(mesh);
  MaterialsOfSets given(mesh);  // by the text
  ElementMaterials out;
  for (const auto& [set, material] : solid.set_materials) {
    const auto found = find_named(mesh.element_sets, set);
    if (found == mesh.element_sets.end()) {
      std::vector<std::string> names;
      for (const auto& [name, list] : mesh.element_sets) names.push_back(name);
      refuse_material(fmt::format("'materials': the mesh has no element set '{}'{}", set, suggestion(set, names)));
    }
    if (std::none_of(elements.begin(), elements.end(),
                     [&](Index e) { return std::binary_search(found->second.begin(), found->second.end(), e); }))
      refuse_material(fmt::format("'materials': no element of the body lies in the set '{}'", set));
    given.give(set, found->second, static_cast<Index>(out.list.size()));
    out.list.push_back(material);
  }
  if (sections.names().empty() && out.list.empty()) refuse_material("needs 'material': the mesh file states none");
  const auto rest = static_cast<Index>(out.list.size());
  if (solid.material) out.list.push_back(*solid.material);
  std::vector<Index> place(sections.names().size(), -1);  // of the sections' materials in the list
  out.of.assign(at(mesh.element_count()), 0);
  for (const Index e : elements) {
    if (const Index of_text = given.material(e); of_text >= 0 || solid.material) {
      out.of[at(e)] = of_text >= 0 ? of_text : rest;
      continue;
    }
    const Index own = sections.material(e);
    if (own < 0)
      refuse_material(
          fmt::format("needs 'material': element {} lies in none of the sets that have one", element_name(mesh, e)));
    if (place[at(own)] < 0) {
      place[at(own)] = static_cast<Index>(out.list.size());
      out.list.push_back(stated_material(mesh, sections.names()[at(own)], statics, massless));
    }
    out.of[at(e)] = place[at(own)];
  }
  if (out.list.size() == 1) out.of.clear();
  return out;
}

ElementMaterials materials_of(const BuiltBody& body) {
  std::vector<Index> solids;
  for (Index e = 0; e < body.mesh->element_count(); ++e)
    if (is_simulated_solid(body.mesh->type(e))) solids.push_back(e);
  const auto& solid = std::get<SolidSpec>(body.spec.shape);
  if (!solid.material && !solid.element_set.empty()) {  // where all elements of the mesh are there still
    std::vector<Index> chosen = body.mesh->element_sets.contains(solid.element_set)
                                    ? body.mesh->element_set(solid.element_set)
                                    : std::vector<Index>();
    std::erase_if(solids,
                  [&](Index e) { return !chosen.empty() && !std::binary_search(chosen.begin(), chosen.end(), e); });
  }
  bool massless = false;
  return solid_materials(*body.mesh, solid, solids, true, massless);
}

}  // namespace espalier::dynamics::model
