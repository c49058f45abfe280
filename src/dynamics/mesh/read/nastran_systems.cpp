#include "dynamics/mesh/read/nastran_systems.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

namespace espalier::dynamics {
namespace {

constexpr int kDeepestSystem = 64;

Point minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Point cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Point unit(const Point& a) {
  const double length = std::hypot(a[0], a[1], a[2]);
  return {a[0] / length, a[1] / length, a[2] / length};
}

/// Coordinates of a cylindrical (C) or spherical (S) system in the rectangular one of the same axes; angles in degrees.
Point rectangular(char kind, const Point& p) {
  constexpr double kDegree = std::numbers::pi / 180;
  if (kind == 'C') return {p[0] * std::cos(p[1] * kDegree), p[0] * std::sin(p[1] * kDegree), p[2]};
  if (kind != 'S') return p;
  const double across = p[0] * std::sin(p[1] * kDegree);
  return {across * std::cos(p[2] * kDegree), across * std::sin(p[2] * kDegree), p[0] * std::cos(p[1] * kDegree)};
}

}  // namespace

bool NastranSystems::take(const NastranCard& card, Mesh& mesh) {
  if (card.name == "GRID") return add_grid(card, mesh), true;
  if (card.name == "GRDSET") {
    default_ = card.integer(1, "coordinate system", 0);
    default_line_ = card.line;
    return true;
  }
  if (card.name == "CORD2R" || card.name == "CORD2C" || card.name == "CORD2S") return add_by_coordinates(card), true;
  if (card.name == "CORD1R" || card.name == "CORD1C" || card.name == "CORD1S") return add_by_points(card), true;
  return false;
}

void NastranSystems::add_grid(const NastranCard& card, Mesh& mesh) {
  const std::int64_t label = card.integer(0, "number");
  const auto node = static_cast<Index>(mesh.nodes.size());
  if (!index_.emplace(label, node).second) card.fail(fmt::format("grid point {} is defined twice", label));
  Point p{};
  for (std::size_t i = 0; i < 3; ++i) p[i] = card.real(2 + i, "coordinate", 0);
  mesh.nodes.push_back(p);
  mesh.node_labels.push_back(label);
  if (card.field(1).empty()) {
    unstated_.push_back(node);
    return;
  }
  const std::int64_t system = card.integer(1, "coordinate system");
  if (system == 0) return;
  if (files_.empty() || files_.back() != card.path) files_.push_back(card.path);
  pending_.emplace(node, Pending{system, card.line, files_.size() - 1});
}

void NastranSystems::add_by_coordinates(const NastranCard& card) {
  System s;
  s.kind = card.name.back();
  s.reference = card.integer(1, "reference system", 0);
  for (std::size_t i = 0; i < 3; ++i) {
    s.origin[i] = card.real(2 + i, "point A", 0);
    s.on_z[i] = card.real(5 + i, "point B", 0);
    s.in_xz[i] = card.real(8 + i, "point C", 0);
  }
  s.card = card;
  systems_[card.integer(0, "number")] = s;
}

void NastranSystems::add_by_points(const NastranCard& card) {
  for (const std::size_t first : {0U, 4U}) {  // two systems in one card
    if (card.field(first).empty()) continue;
    System s;
    s.kind = card.name.back();
    for (std::size_t i = 0; i < 3; ++i) s.points[i] = card.integer(first + 1 + i, "grid point");
    s.card = card;
    systems_[card.integer(first, "number")] = s;
  }
}

const NastranSystems::System& NastranSystems::system(std::int64_t id, const Pending& from, Mesh& mesh, int depth) {
  const auto found = systems_.find(id);
  if (found == systems_.end())
    throw Error(
        StatusCode::invalid_input,
        fmt::format("{}:{}: coordinate system {} is not defined (CORD1R, CORD1C, CORD1S, CORD2R, CORD2C, CORD2S "
                    "are read)",
                    files_.empty() ? mesh.name : files_[from.file], from.line, id));
  System& s = found->second;
  if (s.resolved) return s;
  if (depth > kDeepestSystem) s.card.fail("coordinate systems refer to one another in a circle, or more than 64 deep");
  Point on_z{}, in_xz{};
  if (s.points[0] != 0) {
    s.at = node(s.card, s.points[0], mesh, depth + 1);
    on_z = node(s.card, s.points[1], mesh, depth + 1);
    in_xz = node(s.card, s.points[2], mesh, depth + 1);
  } else {
    if (files_.empty() || files_.back() != s.card.path) files_.push_back(s.card.path);
    const Pending here{s.reference, s.card.line, files_.size() - 1};
    s.at = basic(s.origin, here, mesh, depth + 1);
    on_z = basic(s.on_z, here, mesh, depth + 1);
    in_xz = basic(s.in_xz, here, mesh, depth + 1);
  }
  s.z = unit(minus(on_z, s.at));
  s.y = unit(cross(s.z, minus(in_xz, s.at)));
  s.x = cross(s.y, s.z);
  if (!std::isfinite(s.y[0] + s.z[0])) s.card.fail("its points A, B and C lie on one line");
  s.resolved = true;
  return s;
}

Point NastranSystems::basic(const Point& p, const Pending& from, Mesh& mesh, int depth) {
  if (from.system == 0) return p;
  const System& s = system(from.system, from, mesh, depth);
  const Point local = rectangular(s.kind, p);
  Point result{};
  for (std::size_t i = 0; i < 3; ++i) result[i] = s.at[i] + local[0] * s.x[i] + local[1] * s.y[i] + local[2] * s.z[i];
  return result;
}

Point NastranSystems::node(const NastranCard& card, std::int64_t label, Mesh& mesh, int depth) {
  const auto found = index_.find(label);
  if (found == index_.end()) card.fail(fmt::format("grid point {} is not defined", label));
  Point& place = mesh.nodes[static_cast<std::size_t>(found->second)];
  const auto pending = pending_.find(found->second);
  if (pending == pending_.end()) return place;
  const Pending from = pending->second;
  place = basic(place, from, mesh, depth);
  pending_.erase(found->second);
  return place;
}

std::array<Point, 3> NastranSystems::axes(const NastranCard& card, std::int64_t id, const Point& at, Mesh& mesh) {
  if (id == 0) return {Point{1, 0, 0}, Point{0, 1, 0}, Point{0, 0, 1}};
  files_.push_back(card.path);
  const System& s = system(id, {id, card.line, files_.size() - 1}, mesh, 0);
  if (s.kind == 'R') return {s.x, s.y, s.z};
  const Point arm = minus(at, s.at);
  const Point around = unit(cross(s.z, arm));
  if (!std::isfinite(around[0])) card.fail(fmt::format("coordinate system {} has no directions on its axis", id));
  if (s.kind == 'C') return {cross(around, s.z), around, s.z};
  const Point outwards = unit(arm);
  return {outwards, cross(around, outwards), around};
}

void NastranSystems::resolve(Mesh& mesh) {
  if (default_ != 0) {
    files_.push_back(mesh.name);
    for (const Index n : unstated_) pending_.emplace(n, Pending{default_, default_line_, files_.size() - 1});
  }
  for (Index n = 0; n < static_cast<Index>(mesh.nodes.size()); ++n) {
    const auto pending = pending_.find(n);
    if (pending == pending_.end()) continue;
    const Pending from = pending->second;
    Point& place = mesh.nodes[static_cast<std::size_t>(n)];
    place = basic(place, from, mesh, 0);
    pending_.erase(n);
  }
}

}  // namespace espalier::dynamics
