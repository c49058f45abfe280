#include "dynamics/page/drawn.hpp"

#include <fmt/format.h>

#include "base/at.hpp"
#include "dynamics/contact/geometry/outline.hpp"
#include "dynamics/model/output/scene.hpp"
#include "dynamics/page/skin_faces.hpp"

namespace espalier::dynamics::page {
namespace {

constexpr int kSigns[8][3] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                              {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}};

std::string kind_of(const model::BuiltBody& body) {
  if (body.rigid != nullptr) return "rigid body";
  if (body.point != nullptr) return "point mass";
  const std::string nodes = fmt::format("{} nodes", body.flexible->nodes());
  const char* reduced = body.reduced != nullptr ? "reduced " : "";
  if (body.mesh) return fmt::format("{}solid, {} elements, {}", reduced, body.mesh->element_count(), nodes);
  if (std::holds_alternative<model::ShellSpec>(body.spec.shape)) return fmt::format("{}shell, {}", reduced, nodes);
  if (std::holds_alternative<model::CableSpec>(body.spec.shape)) return fmt::format("{}cable, {}", reduced, nodes);
  if (std::holds_alternative<model::BeamSpec>(body.spec.shape)) return fmt::format("{}beam, {}", reduced, nodes);
  return fmt::format("{}substructure, {}", reduced, nodes);
}

void append(const Vec3& x, std::vector<double>& to) { to.insert(to.end(), x.data(), x.data() + 3); }

}  // namespace

Drawn::Drawn(const model::Mechanism& mechanism) : mechanism_(mechanism) {
  for (const model::BuiltBody& body : mechanism.bodies) {
    Body drawn;
    drawn.name = body.spec.name;
    drawn.kind = kind_of(body);
    drawn.first = static_cast<Index>(labels_.size());
    if (body.rigid != nullptr || body.point != nullptr) {
      drawn.rigid = true;
      skins_.emplace_back();
      add_rigid(body);
    } else {
      skins_.push_back(make_skin(body));
      const Skin& skin = *skins_.back();
      drawn.coarse = skin.coarse;
      for (auto triangle : skin.triangles) {
        for (Index& k : triangle) k += drawn.first;
        triangles_.push_back(triangle);
      }
      for (const auto& [element, behind] : skin.owners)
        owners_.push_back({static_cast<Index>(bodies_.size()), element, behind});
      for (const auto& [a, b] : skin.edges) edges_.push_back({a + drawn.first, b + drawn.first});
      labels_.insert(labels_.end(), skin.labels.begin(), skin.labels.end());
    }
    owners_.resize(triangles_.size());  // what else it has does not fail
    drawn.count = static_cast<Index>(labels_.size()) - drawn.first;
    bodies_.push_back(drawn);
  }
}

void Drawn::add_rigid(const model::BuiltBody& body) {
  const auto first = static_cast<Index>(labels_.size());
  std::vector<Vec3> points;
  const auto add = [&](std::vector<Index> face) {
    for (Index& k : face) k += first;
    add_triangles(face, face.size(), triangles_);
    constexpr std::size_t kOutlined = 400;  // points: more are round
    if (points.size() < kOutlined) add_outline(face, face.size(), edges_);
  };
  for (const contact::RigidSurface& surface : body.surfaces) {
    const contact::Outline outline = contact::outline_of(surface.shape);
    const auto begin = static_cast<Index>(points.size());
    for (const Vec3& x : outline.points) points.push_back(surface.point + surface.axes * x);
    for (std::vector<Index> face : outline.faces) {
      for (Index& k : face) k += begin;
      add(std::move(face));
    }
  }
  if (points.empty() && body.rigid != nullptr) {
    const Vec3 half = model::half_edges(std::get<model::RigidSpec>(body.spec.shape));
    for (const auto& c : kSigns) points.push_back(half.cwiseProduct(Vec3(c[0], c[1], c[2])));
    for (const FaceShape& face : shape_of(ElementType::hex8).faces) add({face.nodes.begin(), face.nodes.end()});
  }
  if (points.empty()) points.push_back(Vec3::Zero());
  for (const Vec3& x : points)
    for (const double number : x) local_.push_back(static_cast<float>(number));
  labels_.resize(labels_.size() + points.size(), 0);
}

void Drawn::place(const State& s, Place& out) {
  for (auto* list : {&out.points, &out.rates, &out.positions, &out.quaternions, &out.velocities, &out.turning})
    list->clear();
  for (const model::BuiltBody& body : mechanism_.bodies) {
    if (body.rigid != nullptr) {
      const Quat turn = body.rigid->quaternion(s.q);
      append(body.rigid->position(s.q), out.positions);
      for (const double number : {turn[1], turn[2], turn[3], turn[0]}) out.quaternions.push_back(number);
      append(body.rigid->velocity(s.v), out.velocities);
      append(rotation_matrix(turn) * body.rigid->angular(s.v), out.turning);
      continue;
    }
    if (body.point != nullptr) {
      append(body.point->position(s.q), out.positions);
      for (const double number : {0.0, 0.0, 0.0, 1.0}) out.quaternions.push_back(number);
      append(body.point->velocity(s.v), out.velocities);
      append(Vec3::Zero(), out.turning);
      continue;
    }
    const Skin& skin = *skins_[at(&body - mechanism_.bodies.data())];
    if (body.reduced != nullptr) body.reduced->nodal_motion(s.q, s.v, position_, rate_);
    const double* x = body.reduced != nullptr ? position_.data() : &s.q[at(body.flexible->configuration(0))];
    const double* v = body.reduced != nullptr ? rate_.data() : &s.v[at(body.flexible->coordinate(0))];
    const std::size_t before = out.points.size();
    out.points.resize(before + 3 * at(skin.points()));
    out.rates.resize(out.points.size());
    skin.place(x, out.points.data() + before);
    skin.rates(x, v, out.rates.data() + before);
  }
}

std::vector<double> Drawn::all_points(const Place& place) const {
  std::vector<double> all;
  std::size_t flexible = 0, rigid = 0, local = 0;
  for (const Body& body : bodies_) {
    if (!body.rigid) {
      const auto from = place.points.begin() + static_cast<std::ptrdiff_t>(flexible);
      all.insert(all.end(), from, from + 3 * body.count);
      flexible += 3 * at(body.count);
      continue;
    }
    const double* q = &place.quaternions[4 * rigid];
    const Eigen::Quaterniond turn(q[3], q[0], q[1], q[2]);
    const Vec3 origin(&place.positions[3 * rigid++]);
    for (Index k = 0; k < body.count; ++k, local += 3)
      append(origin + turn * Vec3(local_[local], local_[local + 1], local_[local + 2]), all);
  }
  return all;
}

}  // namespace espalier::dynamics::page
