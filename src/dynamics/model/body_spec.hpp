/// \file
/// Bodies of a model as plain data.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "dynamics/bodies/flexible_body.hpp"
#include "dynamics/bodies/point_mass.hpp"
#include "dynamics/bodies/reduction.hpp"
#include "dynamics/bodies/rigid_body.hpp"
#include "dynamics/mesh/line_mesh.hpp"
#include "dynamics/meshers/tyre.hpp"
#include "dynamics/model/read/value.hpp"
#include "dynamics/substructure/substructure.hpp"

namespace espalier::dynamics::model {

struct RigidSpec {
  RigidBodyData data;       ///< gravity is filled in by the builder
  std::optional<Vec3> box;  ///< edge lengths of the box that stands for it in pictures; none: from its inertia
};

struct PointSpec {
  PointMassData data;  ///< gravity is filled in by the builder
};

/// A mesh from a file.
struct MeshFile {
  std::string path;
  double scale = 1;               ///< factor on all coordinates
  std::vector<std::string> take;  ///< what else of the deck, see decks/take.hpp; empty: nothing
  int step = 0;                   ///< of the deck; 0: the first
  std::string owner{};            ///< the body that takes the deck, of which this one is a part; empty: itself
};
/// A block with given divisions.
struct BlockMesh {
  BlockShape shape;
  int divisions[3] = {0, 0, 0};  ///< all 0: by the wished number of unknowns
};
/// A gear with given divisions.
struct GearMesh {
  GearShape shape;
  int divisions[3] = {0, 0, 0};  ///< along the flank, across the tooth, along the width; all 0: by unknowns
};
/// A tyre with given divisions.
struct TyreMesh {
  TyreShape shape;
  int divisions[3] = {0, 0, 0};  ///< around, across, through the thickness; all 0: by unknowns
};
/// A mesh from one of our meshers.
struct MesherSpec {
  std::variant<BlockMesh, RodShape, LinkShape, CrankShape, GuideShape, RotorShape, GearMesh, TyreMesh> shape;
  MeshSize size;
};

/// When elements of a solid fail: where one of the limits is passed at a point of integration. 0: there is none.
struct ErosionSpec {
  Place place;
  double strain = 0;            ///< largest principal strain, logarithmic
  double stress = 0;            ///< von Mises, of Cauchy's stress, as the next
  double principal_stress = 0;  ///< the largest
};

struct SolidSpec {
  std::variant<MeshFile, MesherSpec> mesh;
  std::string element_set;           ///< empty: all elements
  std::optional<Material> material;  ///< none: what the mesh file states
  SolidOptions options;
  std::vector<std::pair<std::string, Material>> set_materials{};  ///< of element sets; what is in none has `material`
  std::optional<ErosionSpec> erosion{};                           ///< none: elements hold whatever they bear
};
/// What stresses in a section need beside its stiffness.
struct SectionOutline {
  double young = 0;
  double radius = 0;             ///< of a circle; 0: a rectangle
  double height = 0, width = 0;  ///< along y and z
};
/// Beams or bars of a mesh file. The builder makes chains of them, which it joins where nodes of the file are one.
struct LineFile {
  MeshFile file;
  std::string element_set;             ///< empty: all lines
  std::optional<Material> material;    ///< none: that of the file
  bool section_given = false;          ///< by the text, for all elements; else that of the file
  bool y_given = false;                ///< likewise the direction of the sections' y axes
  std::shared_ptr<const Mesh> mesh{};  ///< set by the builder: line2, nodes and elements in the order of the body's
  std::vector<LineChain> chains{};
  std::vector<std::array<Index, 2>> joined{};  ///< nodes of chains that are one node of the file
};
struct CableSpec {
  Vec3 start, end;
  Index elements = 10;
  CableSection section;
  std::optional<SectionOutline> outline{};  ///< none: the section is given by its constants
  std::optional<LineFile> file{};           ///< instead of start, end and elements
  std::vector<CableSection> sections{};     ///< of the chains of the file
};
struct BeamSpec {
  std::shared_ptr<const AxisShape> axis;  ///< null: of a file
  Vec3 y;
  Index elements = 10;
  BeamSection section;
  std::optional<SectionOutline> outline{};  ///< none: the section is given by its constants
  struct ChainSection {
    BeamSection section;
    std::optional<SectionOutline> outline;
  };
  std::optional<LineFile> file{};        ///< instead of axis and elements
  std::vector<ChainSection> sections{};  ///< of the chains of the file
};
/// A plate of nx x ny shells: origin + s x + t y, s and t in [0, 1]; flat, or with x bent to an arc of the same length
/// that leaves the origin along x and turns towards the normal, x cross y.
struct ShellSpec {
  Vec3 origin, x, y;
  double curvature = 0;  ///< of the arc, 1 / radius
  Index nx = 1, ny = 1;
  Material material;
  double thickness = 0;  ///< of a mesh, or where it varies, the mean
  /// At the corners (0, 0), (1, 0), (1, 1), (0, 1) of the grid, bilinear between them; empty: even.
  std::vector<double> corners{};
  double offset = 0;               ///< from the nodes to the middle of the thickness, along the normal; of the mean
  std::optional<MeshFile> file{};  ///< instead of the grid: surface elements of a mesh file
  std::string element_set{};       ///< of the file; empty: all
  bool material_of_file = false;   ///< the text gives none
  bool offset_given = false;       ///< else that of the file
  /// Set by the builder: quad4, labels and node sets; of grids x0, x1, y0, y1, all.
  std::shared_ptr<const Mesh> mesh{};
};

/// Matrices from files instead of elements.
struct SubstructureSpec {
  struct Matrix {
    Place place;
    std::string path, name;  ///< name: empty where the file has one matrix
  };
  Matrix mass, stiffness;
  std::string nodes_path;                          ///< a file of GRID cards; empty: `nodes` are given
  std::vector<SubstructureNode> nodes;             ///< in the order of the rows, where matrices have no labels
  std::vector<std::array<std::int64_t, 2>> lines;  ///< between nodes, by label, for pictures
  /// Number of a node by its label.
  [[nodiscard]] std::optional<Index> find(std::int64_t label) const {
    for (std::size_t k = 0; k < nodes.size(); ++k)
      if (nodes[k].label == label) return static_cast<Index>(k);
    return std::nullopt;
  }
};

struct BodySpec {
  Place place;
  std::string name;
  std::variant<RigidSpec, SolidSpec, CableSpec, BeamSpec, ShellSpec, PointSpec, SubstructureSpec> shape;
  std::optional<Vec3> gravity;                                  ///< instead of the model's
  bool massless = false;                                        ///< no density is given: that of the parts is 1
  bool velocity_given = false, angular_velocity_given = false;  ///< whether they stand in the text
  [[nodiscard]] bool any_velocity_given() const { return velocity_given || angular_velocity_given; }
  // Flexible bodies; a rigid body keeps its own in RigidBodyData.
  Mat3 rotation = Mat3::Identity();
  Vec3 position = Vec3::Zero(), velocity = Vec3::Zero(), angular_velocity = Vec3::Zero();
  RayleighDamping damping;
  double modal_damping = 0;  ///< ratio of critical damping in the modes of the supported model
  /// Structural damping: stiffness times (1 + i loss_factor). Motions take the viscous damping that is the same at
  /// loss_frequency (cycles per unit of time; 0: none given).
  double loss_factor = 0, loss_frequency = 0;
  std::optional<ReductionOptions> reduction;  ///< of flexible bodies; none: all nodes move
  [[nodiscard]] bool rigid() const { return std::holds_alternative<RigidSpec>(shape); }
  /// Null: no element fails.
  [[nodiscard]] const ErosionSpec* erosion() const {
    const auto* solid = std::get_if<SolidSpec>(&shape);
    return solid != nullptr && solid->erosion ? &*solid->erosion : nullptr;
  }
};

}  // namespace espalier::dynamics::model
