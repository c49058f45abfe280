#include "dynamics/model/pictures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "dynamics/elements/shape_functions.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr int kCorner[8][3] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                               {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}};

/// Half the edges of the uniform block with this mass and inertia (its diagonal): b^2 + c^2 = 12 I_x / m.
Vec3 half_edges(const RigidSpec& rigid) {
  if (rigid.box) return 0.5 * *rigid.box;
  const Vec3 i = 12 / rigid.data.mass * rigid.data.inertia.diagonal();
  const double sum = 0.5 * i.sum();
  const double least = 0.05 * std::sqrt(sum);  // a thin plate or rod stays visible
  return 0.5 * (sum * Vec3::Ones() - i).cwiseMax(least * least).cwiseSqrt();
}

std::size_t at(Index i) { return static_cast<std::size_t>(i); }

}  // namespace

double von_mises(ElementType type, const Material& material, std::span<const double> reference,
                 std::span<const double> position) {
  const bool tet = type == ElementType::tet4 || type == ElementType::tet10;
  const double middle[3] = {tet ? 0.25 : 0, tet ? 0.25 : 0, tet ? 0.25 : 0};
  const auto nodes = static_cast<std::size_t>(shape_of(type).nodes);
  std::array<double, 3 * kMaxElementNodes> dn{};
  shape_gradients(type, middle, dn.data());
  Mat3 to_reference = Mat3::Zero(), to_position = Mat3::Zero();
  for (std::size_t a = 0; a < nodes; ++a)
    for (int i = 0; i < 3; ++i)
      for (std::size_t d = 0; d < 3; ++d) {
        to_reference(i, static_cast<int>(d)) += reference[3 * a + static_cast<std::size_t>(i)] * dn[d * nodes + a];
        to_position(i, static_cast<int>(d)) += position[3 * a + static_cast<std::size_t>(i)] * dn[d * nodes + a];
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

Pictures::Pictures(const std::string& path, const Mechanism& mechanism, const State& initial, double keep_until)
    : mechanism_(mechanism), series_(path) {
  if (std::isnan(keep_until)) {
    series_.begin_anew();
  } else {
    kept_ = series_.resume(keep_until);
  }
  double number = 0;
  for (const BuiltBody& body : mechanism.bodies) {
    if (body.rigid != nullptr) {
      add_rigid(body, number);
    } else if (body.point != nullptr) {
      add_cell(ElementType::point1, std::array<Index, 1>{0}, number);
      ++point_count_;
    } else if (body.mesh) {
      add_solid(body, number);
    } else {
      add_line_or_plate(body, number);
    }
    ++number;
  }
  const auto size = 3 * at(point_count_);
  for (auto* x : {&points_, &displacement_, &velocity_}) x->assign(size, 0.0);
  von_mises_.assign(body_.size(), 0.0);
  place(initial);
  initial_ = points_;
}

void Pictures::add_cell(ElementType type, std::span<const Index> points, double number) {
  std::vector<Index> shifted(points.begin(), points.end());
  for (Index& p : shifted) p += point_count_;
  cells_.add(type, shifted);
  body_.push_back(number);
}

void Pictures::add_rigid(const BuiltBody& body, double number) {
  half_.push_back(half_edges(std::get<RigidSpec>(body.spec.shape)));
  const std::array<Index, 8> corners = {0, 1, 2, 3, 4, 5, 6, 7};
  add_cell(ElementType::hex8, corners, number);
  point_count_ += 8;
}

void Pictures::add_solid(const BuiltBody& body, double number) {
  for (Index e = 0; e < body.mesh->element_count(); ++e) add_cell(body.mesh->type(e), body.mesh->element(e), number);
  point_count_ += body.flexible->nodes();
}

void Pictures::add_line_or_plate(const BuiltBody& body, double number) {
  if (const auto* shell = std::get_if<ShellSpec>(&body.spec.shape)) {
    for (Index j = 0; j < shell->ny; ++j)
      for (Index i = 0; i < shell->nx; ++i) {
        const Index first = j * (shell->nx + 1) + i;
        add_cell(ElementType::quad4, std::array{first, first + 1, first + shell->nx + 2, first + shell->nx + 1},
                 number);
      }
  } else {
    for (Index k = 0; k + 1 < body.flexible->nodes(); ++k) add_cell(ElementType::line2, std::array{k, k + 1}, number);
  }
  point_count_ += body.flexible->nodes();
}

double Pictures::extent_over_speed(const State& s) {
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

void Pictures::place(const State& s) {
  std::size_t next = 0, box = 0;
  const auto put = [&](const Vec3& x, const Vec3& v) {
    for (int i = 0; i < 3; ++i, ++next) {
      points_[next] = x[i];
      velocity_[next] = v[i];
    }
  };
  for (const BuiltBody& body : mechanism_.bodies) {
    if (body.rigid != nullptr) {
      const Vec3 centre = body.rigid->position(s.q), v = body.rigid->velocity(s.v), half = half_[box++];
      const Mat3 r = rotation_matrix(body.rigid->quaternion(s.q));
      const Vec3 omega = r * body.rigid->angular(s.v);
      for (const auto& c : kCorner) {
        const Vec3 arm = r * half.cwiseProduct(Vec3(c[0], c[1], c[2]));
        put(centre + arm, v + omega.cross(arm));
      }
      continue;
    }
    if (body.point != nullptr) {
      put(body.point->position(s.q), body.point->velocity(s.v));
      continue;
    }
    const Index step = body.flexible->vertices_per_node();
    for (Index k = 0; k < body.flexible->nodes(); ++k) {
      const double* x = &s.q[at(body.flexible->configuration(k * step))];
      const double* v = &s.v[at(body.flexible->coordinate(k * step))];
      put({x[0], x[1], x[2]}, {v[0], v[1], v[2]});
    }
  }
}

void Pictures::stresses(const State& s) {
  std::size_t cell = 0;
  std::vector<double> reference, position;
  for (const BuiltBody& body : mechanism_.bodies) {
    if (!body.mesh) {
      const auto* shell = std::get_if<ShellSpec>(&body.spec.shape);
      cell += body.flexible == nullptr ? 1 : at(shell != nullptr ? shell->nx * shell->ny : body.flexible->nodes() - 1);
      continue;
    }
    for (Index e = 0; e < body.mesh->element_count(); ++e, ++cell) {
      const ElementType type = body.mesh->type(e);
      if (!is_simulated_solid(type)) continue;
      reference.clear();
      position.clear();
      for (const Index node : body.mesh->element(e)) {
        const double* from = body.flexible->reference().data() + 3 * at(node);
        const double* to = &s.q[at(body.flexible->configuration(node))];
        reference.insert(reference.end(), from, from + 3);
        position.insert(position.end(), to, to + 3);
      }
      von_mises_[cell] = von_mises(type, body.material, reference, position);
    }
  }
}

void Pictures::write(const State& s, double time) {
  place(s);
  stresses(s);
  for (std::size_t i = 0; i < points_.size(); ++i) displacement_[i] = points_[i] - initial_[i];
  const std::array<OutputField, 2> point_fields = {OutputField{"displacement", 3, displacement_},
                                                   OutputField{"velocity", 3, velocity_}};
  const std::array<OutputField, 2> cell_fields = {OutputField{"body", 1, body_},
                                                  OutputField{"von_mises", 1, von_mises_}};
  write_vtu(series_.file_name(0), points_, cells_, point_fields, cell_fields);
  series_.add(time, 0);
}

}  // namespace espalier::dynamics::model
