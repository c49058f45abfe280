/// \file
/// Functions given by points: y(x) with two derivatives, and what they are outside of the points.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/named.hpp"

namespace espalier::dynamics::model {

/// A value with its first two derivatives by x.
struct CurvePoint {
  double y = 0, slope = 0, bend = 0;
};

/// A piecewise polynomial through points (x_i, y_i), x strictly increasing.
class Curve {
 public:
  enum class Kind {
    linear,    ///< straight pieces; the slope jumps at the points
    akima,     ///< Akima, J. ACM 17 (1970): cubic pieces with continuous slopes that do not overshoot at corners
    monotone,  ///< Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984): continuous slopes, no new extrema
    cubic      ///< natural cubic spline: continuous second derivative
  };
  enum class Outside {
    constant,  ///< the value of the end
    linear,    ///< the tangent at the end goes on
    error      ///< asking is an error
  };
  /// @param name of the curve, for messages
  /// @throws std::invalid_argument if there are fewer than two points, x does not increase, or a number is not finite
  Curve(std::string name, std::vector<double> x, std::vector<double> y, Kind kind, Outside outside);

  /// @throws espalier::Error(invalid_input) naming curve, x and the range where x lies outside and Outside is error
  [[nodiscard]] CurvePoint at(double x) const;
  [[nodiscard]] const std::string& name() const { return name_; }
  /// Points where it bends so sharply that a step of time must not leave out more than one of them: a straight line
  /// from point to point there misses it by more than a thousandth of its whole range (linear), or by a third of it
  /// (the smooth kinds: what has two or three points alone).
  [[nodiscard]] bool has_corners() const { return !corners_.empty(); }
  /// Rises by 1 from corner to corner; a whole number at each.
  [[nodiscard]] double level(double x) const;

 private:
  void akima_slopes();
  void monotone_slopes();
  void natural_slopes();
  [[nodiscard]] CurvePoint inside(double x) const;
  [[nodiscard]] double secant(std::size_t i) const { return (y_[i + 1] - y_[i]) / (x_[i + 1] - x_[i]); }

  void find_corners(double sharp);

  std::string name_;
  std::vector<double> x_, y_, slope_;  // slope_: at the points; empty for linear
  std::vector<double> corners_;        // their x
  Outside outside_;
};

inline constexpr base::Named<Curve::Kind> kCurveKinds[] = {{"linear", Curve::Kind::linear},
                                                           {"akima", Curve::Kind::akima},
                                                           {"monotone", Curve::Kind::monotone},
                                                           {"cubic", Curve::Kind::cubic}};
inline constexpr base::Named<Curve::Outside> kCurveOutsides[] = {
    {"constant", Curve::Outside::constant}, {"linear", Curve::Outside::linear}, {"error", Curve::Outside::error}};

using CurvePtr = std::shared_ptr<const Curve>;

}  // namespace espalier::dynamics::model
