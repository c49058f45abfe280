#include <fmt/format.h>

#include <cmath>
#include <numeric>
#include <stdexcept>

#include "dynamics/bodies/flexible_body.hpp"

namespace espalier::dynamics {
namespace {

Point subtract(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Point scale(double s, const Point& a) { return {s * a[0], s * a[1], s * a[2]}; }
double norm(const Point& a) { return std::hypot(a[0], a[1], a[2]); }

/// Direction and length of a straight chain.
struct Axis {
  Point direction;
  double length;
};
Axis axis_of(const std::string& name, const Point& start, const Point& end, Index elements) {
  const Point difference = subtract(end, start);
  const double length = norm(difference);
  if (!(length > 0) || elements < 1)
    throw std::invalid_argument(
        fmt::format("flexible body '{}': need two different end points and at least one element", name));
  return {scale(1 / length, difference), length};
}

Point point_at(const Point& start, const Axis& axis, double s) {
  return {start[0] + s * axis.direction[0], start[1] + s * axis.direction[1], start[2] + s * axis.direction[2]};
}

std::vector<Index> all_nodes(Index elements) {
  std::vector<Index> nodes(at(elements) + 1);
  std::iota(nodes.begin(), nodes.end(), 0);
  return nodes;
}

std::vector<std::unique_ptr<ElementGroup>> one(std::unique_ptr<ElementGroup> group) {
  std::vector<std::unique_ptr<ElementGroup>> groups;
  groups.push_back(std::move(group));
  return groups;
}

std::vector<double> equal_lengths(const Axis& axis, Index elements) {
  return std::vector<double>(at(elements), axis.length / elements);
}

}  // namespace

std::unique_ptr<FlexibleBody> make_solid_body(std::string name, const Mesh& mesh, const Material& material,
                                              const SolidOptions& options, std::span<const Index> elements,
                                              base::ThreadPool* pool) {
  std::vector<double> reference;
  for (const Point& p : mesh.nodes) reference.insert(reference.end(), p.begin(), p.end());
  return std::make_unique<FlexibleBody>(std::move(name), 1, std::move(reference),
                                        make_solid_groups(mesh, elements, material, options, pool), pool);
}

std::unique_ptr<FlexibleBody> make_beam_body(std::string name, const AxisShape& shape, const Point& y_direction,
                                             Index elements, const BeamSection& section) {
  BeamAxis axis;
  try {
    axis = make_beam_axis(shape, Vec3(y_direction[0], y_direction[1], y_direction[2]), elements);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("flexible body '{}': {}", name, error.what()));
  }
  std::vector<double> reference;
  for (const AxisNode& node : axis.nodes) {
    reference.insert(reference.end(), node.position.data(), node.position.data() + 3);
    reference.insert(reference.end(), node.axes.data(), node.axes.data() + 9);  // by columns: r_x, r_y, r_z
  }
  return std::make_unique<FlexibleBody>(
      std::move(name), 4, std::move(reference),
      one(make_beam_group(section, all_nodes(elements), std::vector<double>(at(elements), axis.element_length))));
}

std::unique_ptr<FlexibleBody> make_beam_body(std::string name, const Point& start, const Point& end,
                                             const Point& y_direction, Index elements, const BeamSection& section) {
  const auto vec = [](const Point& p) { return Vec3(p[0], p[1], p[2]); };
  return make_beam_body(std::move(name), StraightAxis{vec(start), vec(end)}, y_direction, elements, section);
}

std::unique_ptr<FlexibleBody> make_cable_body(std::string name, const Point& start, const Point& end, Index elements,
                                              const CableSection& section) {
  const Axis axis = axis_of(name, start, end, elements);
  std::vector<double> reference;
  for (Index k = 0; k <= elements; ++k)
    for (const Point& p : {point_at(start, axis, k * axis.length / elements), axis.direction})
      reference.insert(reference.end(), p.begin(), p.end());
  return std::make_unique<FlexibleBody>(
      std::move(name), 2, std::move(reference),
      one(make_cable_group(section, all_nodes(elements), equal_lengths(axis, elements))));
}

std::unique_ptr<FlexibleBody> make_shell_body(std::string name, const std::vector<Point>& positions,
                                              const std::vector<Point>& directors,
                                              const std::vector<std::array<Index, 4>>& quads, const Material& material,
                                              double thickness) {
  if (positions.size() != directors.size())
    throw std::invalid_argument(
        fmt::format("flexible body '{}': {} positions but {} directors", name, positions.size(), directors.size()));
  std::vector<double> reference;
  for (std::size_t k = 0; k < positions.size(); ++k)
    for (const Point& p : {positions[k], directors[k]}) reference.insert(reference.end(), p.begin(), p.end());
  return std::make_unique<FlexibleBody>(std::move(name), 2, std::move(reference),
                                        one(make_shell_group(material, thickness, quads)));
}

}  // namespace espalier::dynamics
