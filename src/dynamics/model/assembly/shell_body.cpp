#include "dynamics/model/assembly/shell_body.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "dynamics/mesh/file_source.hpp"
#include "dynamics/mesh/names.hpp"
#include "dynamics/mesh/read.hpp"
#include "dynamics/mesh/shell_mesh.hpp"
#include "dynamics/mesh/shell_sections.hpp"

namespace espalier::dynamics::model {
namespace {

Point point_of(const Vec3& x) { return {x.x(), x.y(), x.z()}; }

/// Nodes on the sides of the grid, by the names of its parameters' ends.
std::shared_ptr<const Mesh> grid_mesh(const ShellSpec& s) {
  auto mesh = std::make_shared<Mesh>();
  for (Index j = 0; j <= s.ny; ++j)
    for (Index i = 0; i <= s.nx; ++i) {
      const Index node = j * (s.nx + 1) + i;
      const auto add_to_set = [&](const char* set, bool belongs) {
        if (belongs) mesh->node_sets[set].push_back(node);
      };
      add_to_set("x0", i == 0);
      add_to_set("x1", i == s.nx);
      add_to_set("y0", j == 0);
      add_to_set("y1", j == s.ny);
      add_to_set("all", true);
      mesh->nodes.push_back({});
      if (i == s.nx || j == s.ny) continue;
      mesh->add_element(ElementType::quad4, std::array{node, node + 1, node + s.nx + 2, node + s.nx + 1});
    }
  return mesh;
}

/// The thickness, a share of the mean, between the corners.
double thickness_at(const ShellSpec& s, Index i, Index j) {
  if (s.corners.empty()) return 1;
  const double x = static_cast<double>(i) / s.nx, y = static_cast<double>(j) / s.ny;
  return ((s.corners[0] * (1 - x) + s.corners[1] * x) * (1 - y) + (s.corners[3] * (1 - x) + s.corners[2] * x) * y) /
         s.thickness;
}

std::unique_ptr<FlexibleBody> make_grid(const BodySpec& spec, ShellSpec& s) {
  s.mesh = grid_mesh(s);
  std::vector<Point> positions, directors;
  const Vec3 normal = s.x.cross(s.y).normalized(), along = s.x.normalized();
  for (Index j = 0; j <= s.ny; ++j)
    for (Index i = 0; i <= s.nx; ++i) {
      const double way = s.x.norm() * i / s.nx, turn = s.curvature * way, half = 0.5 * turn;
      Vec3 from_edge = s.x * (static_cast<double>(i) / s.nx), director = normal;
      if (turn != 0) {  // a chord of 2 sin(half) / curvature
        from_edge = way * std::sin(half) / half * (std::cos(half) * along + std::sin(half) * normal);
        director = std::cos(turn) * normal - std::sin(turn) * along;
      }
      if (!s.corners.empty()) director *= thickness_at(s, i, j);
      Vec3 place = s.origin + from_edge + s.y * (static_cast<double>(j) / s.ny);
      if (s.offset != 0) place += s.offset * director;
      positions.push_back(point_of(place));
      directors.push_back(point_of(director));
    }
  return make_shell_body(spec.name, positions, directors, shell_quads(s), s.material, s.thickness);
}

/// The surface elements that the text chooses, alone.
Mesh chosen_surfaces(const ShellSpec& s, const std::string& body) {
  if (!file_exists(s.file->path))
    throw Error(StatusCode::invalid_input,
                fmt::format("there is no mesh file '{}'; paths are relative to the folder of the model", s.file->path));
  Mesh mesh = mesh_of_file(*s.file, body);
  for (Point& p : mesh.nodes)
    for (double& x : p) x *= s.file->scale;
  std::vector<Index> elements;
  if (s.element_set.empty()) {
    for (Index e = 0; e < mesh.element_count(); ++e)
      if (shape_of(mesh.type(e)).dimension == 2) elements.push_back(e);
  } else {
    elements = mesh.element_set(s.element_set);
  }
  if (elements.empty())
    throw Error(
        StatusCode::invalid_input,
        fmt::format("'{}' has no shells{}: a body of type \"shell\" is made of triangles and quadrilaterals; solids "
                    "are a body of type \"solid\"",
                    s.file->path, s.element_set.empty() ? "" : " in the set '" + s.element_set + "'"));
  if (elements.size() < static_cast<std::size_t>(mesh.element_count())) keep_elements(mesh, elements);
  mesh.drop_unused_nodes();
  return mesh;
}

/// What the sections of the file say of the elements.
class Sections {
 public:
  Sections(const Mesh& mesh, const ShellSpec& s)
      : mesh_(mesh),
        spec_(s),
        all_(needed(s) ? read_shell_sections(s.file->path) : ShellSections()),
        of_(static_cast<std::size_t>(mesh.element_count()), -1) {
    for (std::size_t k = 0; k < all_.list.size(); ++k) {
      const auto found = find_named(mesh.element_sets, all_.list[k].set);
      if (found == mesh.element_sets.end()) continue;
      for (const Index e : found->second) of_[static_cast<std::size_t>(e)] = static_cast<int>(k);
    }
    for (Index e = 0; e < mesh.element_count(); ++e)
      if (const ShellSection* section = of(e); section != nullptr && !section->fault.empty())
        throw Error(StatusCode::invalid_input, section->fault);
    for (std::size_t k = 0; k < all_.list.size(); ++k)
      if (is_used(k) && !all_.list[k].layers.empty()) make_one_layer(all_.list[k]);
    find_nodal_thickness();
  }

  [[nodiscard]] std::vector<std::string> notices() const {
    std::vector<std::string> out;
    for (std::size_t k = 0; k < all_.list.size(); ++k)
      if (!all_.list[k].notice.empty() && is_used(k)) out.push_back(all_.list[k].notice);
    return out;
  }

  /// At the corners of each element.
  [[nodiscard]] std::vector<std::array<double, 4>> thickness() const {
    std::vector<std::array<double, 4>> out;
    for (Index e = 0; e < mesh_.element_count(); ++e) {
      std::array<double, 4>& at_corners = out.emplace_back();
      const auto nodes = mesh_.element(e);
      const auto corners = static_cast<std::size_t>(shape_of(mesh_.type(e)).corners);
      for (std::size_t a = 0; a < corners; ++a) {
        at_corners[a] = thickness_at(e, a, nodes[a]);
        if (!(at_corners[a] > 0))
          throw Error(StatusCode::invalid_input,
                      fmt::format("needs 'thickness': the mesh file states none for element {}{} (*SHELL SECTION with "
                                  "*NODAL THICKNESS of .inp, PSHELL and PCOMP of Nastran are read)",
                                  element_name(mesh_, e),
                                  of(e) != nullptr && of(e)->nodal ? " at node " + node_name(mesh_, nodes[a]) : ""));
      }
    }
    return out;
  }

  /// Over the thickness.
  [[nodiscard]] double offset() const {
    std::optional<double> common;
    for (Index e = 0; e < mesh_.element_count(); ++e) {
      const ShellSection* section = of(e);
      const double own = section == nullptr ? 0 : section->offset;
      if (common && *common != own)
        throw Error(StatusCode::invalid_input,
                    fmt::format("the mesh file states offsets of {} and {} thicknesses; choose the elements of one by "
                                "'element_set', or give 'offset'",
                                *common, own));
      common = own;
    }
    return common.value_or(0);
  }

  [[nodiscard]] Material material(bool statics, bool& massless) const {
    std::optional<std::string> name;
    for (Index e = 0; e < mesh_.element_count(); ++e) {
      const ShellSection* section = of(e);
      const std::string own = section == nullptr ? "" : section->material;
      if (name && !same_word(*name, own))
        throw Error(StatusCode::invalid_input,
                    fmt::format("needs 'material': the mesh file states '{}' and '{}' for its elements", *name, own));
      name = own;
    }
    std::vector<MeshMaterial> materials = layered_;
    materials.insert(materials.end(), mesh_.materials.begin(), mesh_.materials.end());
    for (const MeshMaterial& m : materials)
      if (name && same_word(m.name, *name) && m.young > 0 && (m.density > 0 || statics)) {
        Material result;
        result.young = m.young;
        result.poisson = m.poisson;
        massless = !(m.density > 0);
        result.density = massless ? 1 : m.density;
        return result;
      }
    throw Error(
        StatusCode::invalid_input,
        name && !name->empty()
            ? fmt::format("needs 'material': the mesh file states '{}' without Young's modulus or density", *name)
            : "needs 'material': the mesh file states none for its shells");
  }

 private:
  /// The text may say all that sections do.
  static bool needed(const ShellSpec& s) { return s.material_of_file || !s.offset_given || !(s.thickness > 0); }
  [[nodiscard]] const ShellSection* of(Index e) const {
    const int k = of_[static_cast<std::size_t>(e)];
    return k < 0 ? nullptr : &all_.list[static_cast<std::size_t>(k)];
  }
  [[nodiscard]] bool is_used(std::size_t k) const {
    return std::find(of_.begin(), of_.end(), static_cast<int>(k)) != of_.end();
  }

  void make_one_layer(ShellSection& s) {
    auto [thickness, material] = equivalent_layer(s, mesh_.materials);
    const bool alike = std::all_of(s.layers.begin(), s.layers.end(),
                                   [&](const ShellLayer& l) { return same_word(l.material, s.layers[0].material); });
    if (!alike)
      s.notice = fmt::format(
          "{}: {} layers are one of the same stiffness in the plane and in bending, {:g} thick: displacements are "
          "those "
          "of the layers, stresses are not",
          s.place, s.layers.size(), thickness);
    s.material = alike ? s.layers[0].material : material.name;
    if (alike) thickness = s.thickness;
    s.offset *= s.thickness / thickness;
    s.thickness = thickness;
    if (!alike) layered_.push_back(std::move(material));
  }

  void find_nodal_thickness() {
    if (all_.of_nodes.empty()) return;
    nodal_.assign(mesh_.nodes.size(), 0.0);
    for (const auto& [name, thickness] : all_.of_nodes) {
      if (const auto set = find_named(mesh_.node_sets, name); set != mesh_.node_sets.end())
        for (const Index n : set->second) nodal_[static_cast<std::size_t>(n)] = thickness;
      else
        for (std::size_t n = 0; n < nodal_.size(); ++n)
          if (fmt::format("{}", mesh_.node_label(static_cast<Index>(n))) == name) nodal_[n] = thickness;
    }
  }

  [[nodiscard]] double thickness_at(Index e, std::size_t corner, Index node) const {
    const ShellSection* section = of(e);
    if (spec_.thickness > 0) return spec_.thickness;
    if (section == nullptr) return 0;
    double own = section->thickness;
    if (section->nodal) own = nodal_.empty() ? 0 : nodal_[static_cast<std::size_t>(node)];
    if (const auto found = all_.corners.find(mesh_.element_label(e)); found != all_.corners.end())
      if (const double t = found->second[corner]; t != 0) own = t > 0 ? t : -t * own;
    return own * spec_.file->scale;
  }

  const Mesh& mesh_;
  const ShellSpec& spec_;
  ShellSections all_;
  std::vector<int> of_;                // section of each element
  std::vector<MeshMaterial> layered_;  // that stand for layers
  std::vector<double> nodal_;          // thickness of nodes, 0: none; empty: the file states none
};

std::unique_ptr<FlexibleBody> make_of_file(const BodySpec& spec, ShellSpec& s, bool statics, BuiltBody& out) {
  const Mesh surfaces = chosen_surfaces(s, spec.name);
  const Sections sections(surfaces, s);
  const std::vector<std::array<double, 4>> thickness = sections.thickness();
  if (s.material_of_file) s.material = sections.material(statics, out.spec.massless);
  double mean = 0, least = thickness.front().front(), most = least;
  for (Index e = 0; e < surfaces.element_count(); ++e)
    for (int a = 0, corners = shape_of(surfaces.type(e)).corners; a < corners; ++a) {
      const double t = thickness[static_cast<std::size_t>(e)][static_cast<std::size_t>(a)];
      mean += t / corners / static_cast<double>(thickness.size());
      least = std::min(least, t);
      most = std::max(most, t);
    }
  ShellMesh made = make_shell_mesh(surfaces, thickness, s.offset_given ? s.offset / mean : sections.offset());
  if (made.turned > 0 && !s.offset_given && sections.offset() != 0)
    throw Error(
        StatusCode::invalid_input,
        fmt::format("the offset of the mesh file counts along the normal of each element, and those of {} of ours "
                    "point to the other side than their neighbours': turn these elements round, or give "
                    "'offset' in the model, which counts along the normal of the first element",
                    made.turned));
  s.offset = (s.offset_given ? s.offset : sections.offset() * made.thickness);
  s.thickness = made.thickness;
  s.mesh = std::make_shared<const Mesh>(std::move(made.mesh));
  out.notices = surfaces.notices;
  out.notices.insert(out.notices.end(), made.notices.begin(), made.notices.end());
  for (const std::string& notice : sections.notices()) out.notices.push_back(notice);
  if (const std::size_t pieces = s.mesh->pieces({}).size(); pieces > 1)
    out.notices.push_back(fmt::format(
        "the shell falls into {} pieces that share no node; where joints do not hold all of them, they move apart",
        pieces));
  if (least < most)
    out.notices.push_back(
        fmt::format("thicknesses from {:g} to {:g}: where elements state different ones at a node, their mean counts",
                    least, most));
  return make_shell_body(spec.name, made.positions, made.directors, shell_quads(s), s.material, s.thickness);
}

}  // namespace

std::vector<std::array<Index, 4>> shell_quads(const ShellSpec& s) {
  std::vector<std::array<Index, 4>> quads;
  for (Index e = 0; e < s.mesh->element_count(); ++e) {
    const auto nodes = s.mesh->element(e);
    quads.push_back({nodes[0], nodes[1], nodes[2], nodes[3]});
  }
  return quads;
}

std::unique_ptr<FlexibleBody> make_shell(const BodySpec& spec, bool statics, BuiltBody& out) {
  auto& shell = std::get<ShellSpec>(out.spec.shape);
  return shell.file ? make_of_file(spec, shell, statics, out) : make_grid(spec, shell);
}

const std::vector<Index>& shell_nodes(const BuiltBody& body, const std::string& name) {
  const Mesh& mesh = *std::get<ShellSpec>(body.spec.shape).mesh;
  if (const auto found = find_named(mesh.node_sets, name); found != mesh.node_sets.end()) return found->second;
  std::vector<std::string> names;
  for (const auto& [known, list] : mesh.node_sets) names.push_back(known);
  throw std::invalid_argument(fmt::format("{} has no '{}'{}",
                                          std::get<ShellSpec>(body.spec.shape).file ? "the shell" : "a shell", name,
                                          suggestion(name, names)));
}

PressedSide pressed_side(const ShellSpec& shell, const std::string& face) {
  const std::size_t blank = face.find_last_of(' ');
  const std::string side = blank == std::string::npos ? face : face.substr(blank + 1);
  if (side != "top" && side != "bottom" && side != "middle")
    throw std::invalid_argument(
        "the faces of a shell are 'top', where its normal (x cross y) points to, 'bottom', and 'middle' (pressed from "
        "the top), or those of a set: \"SET top\"");
  PressedSide out{shell_quads(shell), (side == "middle" ? 0 : side == "top" ? 0.5 : -0.5) * shell.thickness};
  if (blank == std::string::npos) return out;
  const std::string set = face.substr(0, face.find_last_not_of(' ', blank) + 1);
  std::vector<std::array<Index, 4>> chosen;
  if (const auto elements = find_named(shell.mesh->element_sets, set); elements != shell.mesh->element_sets.end()) {
    for (const Index e : elements->second) chosen.push_back(out.quads[static_cast<std::size_t>(e)]);
  } else if (const auto nodes = find_named(shell.mesh->node_sets, set); nodes != shell.mesh->node_sets.end()) {
    for (const auto& quad : out.quads)
      if (std::all_of(quad.begin(), quad.end(),
                      [&](Index k) { return std::binary_search(nodes->second.begin(), nodes->second.end(), k); }))
        chosen.push_back(quad);
  } else {
    std::vector<std::string> names;
    for (const auto& [known, list] : shell.mesh->element_sets) names.push_back(known);
    for (const auto& [known, list] : shell.mesh->node_sets) names.push_back(known);
    throw std::invalid_argument(fmt::format("the shell has no '{}'{}", set, suggestion(set, names)));
  }
  if (chosen.empty())
    throw std::invalid_argument(fmt::format("no element of the shell has all its nodes in '{}'", set));
  out.quads = std::move(chosen);
  return out;
}

HeldPoint shell_node(const BuiltBody& body, Index node) {
  const auto& shell = std::get<ShellSpec>(body.spec.shape);
  const double* x = body.flexible->reference().data() + 6 * static_cast<std::size_t>(node);
  const Vec3 place(x[0] - shell.offset * x[3], x[1] - shell.offset * x[4], x[2] - shell.offset * x[5]);
  return {fmt::format("node {}", shell.mesh->node_label(node)), {{2 * node, 1}, {2 * node + 1, -shell.offset}}, place};
}

/// The frame of nodes without turns about the normal: with the edges that begin there, whose changes from node to node
/// say how the surface turns within itself. A thousandth of the director's weight leaves all else to the director.
std::unique_ptr<FlexibleFrame> shell_node_frame(const BuiltBody& body, Index node, const Mat3& axes) {
  constexpr double kEdges = 1e-3;
  const auto& shell = std::get<ShellSpec>(body.spec.shape);
  const auto at = [&](Index vertex) {
    return Vec3(Eigen::Map<const Vec3>(body.flexible->reference().data() + 3 * vertex));
  };
  const Vec3 director = at(2 * node + 1);
  std::set<Index> neighbours;
  for (const auto& quad : shell_quads(shell))
    for (std::size_t a = 0; a < 4; ++a)
      if (quad[a] == node) neighbours.insert({quad[(a + 1) % 4], quad[(a + 3) % 4]});
  std::vector<FrameVertex> vertices = {{2 * node, 1, Vec3::Zero()}, {2 * node + 1, -shell.offset, director}};
  for (const Index other : neighbours) {
    const Vec3 edge = at(2 * other) - at(2 * node);
    const Vec3 arm =
        kEdges * director.squaredNorm() / edge.squaredNorm() / static_cast<double>(neighbours.size()) * edge;
    vertices.front().arm -= arm;
    vertices.push_back({2 * other, 0, arm});
  }
  return std::make_unique<FlexibleFrame>(*body.flexible, std::move(vertices), axes);
}

}  // namespace espalier::dynamics::model
