/// \file
/// The coordinate systems in which .inp files define nodes.
#pragma once

#include "dynamics/mesh/mesh.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {

/// A rectangular system (*SYSTEM); the global one until it is read.
struct InpSystem {
  Point origin{}, x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  [[nodiscard]] Point global(const Point& local) const;
};

/// Reads the data lines of *SYSTEM: origin, a point on the x axis, and one in the plane of x and y; without lines it is
/// the global system. @throws Error where the points lie on one line
InpSystem read_inp_system(LineReader& reader);

/// Coordinates of SYSTEM=R, C (radius, degrees about z, z) or S (radius, degrees about z, degrees above the plane of x
/// and y) in the rectangular system of the same origin. @throws Error for another kind
Point inp_rectangular(const LineReader& reader, const std::string& kind, const Point& p);

/// `p` turned by `degrees` about the axis through `from` and `to` (Rodrigues' formula).
Point turned_about(const Point& from, const Point& to, double degrees, const Point& p);

}  // namespace espalier::dynamics
