#include "dynamics/model/assembly/shell_body.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numeric>

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
      const auto put = [&](const char* set, bool belongs) {
        if (belongs) mesh->node_sets[set].push_back(node);
      };
      put("x0", i == 0);
      put("x1", i == s.nx);
      put("y0", j == 0);
      put("y1", j == s.ny);
      put("all", true);
      mesh->nodes.push_back({});
      if (i == s.nx || j == s.ny) continue;
      mesh->add_element(ElementType::quad4, std::array{node, node + 1, node + s.nx + 2, node + s.nx + 1});
    }
  return mesh;
}

/// Of the mean, between the corners.
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
Mesh chosen_surfaces(const ShellSpec& s) {
  if (!file_exists(s.file->path))
    throw Error(StatusCode::invalid_input,
                fmt::format("there is no mesh file '{}'; paths are relative to the folder of the model", s.file->path));
  Mesh mesh = read_mesh(s.file->path);
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
        all_(needed(s) ? read_shell_sections(s.file->path) : std::vector<ShellSection>()),
        of_(static_cast<std::size_t>(mesh.element_count()), -1) {
    for (std::size_t k = 0; k < all_.size(); ++k) {
      const auto found = find_named(mesh.element_sets, all_[k].set);
      if (found == mesh.element_sets.end()) continue;
      for (const Index e : found->second) of_[static_cast<std::size_t>(e)] = static_cast<int>(k);
    }
    for (Index e = 0; e < mesh.element_count(); ++e)
      if (const ShellSection* section = of(e); section != nullptr && !section->fault.empty())
        throw Error(StatusCode::invalid_input, section->fault);
  }

  [[nodiscard]] std::vector<std::string> notices() const {
    std::vector<std::string> out;
    for (std::size_t k = 0; k < all_.size(); ++k)
      if (!all_[k].notice.empty() && std::find(of_.begin(), of_.end(), static_cast<int>(k)) != of_.end())
        out.push_back(all_[k].notice);
    return out;
  }

  [[nodiscard]] std::vector<double> thickness() const {
    std::vector<double> out;
    for (Index e = 0; e < mesh_.element_count(); ++e) {
      const ShellSection* section = of(e);
      out.push_back(spec_.thickness > 0  ? spec_.thickness
                    : section == nullptr ? 0
                                         : section->thickness * spec_.file->scale);
      if (!(out.back() > 0))
        throw Error(StatusCode::invalid_input,
                    fmt::format("needs 'thickness': the mesh file states none for element {} (*SHELL SECTION of .inp, "
                                "PSHELL of Nastran are read)",
                                element_name(mesh_, e)));
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
    for (const MeshMaterial& m : mesh_.materials)
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
    return k < 0 ? nullptr : &all_[static_cast<std::size_t>(k)];
  }
  const Mesh& mesh_;
  const ShellSpec& spec_;
  std::vector<ShellSection> all_;
  std::vector<int> of_;  // section of each element
};

std::unique_ptr<FlexibleBody> make_of_file(const BodySpec& spec, ShellSpec& s, bool statics, BuiltBody& out) {
  const Mesh surfaces = chosen_surfaces(s);
  const Sections sections(surfaces, s);
  const std::vector<double> thickness = sections.thickness();
  if (s.material_of_file) s.material = sections.material(statics, out.spec.massless);
  const double mean = std::accumulate(thickness.begin(), thickness.end(), 0.0) / static_cast<double>(thickness.size());
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
  const auto [least, most] = std::minmax_element(thickness.begin(), thickness.end());
  if (*least < *most)
    out.notices.push_back(
        fmt::format("thicknesses from {:g} to {:g} are those of elements; at a node the mean of its elements counts",
                    *least, *most));
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
  if (side != "top" && side != "bottom")
    throw std::invalid_argument(
        "the faces of a shell are 'top', where its normal (x cross y) points to, and 'bottom', or those of a set: "
        "\"SET top\"");
  PressedSide out{shell_quads(shell), (side == "top" ? 0.5 : -0.5) * shell.thickness};
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

}  // namespace espalier::dynamics::model
