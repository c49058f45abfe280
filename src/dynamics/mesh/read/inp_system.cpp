#include "dynamics/mesh/read/inp_system.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "dynamics/mesh/read/inp_lines.hpp"

namespace espalier::dynamics {
namespace {

Point inp_unit(const LineReader& reader, Point p) {
  const double length = std::hypot(p[0], p[1], p[2]);
  if (!(length > 0)) reader.fail("*SYSTEM: its points lie on one line");
  for (double& c : p) c /= length;
  return p;
}
Point inp_cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

}  // namespace

Point InpSystem::global(const Point& local) const {
  Point p = origin;
  for (std::size_t d = 0; d < 3; ++d) p[d] += local[0] * x[d] + local[1] * y[d] + local[2] * z[d];
  return p;
}

InpSystem read_inp_system(LineReader& reader) {
  InpSystem s;
  std::string_view line;
  if (!next_inp_data(reader, line)) return s;
  double first[6] = {}, second[3] = {};
  Fields fields(reader, line, ',');
  const int given = read_inp_reals(fields, first, 6);
  bool plane = false;
  if (next_inp_data(reader, line)) {
    Fields more(reader, line, ',');
    plane = read_inp_reals(more, second, 3) > 0;
  }
  s.origin = {first[0], first[1], first[2]};
  if (given <= 3) return s;
  Point a{}, b{};
  for (std::size_t d = 0; d < 3; ++d) {
    a[d] = first[3 + d] - s.origin[d];
    b[d] = second[d] - s.origin[d];
  }
  if (!plane) a[2] = 0;  // the z axis stays
  s.x = inp_unit(reader, a);
  if (plane) s.z = inp_unit(reader, inp_cross(s.x, b));
  s.y = inp_cross(s.z, s.x);
  return s;
}

Point inp_rectangular(const LineReader& reader, const std::string& kind, const Point& p) {
  constexpr double kDegree = std::numbers::pi / 180;
  const std::string k = upper(kind);
  if (k.empty() || k == "R" || k == "RC") return p;
  if (k != "C" && k != "S") reader.fail(fmt::format("SYSTEM={} is not read (R, C and S are)", kind));
  const double across = k == "C" ? p[0] : p[0] * std::cos(p[2] * kDegree);
  return {across * std::cos(p[1] * kDegree), across * std::sin(p[1] * kDegree),
          k == "C" ? p[2] : p[0] * std::sin(p[2] * kDegree)};
}

Point turned_about(const Point& from, const Point& to, double degrees, const Point& p) {
  Point axis{}, r{}, result{};
  for (std::size_t d = 0; d < 3; ++d) {
    axis[d] = to[d] - from[d];
    r[d] = p[d] - from[d];
  }
  const double length = std::hypot(axis[0], axis[1], axis[2]), angle = degrees * std::numbers::pi / 180;
  const double c = std::cos(angle), s = std::sin(angle);
  double along = 0;
  for (std::size_t d = 0; d < 3; ++d) along += (axis[d] /= length) * r[d];
  for (std::size_t d = 0; d < 3; ++d) {
    const std::size_t e = (d + 1) % 3, f = (d + 2) % 3;
    result[d] = from[d] + c * r[d] + s * (axis[e] * r[f] - axis[f] * r[e]) + (1 - c) * along * axis[d];
  }
  return result;
}

}  // namespace espalier::dynamics
