#include "dynamics/model/output/scene.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "base/at.hpp"
#include "dynamics/contact/geometry/outline.hpp"
#include "dynamics/contact/solid_contact.hpp"
#include "dynamics/elements/shape_functions.hpp"
#include "dynamics/model/assembly/line_elements.hpp"
#include "dynamics/model/assembly/solid_materials.hpp"
#include "dynamics/model/erosion/erosion.hpp"
#include "dynamics/model/fields/sampling.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr int kCorner[8][3] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                               {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}};

}  // namespace

// Half the edges of the uniform block with this mass and inertia (its diagonal): b^2 + c^2 = 12 I_x / m.
Vec3 half_edges(const RigidSpec& rigid) {
  if (rigid.box) return 0.5 * *rigid.box;
  const Vec3 i = 12 / rigid.data.mass * rigid.data.inertia.diagonal();
  const double sum = 0.5 * i.sum();
  const double least = 0.05 * std::sqrt(sum);  // a thin plate or rod stays visible
  return 0.5 * (sum * Vec3::Ones() - i).cwiseMax(least * least).cwiseSqrt();
}

double von_mises(ElementType type, const Material& material, std::span<const double> reference,
                 std::span<const double> position) {
  const std::array<double, 3> middle = middle_of(type);
  const auto nodes = at(shape_of(type).nodes);
  std::array<double, 3 * kMaxElementNodes> dn{};
  shape_gradients(type, middle.data(), dn.data());
  Mat3 to_reference = Mat3::Zero(), to_position = Mat3::Zero();
  for (std::size_t a = 0; a < nodes; ++a)
    for (int i = 0; i < 3; ++i)
      for (std::size_t d = 0; d < 3; ++d) {
        to_reference(i, static_cast<int>(d)) += reference[3 * a + at(i)] * dn[d * nodes + a];
        to_position(i, static_cast<int>(d)) += position[3 * a + at(i)] * dn[d * nodes + a];
      }
  const Mat3 f = to_position * to_reference.inverse();
  Mat33 grad, rate = {};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) grad[i][j] = f(i, j) - (i == j ? 1.0 : 0.0);
  PointResponse point;
  if (material.law == SolidLaw::st_venant_kirchhoff) {
    respond_svk(grad, rate, material.lambda(), material.mu(), 1.0, {}, point);
  } else if (!respond_neo_hookean(grad, material.lambda(), material.mu(), {}, point)) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  Mat3 p;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) p(i, j) = point.p[i][j];
  const Mat3 cauchy = p * f.transpose() / f.determinant();
  const Mat3 deviator = cauchy - cauchy.trace() / 3 * Mat3::Identity();
  return std::sqrt(1.5) * deviator.norm();
}

Scene::Scene(const Mechanism& mechanism) : mechanism_(mechanism) {
  for (const BuiltBody& body : mechanism.bodies) {
    first_point_.push_back(point_count_);
    if (body.rigid != nullptr) {
      add_rigid(body);
    } else if (body.point != nullptr) {
      add_cell(ElementType::point1, std::array<Index, 1>{0});
      ++point_count_;
    } else if (body.mesh) {
      add_solid(body);
    } else {
      add_line_or_plate(body);
    }
    body_.resize(at(cells_.count()), static_cast<Index>(&body - mechanism.bodies.data()));
  }
  points_.assign(3 * at(point_count_), 0.0);
  velocity_ = points_;
  von_mises_.assign(body_.size(), 0.0);
}

void Scene::add_cell(ElementType type, std::span<const Index> points) {
  std::vector<Index> shifted(points.begin(), points.end());
  for (Index& p : shifted) p += point_count_;
  cells_.add(type, shifted);
}

void Scene::add_rigid(const BuiltBody& body) {
  corners_.emplace_back();
  for (const contact::RigidSurface& surface : body.surfaces) {
    const contact::Outline outline = contact::outline_of(surface.shape);
    for (const std::vector<Index>& face : outline.faces)
      add_cell(face.size() == 4 ? ElementType::quad4 : ElementType::tri3, face);
    for (const Vec3& x : outline.points) corners_.back().push_back(surface.point + surface.axes * x);
    point_count_ += static_cast<Index>(outline.points.size());
  }
  if (corners_.back().empty()) add_box(body);
}

void Scene::add_box(const BuiltBody& body) {
  const Vec3 half = half_edges(std::get<RigidSpec>(body.spec.shape));
  for (const auto& c : kCorner) corners_.back().push_back(half.cwiseProduct(Vec3(c[0], c[1], c[2])));
  const std::array<Index, 8> corners = {0, 1, 2, 3, 4, 5, 6, 7};
  add_cell(ElementType::hex8, corners);
  point_count_ += 8;
}

void Scene::add_solid(const BuiltBody& body) {
  std::unordered_map<std::int64_t, Index> numbers;
  const std::vector<double>* failed_at =
      mechanism_.erosion == nullptr ? nullptr : mechanism_.erosion->failed_at(body.spec.name);
  if (failed_at != nullptr) numbers = body.flexible->assembly().numbers_by_label();
  for (Index e = 0; e < body.mesh->element_count(); ++e) {
    if (const auto number = numbers.find(body.mesh->element_label(e)); number != numbers.end())
      may_fail_.push_back({&(*failed_at)[at(number->second)], at(cells_.count())});
    add_cell(body.mesh->type(e), body.mesh->element(e));
  }
  point_count_ += body.flexible->nodes();
}

const std::vector<double>& Scene::failed(const State& s) {
  failed_.assign(may_fail_.empty() ? 0 : body_.size(), 0.0);
  for (const Cell& c : may_fail_) failed_[c.cell] = *c.failed_at <= s.t ? 1 : 0;
  return failed_;
}

void Scene::add_line_or_plate(const BuiltBody& body) {
  if (const auto* shell = std::get_if<ShellSpec>(&body.spec.shape)) {
    for (Index e = 0; e < shell->mesh->element_count(); ++e) add_cell(ElementType::quad4, shell->mesh->element(e));
  } else if (const auto* parts = std::get_if<SubstructureSpec>(&body.spec.shape); parts && !parts->lines.empty()) {
    for (const auto& [a, b] : parts->lines)
      add_cell(ElementType::line2, std::array{parts->find(a).value(), parts->find(b).value()});
  } else {
    for (const LineElement& e : line_elements(body)) add_cell(ElementType::line2, e.nodes);
    if (body.flexible->nodes() == 1) add_cell(ElementType::point1, std::array<Index, 1>{0});
  }
  point_count_ += body.flexible->nodes();
}

double Scene::extent_over_speed(const State& s) {
  place(s);
  double extent = 0, speed = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    double low = points_.empty() ? 0 : points_[i], high = low;
    for (std::size_t k = i; k < points_.size(); k += 3)
      low = std::min(low, points_[k]), high = std::max(high, points_[k]);
    extent = std::max(extent, high - low);
  }
  for (std::size_t k = 0; k < velocity_.size(); k += 3)
    speed = std::max(speed, std::hypot(velocity_[k], velocity_[k + 1], velocity_[k + 2]));
  return speed > 0 ? extent / speed : 0;
}

void Scene::place(const State& s) {
  std::size_t next = 0, rigid = 0;
  const auto append_point = [&](const Vec3& x, const Vec3& v) {
    for (int i = 0; i < 3; ++i, ++next) {
      points_[next] = x[i];
      velocity_[next] = v[i];
    }
  };
  for (const BuiltBody& body : mechanism_.bodies) {
    if (body.rigid != nullptr) {
      const Vec3 centre = body.rigid->position(s.q), v = body.rigid->velocity(s.v);
      const Mat3 r = rotation_matrix(body.rigid->quaternion(s.q));
      const Vec3 omega = r * body.rigid->angular(s.v);
      for (const Vec3& corner : corners_[rigid++]) {
        const Vec3 arm = r * corner;
        append_point(centre + arm, v + omega.cross(arm));
      }
      continue;
    }
    if (body.point != nullptr) {
      append_point(body.point->position(s.q), body.point->velocity(s.v));
      continue;
    }
    const Index step = body.flexible->vertices_per_node();
    if (body.reduced != nullptr) body.reduced->nodal_motion(s.q, s.v, position_, rate_);
    const std::vector<double>&q = body.reduced != nullptr ? position_ : s.q,
          &rate = body.reduced != nullptr ? rate_ : s.v;
    for (Index k = 0; k < body.flexible->nodes(); ++k) {
      const double* x = &q[at(body.flexible->configuration(k * step))];
      const double* v = &rate[at(body.flexible->coordinate(k * step))];
      append_point({x[0], x[1], x[2]}, {v[0], v[1], v[2]});
    }
  }
}

const std::vector<double>& Scene::contact_pressure(const State& s) {
  pressure_.clear();
  for (const BuiltContact& built : mechanism_.surface_contacts)
    for (contact::Contact* part : built.parts) {
      auto* solid = dynamic_cast<contact::SolidContact*>(part);
      if (solid == nullptr) continue;
      pressure_.resize(at(point_count_), 0.0);
      std::size_t body = 0;
      while (mechanism_.bodies[body].flexible != &solid->first().body()) ++body;
      const std::vector<double> pressures = solid->node_pressures(s.view());
      for (std::size_t k = 0; k < pressures.size(); ++k) {
        double& own = pressure_[at(first_point_[body] + solid->first().body_node(solid->first().nodes()[k]))];
        own = std::max(own, pressures[k]);
      }
    }
  return pressure_;
}

const std::vector<double>& Scene::von_mises(const State& s) {
  const LinearResponse* linear = mechanism_.linear.get();
  if (linear == nullptr) return plain_von_mises(s);
  const double share = linear->load() != 0 ? s.t / linear->load() : 1;
  return von_mises_ = linear->of([this](const State& at_load) { return plain_von_mises(at_load); }, share);
}

const std::vector<double>& Scene::plain_von_mises(const State& s) {
  std::size_t cell = 0;
  std::vector<double> reference, position;
  for (const BuiltBody& body : mechanism_.bodies) {
    const auto number = static_cast<Index>(&body - mechanism_.bodies.data());
    if (!body.mesh) {
      while (cell < body_.size() && body_[cell] == number) ++cell;
      continue;
    }
    const ElementMaterials materials = materials_of(body);
    if (body.reduced != nullptr) position_ = body.reduced->strained(s.q);
    const std::vector<double>& q = body.reduced != nullptr ? position_ : s.q;
    for (Index e = 0; e < body.mesh->element_count(); ++e, ++cell) {
      const ElementType type = body.mesh->type(e);
      if (!is_simulated_solid(type)) continue;
      reference.clear();
      position.clear();
      for (const Index node : body.mesh->element(e)) {
        const double* from = body.flexible->reference().data() + 3 * at(node);
        const double* to = &q[at(body.flexible->configuration(node))];
        reference.insert(reference.end(), from, from + 3);
        position.insert(position.end(), to, to + 3);
      }
      von_mises_[cell] = model::von_mises(type, materials.at(e), reference, position);
    }
  }
  const std::vector<double>& gone = failed(s);
  for (std::size_t k = 0; k < gone.size(); ++k)
    if (gone[k] != 0) von_mises_[k] = 0;
  return von_mises_;
}

}  // namespace espalier::dynamics::model
