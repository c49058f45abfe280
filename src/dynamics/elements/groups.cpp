#include "dynamics/elements/groups.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <stdexcept>

#include "base/at.hpp"
#include "base/parallel.hpp"
#include "dynamics/elements/ancf_shell.hpp"
#include "dynamics/elements/device_law.hpp"
#include "dynamics/elements/lanes/hex8_block.hpp"
#include "dynamics/elements/lanes/solid_block.hpp"
#include "dynamics/elements/solid.hpp"
#include "dynamics/elements/solid_parts.hpp"
#include "dynamics/mesh/names.hpp"

namespace espalier::dynamics {
namespace {

class SolidGroup final : public ElementGroup {
 public:
  SolidGroup(ElementType type, const Material& material, const SolidOptions& options)
      : type_(type), material_(material), options_(options), nodes_(shape_of(type).nodes) {
    assumed_strain_ = type == ElementType::hex8 && options.hex8 != Hex8Formulation::full;
    if (!assumed_strain_)
      solid_ = vector_solid_kernels();
    else
      hex8_ = vector_hex8_kernel();
    hexahedra_ = law_of(options.hex8, material);
    if (assumed_strain_)
      law_.of_kind = hexahedra_;
    else
      law_.of_kind = SolidElements{type, rule(), {hexahedra_.neo_hookean, hexahedra_.lambda, hexahedra_.mu}};
  }
  void add(std::span<const Index> nodes, std::int64_t label) {
    connectivity_.insert(connectivity_.end(), nodes.begin(), nodes.end());
    labels_.push_back(label);
  }
  [[nodiscard]] Index count() const override { return static_cast<Index>(labels_.size()); }
  [[nodiscard]] int vertices_per_element() const override { return nodes_; }
  [[nodiscard]] std::span<const Index> vertices(Index e) const override {
    return std::span(connectivity_).subspan(static_cast<std::size_t>(e) * nodes_, nodes_);
  }
  [[nodiscard]] bool evaluate(Index, const ElementInput& in, ElementOutput& out) const override {
    if (assumed_strain_) return evaluate_hex8(options_.hex8, material_, in, out);
    return evaluate_solid(type_, rule(), material_, in, out);
  }
  [[nodiscard]] int width() const override { return assumed_strain_ ? hex8_.width : solid_.width; }
  [[nodiscard]] unsigned evaluate_block(const BlockInput& in, const BlockOutput& out) const override {
    if (!assumed_strain_) return evaluate_solid_block(solid_, type_, rule(), material_, in, out);
    return hex8_.evaluate(hexahedra_, in, out);
  }
  [[nodiscard]] const DeviceLaw* device_law() const override { return &law_; }
  [[nodiscard]] const Material& material() const { return material_; }
  void mass(Index, const double* reference, double* m) const override {
    solid_mass(type_, material_.density, reference, m);
  }
  [[nodiscard]] SamplePoints sample_points() const override { return solid_samples(type_); }
  [[nodiscard]] bool sample(Index, const double* reference, const double* position,
                            ElementSamples& out) const override {
    if (assumed_strain_) return sample_hex8(options_.hex8, material_, reference, position, out);
    return sample_solid(type_, reference, position, out);
  }
  [[nodiscard]] std::int64_t label(Index e) const override { return labels_[at(e)]; }

 private:
  [[nodiscard]] Rule rule() const { return options_.reduced_hex20 ? Rule::reduced : Rule::stiffness; }

  ElementType type_;
  Material material_;
  SolidOptions options_;
  int nodes_;
  bool assumed_strain_ = false;
  Hex8Law hexahedra_;
  DeviceLaw law_;
  SolidKernels solid_;
  Hex8Kernel hex8_;
  std::vector<Index> connectivity_;
  std::vector<std::int64_t> labels_;
};

/// Elements with their vertices given one by one.
template <int kVertices>
class VertexGroup : public ElementGroup {
 public:
  [[nodiscard]] Index count() const override { return static_cast<Index>(vertices_.size()); }
  [[nodiscard]] int vertices_per_element() const override { return kVertices; }
  [[nodiscard]] std::span<const Index> vertices(Index e) const override { return vertices_[at(e)]; }

 protected:
  std::vector<std::array<Index, kVertices>> vertices_;
};

/// A chain of line elements with kPerNode vertices per node.
template <int kPerNode>
class ChainGroup : public VertexGroup<2 * kPerNode> {
 public:
  ChainGroup(const std::vector<Index>& nodes, std::vector<double> length, std::vector<std::int64_t> labels)
      : length_(std::move(length)), labels_(std::move(labels)) {
    if (nodes.size() != length_.size() + 1)
      throw std::invalid_argument(fmt::format("chain of line elements: {} nodes need {} lengths, got {}", nodes.size(),
                                              nodes.size() - 1, length_.size()));
    for (std::size_t e = 0; e < length_.size(); ++e) {
      if (!(length_[e] > 0))
        throw std::invalid_argument(fmt::format("line element {}: its length {} is not positive", e + 1, length_[e]));
      std::array<Index, 2 * kPerNode> vertices{};
      for (int k = 0; k < kPerNode; ++k) {
        vertices[at(k)] = kPerNode * nodes[e] + k;
        vertices[at(kPerNode + k)] = kPerNode * nodes[e + 1] + k;
      }
      this->vertices_.push_back(vertices);
    }
  }
  [[nodiscard]] std::int64_t label(Index e) const override { return labels_.empty() ? e + 1 : labels_[at(e)]; }

 protected:
  [[nodiscard]] double length(Index e) const { return length_[at(e)]; }
  /// That of all elements, or 0: they differ.
  [[nodiscard]] double common_length() const {
    const bool equal = std::adjacent_find(length_.begin(), length_.end(), std::not_equal_to<>()) == length_.end();
    return equal && !length_.empty() ? length_.front() : 0;
  }

 private:
  std::vector<double> length_;
  std::vector<std::int64_t> labels_;
};

class CableGroup final : public ChainGroup<2> {
 public:
  CableGroup(const CableSection& section, const std::vector<Index>& nodes, std::vector<double> length,
             std::vector<std::int64_t> labels)
      : ChainGroup(nodes, std::move(length), std::move(labels)), section_(section), kernel_(vector_cable_kernel()) {
    cables_ = {section, common_length()};
    law_.of_kind = cables_;
  }
  [[nodiscard]] bool evaluate(Index e, const ElementInput& in, ElementOutput& out) const override {
    return evaluate_cable(section_, length(e), in, out);
  }
  // Kernels know one length.
  [[nodiscard]] int width() const override { return cables_.length > 0 ? kernel_.width : 1; }
  [[nodiscard]] unsigned evaluate_block(const BlockInput& in, const BlockOutput& out) const override {
    return kernel_.evaluate(cables_, in, out);
  }
  [[nodiscard]] const DeviceLaw* device_law() const override { return cables_.length > 0 ? &law_ : nullptr; }
  void mass(Index e, const double*, double* m) const override { cable_mass(section_, length(e), m); }
  [[nodiscard]] SamplePoints sample_points() const override { return SamplePoints::line; }
  [[nodiscard]] bool sample(Index e, const double*, const double* position, ElementSamples& out) const override {
    return sample_cable(section_, length(e), position, out);
  }

 private:
  CableSection section_;
  CableKernel kernel_;
  CableLaw cables_;
  DeviceLaw law_;
};

class BeamGroup final : public ChainGroup<4> {
 public:
  BeamGroup(const BeamSection& section, const std::vector<Index>& nodes, std::vector<double> length,
            std::vector<std::int64_t> labels)
      : ChainGroup(nodes, std::move(length), std::move(labels)), section_(section) {}
  [[nodiscard]] bool evaluate(Index e, const ElementInput& in, ElementOutput& out) const override {
    return evaluate_beam(section_, length(e), in, out);
  }
  void mass(Index e, const double*, double* m) const override { beam_mass(section_, length(e), m); }
  [[nodiscard]] SamplePoints sample_points() const override { return SamplePoints::line; }
  [[nodiscard]] bool sample(Index e, const double* reference, const double* position,
                            ElementSamples& out) const override {
    return sample_beam(section_, length(e), reference, position, out);
  }

 private:
  BeamSection section_;
};

class ShellGroup final : public VertexGroup<8> {
 public:
  ShellGroup(const Material& material, double thickness, const std::vector<std::array<Index, 4>>& quads)
      : material_(material), thickness_(thickness), kernel_(vector_shell_kernel()) {
    check_material(material);
    if (!(thickness > 0)) throw std::invalid_argument(fmt::format("shell: thickness {} is not positive", thickness));
    for (const auto& quad : quads) {
      std::array<Index, 8> vertices{};
      for (std::size_t a = 0; a < 4; ++a) {
        vertices[2 * a] = 2 * quad[a];
        vertices[2 * a + 1] = 2 * quad[a] + 1;
      }
      vertices_.push_back(vertices);
    }
    shells_ = {law_of(Hex8Formulation::shell, material), thickness};
    law_.of_kind = shells_;
  }
  [[nodiscard]] bool evaluate(Index, const ElementInput& in, ElementOutput& out) const override {
    return evaluate_shell(material_, thickness_, in, out);
  }
  [[nodiscard]] int width() const override { return kernel_.width; }
  [[nodiscard]] unsigned evaluate_block(const BlockInput& in, const BlockOutput& out) const override {
    return kernel_.evaluate(shells_, in, out);
  }
  [[nodiscard]] const DeviceLaw* device_law() const override { return &law_; }
  void mass(Index, const double* reference, double* m) const override {
    shell_mass(material_.density, thickness_, reference, m);
  }
  [[nodiscard]] SamplePoints sample_points() const override { return SamplePoints::hexahedron; }
  [[nodiscard]] bool sample(Index, const double* reference, const double* position,
                            ElementSamples& out) const override {
    return sample_shell(material_, thickness_, reference, position, out);
  }

 private:
  Material material_;
  double thickness_;
  ShellKernel kernel_;
  ShellLaw shells_;
  DeviceLaw law_;
};

std::vector<Index> all_if_empty(const Mesh& mesh, std::span<const Index> elements) {
  if (!elements.empty()) return {elements.begin(), elements.end()};
  std::vector<Index> all(static_cast<std::size_t>(mesh.element_count()));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

/// Corners of an element that are one place, as "; its nodes 3 and 4 are one place: ..."; empty: there are none.
std::string collapsed_corners(const Mesh& mesh, Index element) {
  const auto nodes = mesh.element(element).first(static_cast<std::size_t>(shape_of(mesh.type(element)).corners));
  for (std::size_t a = 0; a < nodes.size(); ++a)
    for (std::size_t b = a + 1; b < nodes.size(); ++b)
      if (nodes[a] == nodes[b] || mesh.nodes[at(nodes[a])] == mesh.nodes[at(nodes[b])])
        return fmt::format("its corners {} and {} (nodes {} and {}) are one place", a + 1, b + 1,
                           node_name(mesh, nodes[a]), node_name(mesh, nodes[b]));
  return "";
}

/// "hexahedron", "tetrahedron" or "wedge".
#define ESPALIER_NAME(kind, nodes, points) ", " #kind
constexpr char kSolids[] = ESPALIER_FOR_SOLIDS(ESPALIER_NAME);
#undef ESPALIER_NAME

const char* solid_word(ElementType type) {
  return shape_of(type).corners == 8 ? "hexahedron" : shape_of(type).corners == 4 ? "tetrahedron" : "wedge";
}

// The elements are solids that are simulated, none of them inside out.
void check_elements(const Mesh& mesh, std::span<const Index> elements, base::ThreadPool* pool) {
  for (const Index e : elements)
    if (!is_simulated_solid(mesh.type(e)))
      throw Error(StatusCode::invalid_input,
                  fmt::format("mesh '{}', element {}: {} is not simulated ({} are)", mesh.name, mesh.element_label(e),
                              shape_of(mesh.type(e)).name, &kSolids[2]));
  const std::vector<SmallestJacobian> found = smallest_jacobians(mesh, elements, pool);
  for (std::size_t k = 0; k < found.size(); ++k)
    if (const double det = found[k].points; !(det > 0)) {
      if (const std::string corners = collapsed_corners(mesh, elements[k]); !corners.empty())
        throw Error(StatusCode::invalid_input,
                    fmt::format("mesh '{}', element {} ({}) is a collapsed {}: {}; mesh that place with tet10, or with "
                                "hexahedra of eight different corners",
                                mesh.name, element_name(mesh, elements[k]), shape_of(mesh.type(elements[k])).name,
                                solid_word(mesh.type(elements[k])), corners));
      throw Error(StatusCode::invalid_input,
                  fmt::format("mesh '{}', element {} ({}) is inverted or folded: smallest Jacobian determinant {:.3g} "
                              "at its integration points; check the order of its nodes and their coordinates",
                              mesh.name, element_name(mesh, elements[k]), shape_of(mesh.type(elements[k])).name, det));
    }
}

}  // namespace

std::vector<SmallestJacobian> smallest_jacobians(const Mesh& mesh, std::span<const Index> elements,
                                                 base::ThreadPool* pool) {
  constexpr std::int64_t kElements = 256;  // some 0.3 ms
  const std::int64_t count = elements.empty() ? mesh.element_count() : static_cast<std::int64_t>(elements.size());
  std::vector<SmallestJacobian> found(static_cast<std::size_t>(count));
  base::for_each_range(pool, count, kElements, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
      const Index e = elements.empty() ? static_cast<Index>(k) : elements[k];
      double x[3 * kMaxElementNodes];
      const auto nodes = mesh.element(e);
      for (std::size_t a = 0; a < nodes.size(); ++a)
        for (std::size_t i = 0; i < 3; ++i) x[3 * a + i] = mesh.nodes[at(nodes[a])][i];
      found[k] = smallest_jacobian(mesh.type(e), x);
    }
  });
  return found;
}

std::vector<std::unique_ptr<ElementGroup>> make_solid_groups(const Mesh& mesh, std::span<const Index> elements,
                                                             const Material& material, const SolidOptions& options,
                                                             base::ThreadPool* pool) {
  return make_solid_groups(mesh, elements, ElementMaterials{{material}}, options, pool);
}

std::vector<std::unique_ptr<ElementGroup>> make_solid_groups(const Mesh& mesh, std::span<const Index> elements,
                                                             const ElementMaterials& materials,
                                                             const SolidOptions& options, base::ThreadPool* pool) {
  for (const Material& material : materials.list) check_material(material);
  const std::vector<Index> chosen = all_if_empty(mesh, elements);
  check_elements(mesh, chosen, pool);
  std::vector<std::array<std::unique_ptr<SolidGroup>, kElementTypes>> made(materials.list.size());
  for (const Index e : chosen) {
    const Material& material = materials.at(e);
    auto& group = made[at(&material - materials.list.data())][static_cast<std::size_t>(mesh.type(e))];
    if (!group) group = std::make_unique<SolidGroup>(mesh.type(e), material, options);
    group->add(mesh.element(e), mesh.element_label(e));
  }
  std::vector<std::unique_ptr<ElementGroup>> groups;
  for (auto& of_material : made)
    for (auto& group : of_material)
      if (group) groups.push_back(std::move(group));
  return groups;
}

const Material* material_of(const ElementGroup& group) {
  const auto* solid = dynamic_cast<const SolidGroup*>(&group);
  return solid == nullptr ? nullptr : &solid->material();
}

std::string corner_folds(const Mesh& mesh, std::span<const Index> elements, base::ThreadPool* pool) {
  const std::vector<Index> chosen = all_if_empty(mesh, elements);
  const std::vector<SmallestJacobian> found = smallest_jacobians(mesh, chosen, pool);
  std::vector<Index> folded, collapsed;
  for (std::size_t k = 0; k < found.size(); ++k)
    if (!(found[k].corners > 0)) (collapsed_corners(mesh, chosen[k]).empty() ? folded : collapsed).push_back(chosen[k]);
  std::string text;
  const auto number = [](const std::vector<Index>& of) {
    return of.size() == 1 ? "one element" : fmt::format("{} elements", of.size());
  };
  if (!collapsed.empty())
    text = fmt::format(
        "mesh '{}': {} collapsed, the first is element {}, a {}: {}; strains near such corners are doubtful", mesh.name,
        collapsed.size() == 1 ? "one element is" : fmt::format("{} elements are", collapsed.size()),
        element_name(mesh, collapsed.front()), solid_word(mesh.type(collapsed.front())),
        collapsed_corners(mesh, collapsed.front()));
  if (!folded.empty())
    text += fmt::format(
        "{}mesh '{}': {} of second order folded at a corner, the first is element {}: the Jacobian determinant is "
        "negative there and positive at the points where stresses are integrated; stresses near these corners are "
        "doubtful",
        text.empty() ? "" : "; ", mesh.name, number(folded), element_name(mesh, folded.front()));
  return text;
}

std::unique_ptr<ElementGroup> make_cable_group(const CableSection& section, const std::vector<Index>& nodes,
                                               std::vector<double> length, std::vector<std::int64_t> labels) {
  return std::make_unique<CableGroup>(section, nodes, std::move(length), std::move(labels));
}
std::unique_ptr<ElementGroup> make_beam_group(const BeamSection& section, const std::vector<Index>& nodes,
                                              std::vector<double> length, std::vector<std::int64_t> labels) {
  return std::make_unique<BeamGroup>(section, nodes, std::move(length), std::move(labels));
}
std::unique_ptr<ElementGroup> make_shell_group(const Material& material, double thickness,
                                               const std::vector<std::array<Index, 4>>& quads) {
  return std::make_unique<ShellGroup>(material, thickness, quads);
}

}  // namespace espalier::dynamics
