/// \file
/// What the elements of a flexible body say at their sample points: strains, stresses, forces in sections.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <unordered_map>
#include <vector>

#include "dynamics/model/fields/sampling.hpp"
#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

enum class FieldBody { solid, shell, beam, cable };

/// The samples of all elements of a body at one state.
struct FieldTable {
  std::vector<ElementSamples> strain;  ///< of lines: forces in sections
  /// The stress of solids and shells: Cauchy stress in the axes of the mesh, which turn with the material (the rotation
  /// of the polar decomposition), R^T sigma R = U S U / det U; 11 22 33 12 23 13. NaN in elements that are inside out.
  std::vector<ElementSamples> stress;
  std::vector<double> energy;  ///< of strain, where it was asked for
};

/// The elements of a body with their nodes.
class SampledBody {
 public:
  /// @throws std::invalid_argument for a body without elements: rigid, a point, matrices
  explicit SampledBody(const BuiltBody& body);

  [[nodiscard]] const BuiltBody& body() const { return body_; }
  [[nodiscard]] FieldBody kind() const { return kind_; }
  [[nodiscard]] double thickness() const { return thickness_; }  ///< of a shell
  [[nodiscard]] Index elements() const { return static_cast<Index>(elements_.size()); }
  [[nodiscard]] Index nodes() const { return body_.flexible->nodes(); }
  [[nodiscard]] SamplePoints points(Index e) const { return element(e).group->sample_points(); }
  /// The shape of the solid that it is: hex8 for a shell, line2 for a line.
  [[nodiscard]] ElementType shape(Index e) const { return element(e).shape; }
  /// Nodes of the body, four of a shell.
  [[nodiscard]] std::vector<Index> element_nodes(Index e) const;
  [[nodiscard]] std::int64_t element_label(Index e) const { return element(e).group->label(element(e).local); }
  /// By its label; -1: none.
  [[nodiscard]] Index find_element(std::int64_t label) const;
  [[nodiscard]] std::int64_t node_label(Index node) const;
  [[nodiscard]] Vec3 node_place(Index node) const;  ///< in the axes of the mesh, without strain
  /// Coordinates of the nodes of the solid shape(), 3 each; of a line: its vertices.
  [[nodiscard]] std::vector<double> reference(Index e) const;
  /// Samples of some elements, in their order, at a state. @param with_energy  the strain energies, too
  [[nodiscard]] FieldTable sample(const State& s, std::span<const Index> which, base::ThreadPool* pool,
                                  bool with_energy = false) const;
  /// Strains (of lines: forces in sections) and energies alone.
  [[nodiscard]] FieldTable strains(const State& s, std::span<const Index> which, base::ThreadPool* pool,
                                   bool with_energy = false) const;
  /// Clears the rows of a table of these elements: what has failed by now has no strain, stress or energy any more.
  void clear_failed(std::span<const Index> which, FieldTable& table) const;

 private:
  struct Element {
    const ElementGroup* group;
    Index local;
    ElementType shape;
  };
  [[nodiscard]] const Element& element(Index e) const { return elements_[static_cast<std::size_t>(e)]; }
  void gather(const Element& e, const double* from, double* to) const;
  void sample_element(Index e, const double* position, bool with_energy, std::size_t at, FieldTable& out) const;
  void stress_of(const double (&strain)[6], bool linear, double (&stress)[6]) const;
  void stresses(Index e, bool linear, std::size_t at, FieldTable& out) const;

  const BuiltBody& body_;
  FieldBody kind_ = FieldBody::solid;
  double thickness_ = 0;
  Material material_;
  std::vector<Element> elements_;
  std::unordered_map<std::int64_t, Index> by_label_;
};

}  // namespace espalier::dynamics::model
