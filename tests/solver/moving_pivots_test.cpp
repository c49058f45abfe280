// Pivots that fail where the ordering puts them. The truth is the backward error that tests/reference computes.
#include <gtest/gtest.h>

#include <array>
#include <random>
#include <utility>

#include "solver_common.hpp"

namespace espalier::test {
namespace {

/// Newton's matrix of incompressible flow in a square box, by finite differences on a staggered grid (Harlow and Welch
/// 1965): velocities in the middle of the faces of side x side cells, pressures in the cells, the first one left out,
/// without a diagonal entry. The flow it is linearised about is a vortex of speed 1 with noise.
class FlowInABox {
 public:
  FlowInABox(Index side, double viscosity, std::uint64_t seed) : side_(side), random_(seed) {
    const double h = 1.0 / side;
    for (Index j = 0; j < side; ++j)
      for (Index i = 1; i < side; ++i) {
        face(u(i, j), i * h, (j + 0.5) * h, viscosity, {u(i - 1, j), u(i + 1, j), u(i, j - 1), u(i, j + 1)});
        for (const Index other : {v(i - 1, j), v(i, j), v(i - 1, j + 1), v(i, j + 1)}) couple(u(i, j), other);
        pressure(u(i, j), p(i - 1, j), p(i, j));
      }
    for (Index j = 1; j < side; ++j)
      for (Index i = 0; i < side; ++i) {
        face(v(i, j), (i + 0.5) * h, j * h, viscosity, {v(i - 1, j), v(i + 1, j), v(i, j - 1), v(i, j + 1)});
        for (const Index other : {u(i, j - 1), u(i + 1, j - 1), u(i, j), u(i + 1, j)}) couple(v(i, j), other);
        pressure(v(i, j), p(i, j - 1), p(i, j));
      }
  }

  [[nodiscard]] SparseMatrix matrix() const {
    return reference::from_triples(2 * side_ * (side_ - 1) + side_ * side_ - 1, triples_, Storage::general);
  }

 private:
  // Numbers of unknowns; -1: on or beyond the wall, or the first pressure.
  [[nodiscard]] Index u(Index i, Index j) const {
    return i < 1 || i >= side_ || j < 0 || j >= side_ ? -1 : j * (side_ - 1) + i - 1;
  }
  [[nodiscard]] Index v(Index i, Index j) const {
    return j < 1 || j >= side_ || i < 0 || i >= side_ ? -1 : side_ * (side_ - 1) + (j - 1) * side_ + i;
  }
  [[nodiscard]] Index p(Index i, Index j) const {
    return i == 0 && j == 0 ? -1 : 2 * side_ * (side_ - 1) + j * side_ + i - 1;
  }

  void add(Index row, Index col, double value) {
    if (row >= 0 && col >= 0) triples_.push_back({row, col, value});
  }
  double noise() { return std::uniform_real_distribution<double>(-1, 1)(random_); }

  // Viscosity and convection by central differences, times h: west, east, south, north.
  void face(Index me, double x, double y, double viscosity, const std::array<Index, 4>& other) {
    const double h = 1.0 / side_, pi = std::acos(-1.0);
    const double wx = std::sin(pi * x) * std::cos(pi * y) + 0.3 * noise();
    const double wy = -std::cos(pi * x) * std::sin(pi * y) + 0.3 * noise();
    add(me, me, 4 * viscosity / h + h * noise());
    const std::array<double, 4> wind{-wx, wx, -wy, wy};
    for (std::size_t k = 0; k < 4; ++k) add(me, other[k], -viscosity / h + 0.5 * wind[k]);
  }
  // Newton's part: the other velocity times the slope of this one.
  void couple(Index me, Index other) { add(me, other, 0.25 * noise()); }
  void pressure(Index face, Index before, Index behind) {
    for (const auto& [cell, sign] : {std::pair{before, -1.0}, std::pair{behind, 1.0}}) {
      add(face, cell, sign);
      add(cell, face, sign);
    }
  }

  Index side_;
  std::mt19937_64 random_;
  std::vector<reference::Triple> triples_;
};

/// Solves, checks the answer, factorizes once more: that must not move anything.
void expect_moved_at_once(const SparseMatrix& a, Options o, int most_rounds, Index most_moved) {
  int rounds = 0;
  o.threads = 2;
  o.log = [&](const std::string& line) { rounds += line.find("to a later front") != std::string::npos ? 1 : 0; };
  Solver s(o);
  expect_solved(s, a);
  const Index moved = s.factorize(a).delayed;
  EXPECT_LE(rounds, most_rounds);
  EXPECT_LE(moved, most_moved);
  rounds = 0;
  EXPECT_EQ(s.factorize(a).delayed, moved);
  EXPECT_EQ(rounds, 0) << "the plan was forgotten";
}

TEST(MovingPivots, FlowKeepsItsPivotsWhereTheOrderingPutsThem) {
  for (const double viscosity : {1.0, 1e-1, 1e-2, 1e-3})
    for (const Index side : {4, 12, 30, 60}) {
      SCOPED_TRACE(testing::Message() << "viscosity " << viscosity << ", side " << side);
      const SparseMatrix a = FlowInABox(side, viscosity, 16).matrix();
      expect_moved_at_once(a, {}, 4, 2 + a.rows / 100);
    }
}

}  // namespace
}  // namespace espalier::test
