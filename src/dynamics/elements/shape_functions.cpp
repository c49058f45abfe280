#include "dynamics/elements/shape_functions.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <vector>

namespace espalier::dynamics {
namespace {

constexpr double kCorner[8][3] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1},
                                  {-1, -1, 1},  {1, -1, 1},  {1, 1, 1},  {-1, 1, 1}};
// Mid-side nodes of hex20: the coordinate that is 0 marks the edge's direction.
constexpr double kEdge[12][3] = {{0, -1, -1}, {1, 0, -1}, {0, 1, -1},  {-1, 0, -1}, {0, -1, 1}, {1, 0, 1},
                                 {0, 1, 1},   {-1, 0, 1}, {-1, -1, 0}, {1, -1, 0},  {1, 1, 0},  {-1, 1, 0}};
constexpr int kTetEdge[6][2] = {{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}};

/// Volume (area) coordinates L of a simplex and their constant gradients.
template <int kDim>
struct Simplex {
  double l[kDim + 1];
  double g[kDim + 1][kDim];
  explicit Simplex(const double* xi) {
    l[0] = 1;
    for (int d = 0; d < kDim; ++d) {
      l[0] -= xi[d];
      l[d + 1] = xi[d];
      g[0][d] = -1;
      for (int e = 0; e < kDim; ++e) g[d + 1][e] = d == e ? 1 : 0;
    }
  }
};

template <int kDim>
void simplex_values(const double* xi, bool quadratic, double* n) {
  const Simplex<kDim> s(xi);
  constexpr int kEdges = kDim == 3 ? 6 : 3;
  for (int a = 0; a <= kDim; ++a) n[a] = quadratic ? s.l[a] * (2 * s.l[a] - 1) : s.l[a];
  if (!quadratic) return;
  for (int e = 0; e < kEdges; ++e) n[kDim + 1 + e] = 4 * s.l[kTetEdge[e][0]] * s.l[kTetEdge[e][1]];
}

template <int kDim>
void simplex_gradients(const double* xi, bool quadratic, double* dn) {
  const Simplex<kDim> s(xi);
  constexpr int kEdges = kDim == 3 ? 6 : 3;
  const int nodes = kDim + 1 + (quadratic ? kEdges : 0);
  for (int d = 0; d < kDim; ++d) {
    for (int a = 0; a <= kDim; ++a) dn[d * nodes + a] = s.g[a][d] * (quadratic ? 4 * s.l[a] - 1 : 1);
    if (!quadratic) continue;
    for (int e = 0; e < kEdges; ++e) {
      const int i = kTetEdge[e][0];
      const int j = kTetEdge[e][1];
      dn[d * nodes + kDim + 1 + e] = 4 * (s.g[i][d] * s.l[j] + s.l[i] * s.g[j][d]);
    }
  }
}

/// The serendipity family in kDim dimensions: value and gradient of one node at `node` (coordinates -1, 0, 1).
/// Source: Zienkiewicz and Taylor, The Finite Element Method I, 5th ed., section 8.7.
template <int kDim>
double serendipity(const double* node, const double* xi, bool quadratic, double* gradient) {
  double f[kDim];  // factor of each coordinate: 1 + xi_a xi, or 1 - xi^2 where the node lies at 0
  double df[kDim];
  bool corner = true;
  double factor = 1;
  double sum = -(kDim - 1);
  for (int d = 0; d < kDim; ++d) {
    const bool mid = node[d] == 0;
    corner = corner && !mid;
    f[d] = mid ? 1 - xi[d] * xi[d] : 1 + node[d] * xi[d];
    df[d] = mid ? -2 * xi[d] : node[d];
    factor *= mid ? 1.0 : 0.5;
    sum += node[d] * xi[d];
  }
  double product = factor;
  for (int d = 0; d < kDim; ++d) product *= f[d];
  const bool with_sum = corner && quadratic;
  for (int d = 0; d < kDim; ++d) {
    double g = factor * df[d];
    for (int e = 0; e < kDim; ++e) g *= e == d ? 1.0 : f[e];
    gradient[d] = with_sum ? g * sum + product * node[d] : g;
  }
  return with_sum ? product * sum : product;
}

/// Corner nodes of a quadrilateral are those of a hexahedron's first face; its mid-side nodes too.
template <int kDim>
const double* brick_node(int a) {
  constexpr int kCorners = kDim == 3 ? 8 : 4;
  return a < kCorners ? kCorner[a] : kEdge[a - kCorners];
}

template <int kDim>
void brick(const double* xi, bool quadratic, double* n, double* dn) {
  const int nodes = kDim == 3 ? (quadratic ? 20 : 8) : (quadratic ? 8 : 4);
  for (int a = 0; a < nodes; ++a) {
    double gradient[kDim];
    const double value = serendipity<kDim>(brick_node<kDim>(a), xi, quadratic, gradient);
    if (n != nullptr) n[a] = value;
    for (int d = 0; d < kDim && dn != nullptr; ++d) dn[d * nodes + a] = gradient[d];
  }
}

/// Triangle times line, nodes on edges alone: L_i (1 -+ t) / 2, and of second order 1/2 L_i ((2 L_i - 1) (1 -+ t) -
/// (1 - t^2)) at corners, 2 L_i L_j (1 -+ t) and L_i (1 - t^2) between them. t is the third coordinate.
/// Source: Zienkiewicz and Taylor, The Finite Element Method I, 5th ed., section 8.12.
void wedge(const double* xi, bool quadratic, double* n, double* dn) {
  const Simplex<2> s(xi);
  const double t = xi[2], bubble = 1 - t * t;
  const int nodes = quadratic ? 15 : 6;
  // A node's function from f(L_i, L_j), its slopes along both, and g(t) with its slope: f g.
  const auto set_node = [&](int a, double value, const double(&by_xi)[2], double by_t) {
    if (n != nullptr) n[a] = value;
    if (dn == nullptr) return;
    dn[a] = by_xi[0];
    dn[nodes + a] = by_xi[1];
    dn[2 * nodes + a] = by_t;
  };
  for (int i = 0; i < 3; ++i) {
    const double l = s.l[i];
    const int j = (i + 1) % 3;
    for (const int side : {-1, 1}) {
      const double up = 0.5 * (1 + side * t), slope = 0.5 * side;
      const int corner = side < 0 ? i : 3 + i;
      if (!quadratic) {
        set_node(corner, l * up, {s.g[i][0] * up, s.g[i][1] * up}, l * slope);
        continue;
      }
      const double by_l = (4 * l - 1) * up - 0.5 * bubble;
      set_node(corner, l * ((2 * l - 1) * up - 0.5 * bubble), {s.g[i][0] * by_l, s.g[i][1] * by_l},
               l * ((2 * l - 1) * slope + t));
      double edge[2];
      for (int d = 0; d < 2; ++d) edge[d] = 4 * up * (s.g[i][d] * s.l[j] + l * s.g[j][d]);
      set_node((side < 0 ? 6 : 9) + i, 4 * l * s.l[j] * up, edge, 4 * l * s.l[j] * slope);
    }
    if (quadratic) set_node(12 + i, l * bubble, {s.g[i][0] * bubble, s.g[i][1] * bubble}, -2 * l * t);
  }
}

using Points = std::vector<QuadraturePoint>;

/// Places and weights of Gauss' rules on [-1, 1].
std::vector<std::array<double, 2>> gauss_line(int points) {
  static const double two = 0.57735026918962576451;    // 1 / sqrt(3)
  static const double three = 0.77459666924148337704;  // sqrt(3 / 5)
  if (points == 2) return {{-two, 1}, {two, 1}};
  return {{-three, 5.0 / 9}, {0, 8.0 / 9}, {three, 5.0 / 9}};
}

Points gauss_product(int per_direction, int dimension) {
  const std::vector<std::array<double, 2>> line = gauss_line(per_direction);
  Points points;
  const std::vector<std::array<double, 2>> once = {{0, 1}};
  for (const auto& c : dimension == 3 ? line : once)
    for (const auto& b : line)
      for (const auto& a : line) points.push_back({{a[0], b[0], c[0]}, a[1] * b[1] * c[1]});
  return points;
}

/// All distinct permutations of volume coordinates: a, a, a, 1 - 3a.
void add_four(Points& points, double a, double weight) {
  const double b = 1 - 3 * a;
  for (const std::array<double, 3>& xi : {std::array{a, a, a}, {b, a, a}, {a, b, a}, {a, a, b}})
    points.push_back({xi, weight / 6});
}
/// a, a, b, b with b = 1/2 - a.
void add_six(Points& points, double a, double weight) {
  const double b = 0.5 - a;
  for (const std::array<double, 3>& xi : {std::array{a, a, b}, {a, b, a}, {b, a, a}, {b, b, a}, {b, a, b}, {a, b, b}})
    points.push_back({xi, weight / 6});
}

Points tetrahedron(int count) {
  Points points;
  if (count == 1) points.push_back({{0.25, 0.25, 0.25}, 1.0 / 6});
  if (count == 4) add_four(points, 0.13819660112501051518, 0.25);  // (5 - sqrt 5) / 20
  if (count == 14) {
    add_four(points, 0.31088591926330060980, 0.11268792571801585080);
    add_four(points, 0.092735250310891226402, 0.073493043116361949544);
    add_six(points, 0.045503704125649649492, 0.042546020777081466438);
  }
  return points;
}

/// Degree 2 with 3 points for tri3; degree 5 with 7 points (Radon 1948) for tri6.
Points triangle(bool quadratic) {
  if (!quadratic)
    return {{{1.0 / 6, 1.0 / 6, 0}, 1.0 / 6}, {{2.0 / 3, 1.0 / 6, 0}, 1.0 / 6}, {{1.0 / 6, 2.0 / 3, 0}, 1.0 / 6}};
  Points points = {{{1.0 / 3, 1.0 / 3, 0}, 9.0 / 80}};
  const auto add = [&](double a, double w) {
    points.push_back({{a, a, 0}, w});
    points.push_back({{1 - 2 * a, a, 0}, w});
    points.push_back({{a, 1 - 2 * a, 0}, w});
  };
  add(0.10128650732345633880, 0.12593918054482715260 / 2);
  add(0.47014206410511508977, 0.13239415278850618074 / 2);
  return points;
}

/// A rule of the triangle at each point of Gauss' rule of the line.
Points wedge_product(const Points& triangle, int along) {
  Points points;
  for (const auto& [t, weight] : gauss_line(along))
    for (const QuadraturePoint& p : triangle) points.push_back({{p.xi[0], p.xi[1], t}, weight * p.weight});
  return points;
}

[[noreturn]] void unknown(const char* function, ElementType type) {
  throw std::invalid_argument(fmt::format("{}: no rule or function for {}", function, shape_of(type).name));
}

}  // namespace

std::span<const QuadraturePoint> quadrature(ElementType type, Rule rule) {
  static const Points tet1 = tetrahedron(1), tet4 = tetrahedron(4), tet14 = tetrahedron(14);
  static const Points hex8 = gauss_product(2, 3), hex27 = gauss_product(3, 3);
  static const Points wedge6 = wedge_product(triangle(false), 2), wedge9 = wedge_product(triangle(false), 3),
                      wedge21 = wedge_product(triangle(true), 3);
  switch (type) {
    case ElementType::wedge6:
      return wedge6;
    case ElementType::wedge15:
      return rule == Rule::mass ? wedge21 : wedge9;
    case ElementType::tet4:
      return rule == Rule::mass ? tet4 : tet1;
    case ElementType::tet10:
      return rule == Rule::mass ? tet14 : tet4;
    case ElementType::hex8:
      return hex8;
    case ElementType::hex20:
      return rule == Rule::reduced ? hex8 : hex27;
    default:
      unknown("quadrature", type);
  }
}

std::span<const QuadraturePoint> face_quadrature(ElementType type) {
  static const Points tri3 = triangle(false), tri6 = triangle(true);
  static const Points quad4 = gauss_product(2, 2), quad8 = gauss_product(3, 2);
  switch (type) {
    case ElementType::tri3:
      return tri3;
    case ElementType::tri6:
      return tri6;
    case ElementType::quad4:
      return quad4;
    case ElementType::quad8:
      return quad8;
    default:
      unknown("face_quadrature", type);
  }
}

void shape_values(ElementType type, const double* xi, double* n) {
  switch (type) {
    case ElementType::tet4:
      return simplex_values<3>(xi, false, n);
    case ElementType::tet10:
      return simplex_values<3>(xi, true, n);
    case ElementType::tri3:
      return simplex_values<2>(xi, false, n);
    case ElementType::tri6:
      return simplex_values<2>(xi, true, n);
    case ElementType::hex8:
      return brick<3>(xi, false, n, nullptr);
    case ElementType::hex20:
      return brick<3>(xi, true, n, nullptr);
    case ElementType::wedge6:
      return wedge(xi, false, n, nullptr);
    case ElementType::wedge15:
      return wedge(xi, true, n, nullptr);
    case ElementType::quad4:
      return brick<2>(xi, false, n, nullptr);
    case ElementType::quad8:
      return brick<2>(xi, true, n, nullptr);
    default:
      unknown("shape_values", type);
  }
}

void shape_gradients(ElementType type, const double* xi, double* dn) {
  switch (type) {
    case ElementType::tet4:
      return simplex_gradients<3>(xi, false, dn);
    case ElementType::tet10:
      return simplex_gradients<3>(xi, true, dn);
    case ElementType::tri3:
      return simplex_gradients<2>(xi, false, dn);
    case ElementType::tri6:
      return simplex_gradients<2>(xi, true, dn);
    case ElementType::hex8:
      return brick<3>(xi, false, nullptr, dn);
    case ElementType::hex20:
      return brick<3>(xi, true, nullptr, dn);
    case ElementType::wedge6:
      return wedge(xi, false, nullptr, dn);
    case ElementType::wedge15:
      return wedge(xi, true, nullptr, dn);
    case ElementType::quad4:
      return brick<2>(xi, false, nullptr, dn);
    case ElementType::quad8:
      return brick<2>(xi, true, nullptr, dn);
    default:
      unknown("shape_gradients", type);
  }
}

}  // namespace espalier::dynamics
