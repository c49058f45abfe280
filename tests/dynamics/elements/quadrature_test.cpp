// Quadrature rules. Truth: integrals of monomials up to the degree of each rule, and that the next degree is not exact.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "dynamics/elements/shape_functions.hpp"

namespace espalier::dynamics {
namespace {

namespace quadrature_test {

// Along some of the coordinates a simplex, along the others the line [-1, 1]; degrees in all of the former together,
// and in each of the latter.
struct Exactness {
  std::span<const QuadraturePoint> rule;
  int simplex, line;  // how many coordinates
  int simplex_degree, line_degree;
};

double simplex_integral(const std::array<int, 3>& power, int dimension) {
  double value = 1;
  int sum = 0;
  for (int d = 0; d < dimension; ++d) {
    value *= std::tgamma(power[static_cast<std::size_t>(d)] + 1);
    sum += power[static_cast<std::size_t>(d)];
  }
  return value / std::tgamma(sum + dimension + 1);
}

double error_of(const Exactness& e, const std::array<int, 3>& power) {
  double sum = 0, truth = simplex_integral(power, e.simplex);
  for (int d = e.simplex; d < e.simplex + e.line; ++d) {
    const int p = power[static_cast<std::size_t>(d)];
    truth *= p % 2 == 0 ? 2.0 / (p + 1) : 0.0;
  }
  for (const QuadraturePoint& point : e.rule) {
    double term = point.weight;
    for (std::size_t d = 0; d < 3; ++d) term *= std::pow(point.xi[d], power[d]);
    sum += term;
  }
  return std::abs(sum - truth);
}

std::vector<Exactness> rules() {
  using enum ElementType;
  return {{quadrature(tet4, Rule::stiffness), 3, 0, 1, 0},
          {quadrature(tet4, Rule::mass), 3, 0, 2, 0},
          {quadrature(tet10, Rule::stiffness), 3, 0, 2, 0},
          {quadrature(tet10, Rule::mass), 3, 0, 5, 0},
          {quadrature(hex8, Rule::stiffness), 0, 3, 0, 3},
          {quadrature(hex20, Rule::reduced), 0, 3, 0, 3},
          {quadrature(hex20, Rule::stiffness), 0, 3, 0, 5},
          {quadrature(wedge6, Rule::stiffness), 2, 1, 2, 3},
          {quadrature(wedge15, Rule::stiffness), 2, 1, 2, 5},
          {quadrature(wedge15, Rule::mass), 2, 1, 5, 5},
          {face_quadrature(tri3), 2, 0, 2, 0},
          {face_quadrature(tri6), 2, 0, 5, 0},
          {face_quadrature(quad4), 0, 2, 0, 3},
          {face_quadrature(quad8), 0, 2, 0, 5}};
}

TEST(Quadrature, IsExactUpToItsDegree) {
  int number = 0;
  for (const Exactness& e : rules()) {
    const int degree = std::max(e.simplex_degree, e.line_degree) + 1;
    double beyond = 0;
    for (int a = 0; a <= degree; ++a)
      for (int b = 0; b <= degree; ++b)
        for (int c = 0; c <= degree; ++c) {
          const std::array<int, 3> power{a, b, c};
          int together = 0, most = 0;
          for (int d = 0; d < 3; ++d) {
            const int p = power[static_cast<std::size_t>(d)];
            if (d < e.simplex)
              together += p;
            else if (d < e.simplex + e.line)
              most = std::max(most, p);
            else if (p > 0)
              together = degree + 100;  // no such coordinate
          }
          if (together <= e.simplex_degree && most <= e.line_degree) {
            EXPECT_NEAR(error_of(e, power), 0, 1e-14) << "rule " << number << ": " << a << " " << b << " " << c;
          } else if (together < 100) {
            beyond = std::max(beyond, error_of(e, power));
          }
        }
    EXPECT_GT(beyond, 1e-6) << "rule " << number;
    ++number;
  }
}

}  // namespace quadrature_test

}  // namespace
}  // namespace espalier::dynamics
