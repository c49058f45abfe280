#include "dynamics/model/fields/sampled_body.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <stdexcept>

#include "base/at.hpp"
#include "base/parallel.hpp"
#include "dense/dense.hpp"
#include "dynamics/elements/ancf_shell.hpp"
#include "dynamics/elements/shape_functions.hpp"
#include "dynamics/elements/solid_parts.hpp"
#include "dynamics/elements/strain_material.hpp"
#include "dynamics/model/frames/labels.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr std::int64_t kElements = 64, kFewest = 256;  // of a task; below it one thread is as fast
constexpr int kShearPairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {1, 2}, {0, 2}};

ElementType solid_shape(int vertices) {
#define ESPALIER_SHAPE(kind, nodes, points) \
  if (vertices == nodes) return ElementType::kind;
  ESPALIER_FOR_SOLIDS(ESPALIER_SHAPE)
#undef ESPALIER_SHAPE
  return ElementType::hex8;
}

/// The root of C, from C - I: by Taylor's series where what it leaves out is below rounding, else by eigenvalues.
Mat3 stretch_of(const Mat3& a) {
  constexpr double kSmall = 1e-3;
  const Mat3 one = Mat3::Identity();
  if (a.cwiseAbs().maxCoeff() > kSmall) {
    const dense::PrincipalAxes c = dense::principal_axes(one + a);
    return c.axes * c.values.cwiseSqrt().asDiagonal() * c.axes.transpose();
  }
  const Mat3 a2 = a * a, a3 = a2 * a;
  return one + a / 2 - a2 / 8 + a3 / 16 - a2 * a2 * (5.0 / 128) + a2 * a3 * (7.0 / 256);
}

/// Positions that strain a reduced body by `share` of its amplitudes.
std::vector<double> strained_by(const ReducedBody& body, const State& s, double share) {
  std::vector<double> x = body.strained(s.q);
  const auto reference = body.nodal().reference();
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = reference[i] + share * (x[i] - reference[i]);
  return x;
}

/// In axes that turn with the material. @param linear  of small strains
void stress_by(Material law, const double (&strain)[6], bool linear, double (&stress)[6]) {
  if (linear) law.law = SolidLaw::st_venant_kirchhoff;
  StrainStress s;
  if (!StrainMaterial(law).stress(strain, s)) {
    std::fill_n(stress, 6, std::numeric_limits<double>::quiet_NaN());
    return;
  }
  std::copy_n(s.s, 6, stress);
  if (linear) return;
  Mat3 twice, second;  // C - I
  for (int m = 0; m < 6; ++m) {
    const auto [i, j] = kShearPairs[m];
    twice(i, j) = twice(j, i) = m < 3 ? 2 * strain[m] : strain[m];
    second(i, j) = second(j, i) = s.s[m];
  }
  if (!twice.allFinite()) return;
  const Mat3 u = stretch_of(twice), cauchy = u * second * u / u.determinant();
  for (int m = 0; m < 6; ++m) stress[m] = cauchy(kShearPairs[m][0], kShearPairs[m][1]);
}

}  // namespace

SampledBody::SampledBody(const BuiltBody& body) : body_(body), material_(body.material) {
  if (body.flexible == nullptr)
    throw std::invalid_argument(fmt::format(
        "'{}' is rigid: there is no stress or strain in it; ask for the forces of its joints", body.spec.name));
  if (std::holds_alternative<SubstructureSpec>(body.spec.shape))
    throw std::invalid_argument(
        fmt::format("'{}' is matrices without elements: no stress or strain is known", body.spec.name));
  if (const auto* shell = std::get_if<ShellSpec>(&body.spec.shape)) {
    kind_ = FieldBody::shell;
    thickness_ = shell->thickness;
    material_ = shell->material;
  }
  if (std::holds_alternative<BeamSpec>(body.spec.shape)) kind_ = FieldBody::beam;
  if (std::holds_alternative<CableSpec>(body.spec.shape)) kind_ = FieldBody::cable;
  body.flexible->assembly().for_each_group([&](const ElementGroup& group, std::span<const Index>) {
    const ElementType shape = kind_ == FieldBody::solid   ? solid_shape(group.vertices_per_element())
                              : kind_ == FieldBody::shell ? ElementType::hex8
                                                          : ElementType::line2;
    for (Index e = 0; e < group.count(); ++e) {
      by_label_.emplace(group.label(e), static_cast<Index>(elements_.size()));
      elements_.push_back({&group, e, shape});
    }
  });
}

std::vector<Index> SampledBody::element_nodes(Index e) const {
  const auto vertices = element(e).group->vertices(element(e).local);
  const auto step = static_cast<std::size_t>(body_.flexible->vertices_per_node());
  std::vector<Index> nodes;
  for (std::size_t k = 0; k < vertices.size(); k += step) nodes.push_back(vertices[k] / static_cast<Index>(step));
  return nodes;
}

Index SampledBody::find_element(std::int64_t label) const {
  const auto it = by_label_.find(label);
  return it == by_label_.end() ? -1 : it->second;
}

std::int64_t SampledBody::node_label(Index node) const {
  const Mesh* mesh = named_mesh(body_);
  return mesh != nullptr ? mesh->node_label(node) : node + 1;
}

Vec3 SampledBody::node_place(Index node) const {
  return Eigen::Map<const Vec3>(body_.flexible->reference().data() +
                                3 * at(node) * at(body_.flexible->vertices_per_node()));
}

void SampledBody::gather(const Element& e, const double* from, double* to) const {
  for (const Index vertex : e.group->vertices(e.local)) to = std::copy_n(from + 3 * at(vertex), 3, to);
}

std::vector<double> SampledBody::reference(Index e) const {
  std::vector<double> x(3 * at(element(e).group->vertices_per_element()));
  gather(element(e), body_.flexible->reference().data(), x.data());
  if (kind_ != FieldBody::shell) return x;
  std::vector<double> hexahedron(x.size());
  shell_to_hexahedron(x.data(), thickness_, hexahedron.data());
  return hexahedron;
}

void SampledBody::sample_element(Index e, const double* position, bool with_energy, std::size_t at,
                                 FieldTable& out) const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const Element& own = element(e);
  double from[kMaxElementDofs], to[kMaxElementDofs], force[kMaxElementDofs];
  gather(own, body_.flexible->reference().data(), from);
  gather(own, position, to);
  if (!own.group->sample(own.local, from, to, out.strain[at]))
    for (auto& point : out.strain[at].value) std::fill_n(point, 6, kNone);
  if (!with_energy) return;
  ElementOutput result{force};
  out.energy[at] = own.group->evaluate(own.local, {from, to, nullptr}, result) ? result.energy : kNone;
}

void SampledBody::stress_of(const double (&strain)[6], bool linear, double (&stress)[6]) const {
  stress_by(material_, strain, linear, stress);
}

void SampledBody::stresses(Index e, bool linear, std::size_t at, FieldTable& out) const {
  const Material* solid = material_of(*element(e).group);
  for (std::size_t q = 0; q < points_of(points(e)).size(); ++q)
    if (solid != nullptr)
      stress_by(*solid, out.strain[at].value[q], linear, out.stress[at].value[q]);
    else
      stress_of(out.strain[at].value[q], linear, out.stress[at].value[q]);
}

void SampledBody::clear_failed(std::span<const Index> which, FieldTable& table) const {
  const std::span<const char> failed = body_.flexible->assembly().failed();
  for (std::size_t k = 0; k < which.size() && !failed.empty(); ++k) {
    if (failed[at(which[k])] == 0) continue;
    table.strain[k] = {};
    if (!table.stress.empty()) table.stress[k] = {};
    if (!table.energy.empty()) table.energy[k] = 0;
  }
}

FieldTable SampledBody::strains(const State& s, std::span<const Index> which, base::ThreadPool* pool,
                                bool with_energy) const {
  const auto count = static_cast<std::int64_t>(which.size());
  base::ThreadPool* helpers = count < kFewest ? nullptr : pool;
  const auto all = [&](const double* position, FieldTable& out) {
    out.strain.resize(which.size());
    out.energy.resize(with_energy ? which.size() : 0);
    base::for_each_range(helpers, count, kElements, [&](std::int64_t begin, std::int64_t end) {
      for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k)
        sample_element(which[k], position, with_energy, k, out);
    });
  };
  const bool linear = body_.reduced != nullptr;
  FieldTable out;
  if (!linear) {
    all(s.q.data() + body_.flexible->placement().q, out);
  } else {
    // A reduced body is linear: derivatives of the strains along its amplitudes, as central differences of strains that
    // are small, but not beside rounding.
    constexpr double kShift = 1e-4;  // of the body's size
    const auto reference = body_.flexible->reference();
    const std::vector<double> whole = body_.reduced->strained(s.q);
    double largest = 0;
    for (std::size_t i = 0; i < whole.size(); ++i) largest = std::max(largest, std::abs(whole[i] - reference[i]));
    const double share = largest > 0 ? kShift * body_.flexible->size() / largest : 1;
    FieldTable back;
    all(strained_by(*body_.reduced, s, share).data(), out);
    all(strained_by(*body_.reduced, s, -share).data(), back);
    for (std::size_t k = 0; k < which.size(); ++k) {
      for (int q = 0; q < 8; ++q)
        for (int m = 0; m < 6; ++m)
          out.strain[k].value[q][m] = (out.strain[k].value[q][m] - back.strain[k].value[q][m]) / (2 * share);
      if (with_energy) out.energy[k] = (out.energy[k] + back.energy[k]) / (2 * share * share);
    }
  }
  return out;
}

FieldTable SampledBody::sample(const State& s, std::span<const Index> which, base::ThreadPool* pool,
                               bool with_energy) const {
  const auto count = static_cast<std::int64_t>(which.size());
  base::ThreadPool* helpers = count < kFewest ? nullptr : pool;
  const bool linear = body_.reduced != nullptr;
  FieldTable out = strains(s, which, pool, with_energy);
  if (kind_ == FieldBody::beam || kind_ == FieldBody::cable) return out;
  out.stress.resize(which.size());
  base::for_each_range(helpers, count, kElements, [&](std::int64_t begin, std::int64_t end) {
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k)
      stresses(which[k], linear, k, out);
  });
  return out;
}

}  // namespace espalier::dynamics::model
