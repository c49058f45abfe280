#include "dynamics/model/assembly/line_body.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/at.hpp"
#include "dynamics/joints/node_equations.hpp"
#include "dynamics/mesh/file_source.hpp"
#include "dynamics/mesh/line_sections.hpp"
#include "dynamics/mesh/names.hpp"
#include "dynamics/mesh/read.hpp"

namespace espalier::dynamics::model {
namespace {

[[noreturn]] void refuse(const std::string& what) { throw Error(StatusCode::invalid_input, what); }

/// A bar with the axial stiffness of its section. Round ones bend as wires do; at their pinned ends that does nothing.
CableSection bar_of(double young, double area, double mass) {
  return {young * area, young * area * area / (4 * std::numbers::pi), mass};
}

BeamSection beam_of_constants(const Material& m, const std::array<double, 6>& x) {
  constexpr double kStiff = 1e3;  // of shear, where the file says that there is none
  const auto [area, iy, iz, j, ky, kz] = x;
  BeamSection s = section_of(m, area, iy, iz, j, 1);
  s.shear_y = m.mu() * area * (ky > 0 ? ky : kStiff);
  s.shear_z = m.mu() * area * (kz > 0 ? kz : kStiff);
  for (const double stiffness : {s.axial, s.torsion, s.bending_y, s.bending_z})
    if (!(stiffness > 0))
      refuse(
          "a section of the file has no area, no moment of inertia or no torsion constant: give the section in the "
          "model");
  return s;
}

BeamSpec::ChainSection beam_of(const Material& m, const LineSection& s) {
  const auto& x = s.size;
  BeamSpec::ChainSection part;
  switch (s.shape) {
    case LineShape::rectangle:
      part = {rectangular_section(m, x[0], x[1]), SectionOutline{m.young, 0, x[0], x[1]}};
      break;
    case LineShape::circle:
      part = {circular_section(m, x[0]), SectionOutline{m.young, x[0]}};
      break;
    case LineShape::pipe:
      part = {tube_section(m, x[0], x[1]), SectionOutline{m.young, x[0]}};
      break;
    case LineShape::box:
      part = {box_section(m, {x[0], x[1], x[2], x[3]}), SectionOutline{m.young, 0, x[0], x[1]}};
      break;
    case LineShape::i_beam:
      part = {i_section(m, {x[0], x[1], x[2], x[3]}), SectionOutline{m.young, 0, x[0], x[1]}};
      break;
    case LineShape::constants:
      part.section = beam_of_constants(m, x);
      break;
    case LineShape::bar:
      refuse(
          fmt::format("the elements of '{}' carry axial forces alone (bars of a truss): take type = \"cable\", and "
                      "choose them by 'element_set'",
                      s.set));
  }
  part.section.mass_per_length += s.extra_mass;
  return part;
}

class LineMaker {
 public:
  LineMaker(const BodySpec& spec, LineFile& file, bool statics, BuiltBody& out)
      : spec_(spec), file_(file), statics_(statics), out_(out), is_beam_(std::holds_alternative<BeamSpec>(spec.shape)) {
    if (!file_exists(file.file.path))
      refuse(fmt::format("there is no mesh file '{}'; paths are relative to the folder of the model", file.file.path));
    mesh_ = mesh_of_file(file.file, spec.name);
    if (!file.section_given || !file.y_given) sections_ = read_line_sections(file.file.path, mesh_);
    choose();
  }

  std::unique_ptr<FlexibleBody> run() {
    LineElements elements;
    elements.pinned = !is_beam_;
    for (Index e = 0; e < mesh_.element_count(); ++e) {
      elements.section.push_back(section_of(e));
      elements.y.push_back(y_of(e));
    }
    LineMesh made = make_line_mesh(mesh_, elements);
    auto body = make_body(made);
    out_.notices = made.mesh.notices;
    if (const std::size_t pieces = mesh_.pieces({}).size(); pieces > 1)
      out_.notices.push_back(fmt::format(
          "the lines fall into {} pieces that share no node; where joints do not hold all of them, they move apart",
          pieces));
    if (!made.joined.empty())
      out_.pieces = fmt::format("its {} chains of elements are joined at nodes", made.chains.size());
    file_.chains = std::move(made.chains);
    file_.joined = std::move(made.joined);
    file_.mesh = std::make_shared<const Mesh>(std::move(made.mesh));
    return body;
  }

 private:
  void choose() {
    std::vector<Index> elements;
    if (file_.element_set.empty()) {
      for (Index e = 0; e < mesh_.element_count(); ++e)
        if (shape_of(mesh_.type(e)).dimension == 1) elements.push_back(e);
    } else {
      elements = mesh_.element_set(file_.element_set);
    }
    for (const Index e : elements)
      if (shape_of(mesh_.type(e)).dimension != 1)
        refuse(fmt::format("element {} of the set '{}' is no line: choose beams or bars alone", element_name(mesh_, e),
                           file_.element_set));
    if (elements.empty())
      refuse(fmt::format("'{}' has no beams{}: a body of type \"{}\" is made of line elements", file_.file.path,
                         file_.element_set.empty() ? "" : " in the set '" + file_.element_set + "'",
                         is_beam_ ? "beam" : "cable"));
    if (elements.size() < at(mesh_.element_count())) keep_elements(mesh_, elements);
    mesh_.drop_unused_nodes();
    for (Point& p : mesh_.nodes)
      for (double& x : p) x *= file_.file.scale;
    of_.assign(at(mesh_.element_count()), -1);
    for (std::size_t k = 0; k < sections_.list.size(); ++k)
      if (const auto found = find_named(mesh_.element_sets, sections_.list[k].set); found != mesh_.element_sets.end())
        for (const Index e : found->second) of_[at(e)] = static_cast<int>(k);
  }

  [[nodiscard]] const LineSection* of_file(Index e) const {
    const int k = of_[at(e)];
    return k < 0 ? nullptr : &sections_.list[at(k)];
  }

  /// Its number among those of the body; made where it is met first.
  std::size_t section_of(Index e) {
    const LineSection* section = file_.section_given ? nullptr : of_file(e);
    if (!file_.section_given) {
      if (section == nullptr)
        refuse(fmt::format(
            "needs a section: the mesh file states none for element {} (*BEAM SECTION of .inp, PBAR and the "
            "like of Nastran are read); give radius, or height and width, or its constants",
            element_name(mesh_, e)));
      if (!section->fault.empty()) refuse(section->fault);
      if (const auto fault = sections_.faults.find(mesh_.element_label(e)); fault != sections_.faults.end())
        refuse(fault->second);
    }
    const auto known = std::find(used_.begin(), used_.end(), section);
    if (known == used_.end()) {
      used_.push_back(section);
      make_section(section);
      return used_.size() - 1;
    }
    return static_cast<std::size_t>(known - used_.begin());
  }

  void make_section(const LineSection* section) {
    if (auto* beam = std::get_if<BeamSpec>(&out_.spec.shape)) {
      if (section != nullptr) {
        LineSection scaled = *section;
        scale(scaled);
        beam->sections.push_back(beam_of(material_of(section), scaled));
      } else if (beam->outline) {
        SectionOutline& o = *beam->outline;
        const Material m = material_of(nullptr);
        o.young = m.young;
        beam->sections.push_back(
            {o.radius > 0 ? circular_section(m, o.radius) : rectangular_section(m, o.height, o.width), o});
      } else {
        beam->sections.push_back({beam->section, std::nullopt});
      }
      return;
    }
    auto& cable = std::get<CableSpec>(out_.spec.shape);
    if (section != nullptr) {
      LineSection scaled = *section;
      scale(scaled);
      const Material m = material_of(section);
      const double area = scaled.shape == LineShape::bar || scaled.shape == LineShape::constants
                              ? scaled.size[0]
                              : beam_of(m, scaled).section.axial / m.young;
      cable.sections.push_back(bar_of(m.young, area, m.density * area + scaled.extra_mass));
    } else if (cable.outline) {
      const Material m = material_of(nullptr);
      const double area = std::numbers::pi * cable.outline->radius * cable.outline->radius;
      cable.outline->young = m.young;
      cable.sections.push_back(bar_of(m.young, area, m.density * area));
    } else {
      cable.sections.push_back(cable.section);
    }
  }

  /// Lengths of the file's section.
  void scale(LineSection& s) const {
    const double f = file_.file.scale;
    if (s.shape == LineShape::constants) {
      s.size[0] *= f * f;
      for (std::size_t k = 1; k < 4; ++k) s.size[k] *= f * f * f * f;
    } else if (s.shape == LineShape::bar) {
      s.size[0] *= f * f;
    } else {
      for (double& x : s.size) x *= f;
    }
  }

  [[nodiscard]] Material material_of(const LineSection* section) const {
    if (file_.material) return *file_.material;
    MeshMaterial own = section == nullptr ? MeshMaterial{} : section->own;
    if (section != nullptr && !(own.young > 0))
      for (const MeshMaterial& m : mesh_.materials)
        if (same_word(m.name, section->material)) own = m;
    if (!(own.young > 0) || !(own.density > 0 || statics_))
      refuse(fmt::format("needs 'material': the mesh file states none with Young's modulus and density for {}",
                         section == nullptr ? "its beams" : "'" + section->set + "'"));
    Material result;
    result.young = own.young;
    result.poisson = own.poisson;
    if (!(own.density > 0)) out_.spec.massless = true;
    result.density = own.density > 0 ? own.density : 1;
    return result;
  }

  [[nodiscard]] Point y_of(Index e) const {
    const auto nodes = mesh_.element(e);
    Vec3 x = Vec3::Zero();
    for (std::size_t i = 0; i < 3; ++i)
      x[static_cast<Eigen::Index>(i)] = mesh_.nodes[at(nodes[nodes.size() - 1])][i] - mesh_.nodes[at(nodes[0])][i];
    x.normalize();
    const Vec3 otherwise = std::abs(x.y()) < 0.9 ? Vec3::UnitY() : Vec3::UnitX();
    if (!is_beam_) return {otherwise.x(), otherwise.y(), otherwise.z()};
    if (file_.y_given) {
      const Vec3& y = std::get<BeamSpec>(spec_.shape).y;
      return {y.x(), y.y(), y.z()};
    }
    const LineSection* section = of_file(e);
    if (section != nullptr && section->first) {
      const Point& p = *section->first;
      const Vec3 first(p[0], p[1], p[2]), y = section->across ? Vec3(x.cross(first)) : first;
      return {y.x(), y.y(), y.z()};
    }
    if (const auto own = sections_.directions.find(mesh_.element_label(e)); own != sections_.directions.end())
      return own->second;
    return {otherwise.x(), otherwise.y(), otherwise.z()};
  }

  std::unique_ptr<FlexibleBody> make_body(const LineMesh& made) const {
    std::vector<double> reference;
    for (std::size_t k = 0; k < made.mesh.nodes.size(); ++k) {
      reference.insert(reference.end(), made.mesh.nodes[k].begin(), made.mesh.nodes[k].end());
      for (std::size_t axis = 0; axis < (is_beam_ ? 3U : 1U); ++axis)
        reference.insert(reference.end(), made.axes[k][axis].begin(), made.axes[k][axis].end());
    }
    std::vector<std::unique_ptr<ElementGroup>> groups;
    Index element = 0;
    for (const LineChain& chain : made.chains) {
      std::vector<Index> nodes;
      std::vector<std::int64_t> labels;
      for (std::size_t k = 0; k <= chain.lengths.size(); ++k) nodes.push_back(chain.first + static_cast<Index>(k));
      for (std::size_t k = 0; k < chain.lengths.size(); ++k) labels.push_back(made.mesh.element_label(element++));
      groups.push_back(is_beam_ ? make_beam_group(std::get<BeamSpec>(out_.spec.shape).sections[chain.section].section,
                                                  nodes, chain.lengths, std::move(labels))
                                : make_cable_group(std::get<CableSpec>(out_.spec.shape).sections[chain.section], nodes,
                                                   chain.lengths, std::move(labels)));
    }
    return std::make_unique<FlexibleBody>(spec_.name, is_beam_ ? 4 : 2, std::move(reference), std::move(groups));
  }

  const BodySpec& spec_;
  LineFile& file_;
  bool statics_;
  BuiltBody& out_;
  bool is_beam_;
  Mesh mesh_;
  LineSections sections_;
  std::vector<int> of_;                   // section of each element
  std::vector<const LineSection*> used_;  // of the body, in their order; null: that of the text
};

LineFile* line_file_of(BodySpec& spec) {
  if (auto* beam = std::get_if<BeamSpec>(&spec.shape)) return beam->file ? &*beam->file : nullptr;
  if (auto* cable = std::get_if<CableSpec>(&spec.shape)) return cable->file ? &*cable->file : nullptr;
  return nullptr;
}

}  // namespace

const LineFile* line_file(const BuiltBody& body) {
  if (const auto* beam = std::get_if<BeamSpec>(&body.spec.shape)) return beam->file ? &*beam->file : nullptr;
  if (const auto* cable = std::get_if<CableSpec>(&body.spec.shape)) return cable->file ? &*cable->file : nullptr;
  return nullptr;
}

std::unique_ptr<FlexibleBody> make_lines(const BodySpec& spec, bool statics, BuiltBody& out) {
  return LineMaker(spec, *line_file_of(out.spec), statics, out).run();
}

void join_lines(const BuiltBody& body, Mechanism& out) {
  const LineFile* file = line_file(body);
  if (file == nullptr) return;
  const Index each = body.flexible->vertices_per_node();
  std::vector<NodeEquation> equations;
  for (const auto& [first, other] : file->joined) {
    const std::string node = node_name(*file->mesh, first);
    if (each == 4) {
      out.system.add(fixed_joint(fmt::format("{}, node {}", body.spec.name, node),
                                 make_beam_frame(*body.flexible, first), make_beam_frame(*body.flexible, other)));
      continue;
    }
    for (int d = 0; d < 3; ++d)
      equations.push_back({{{body.flexible, each * first, d, 1}, {body.flexible, each * other, d, -1}},
                           0,
                           fmt::format("node {} of '{}', {}", node, body.spec.name, "xyz"[d])});
  }
  if (!equations.empty()) out.system.add(std::make_unique<NodeEquations>(body.spec.name, std::move(equations)));
}

}  // namespace espalier::dynamics::model
