#include "dynamics/mesh/shell_mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <numeric>
#include <utility>

#include "base/at.hpp"
#include "dynamics/mesh/names.hpp"

namespace espalier::dynamics {
namespace {

using Edge = std::pair<Index, Index>;
using Quad = std::array<Index, 4>;

Edge edge_of(Index a, Index b) { return {std::min(a, b), std::max(a, b)}; }

Point plus(const Point& a, const Point& b, double factor) {
  return {a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]};
}
double dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
double length(const Point& a) { return std::sqrt(dot(a, a)); }
Point cross(const Point& a, const Point& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

class ShellMesher {
 public:
  ShellMesher(const Mesh& mesh, const std::vector<std::array<double, 4>>& thickness) : from_(mesh) {
    out_.mesh.name = mesh.name;
    out_.mesh.nodes = mesh.nodes;
    out_.mesh.node_sets = mesh.node_sets;
    for (Index k = 0; k < static_cast<Index>(mesh.nodes.size()); ++k) {
      out_.mesh.node_labels.push_back(mesh.node_label(k));
      next_label_ = std::max(next_label_, mesh.node_label(k) + 1);
    }
    Index firsts = 0, seconds = 0;  // elements without and with nodes in the middles of edges
    for (Index e = 0; e < mesh.element_count(); ++e) {
      check_type(e);
      check_nodes(e);
      corners_of_.push_back(at(shape_of(mesh.type(e)).corners));
      const bool second = mesh.element(e).size() > corners_of_.back();
      (second ? seconds : firsts) += 1;
      divide_ = divide_ || mesh.type(e) == ElementType::tri3 || (seconds > 0 && firsts > 0);
      for (std::size_t a = 0; second && a < corners_of_.back(); ++a)
        middles_.emplace(edge_of(mesh.element(e)[a], mesh.element(e)[(a + 1) % corners_of_.back()]),
                         mesh.element(e)[corners_of_.back() + a]);
    }
    for (Index e = 0; e < mesh.element_count(); ++e) add(e, thickness[at(e)]);
    if (divide_)
      out_.notices.push_back(
          fmt::format("our shells are quadrilaterals: {} elements, with triangles among them, became {} by the middles "
                      "of their edges",
                      mesh.element_count(), quads_.size()));
  }

  ShellMesh make(double offset) {
    mark_boundary();
    orient();
    extend_sets();
    make_directors(offset);
    for (const Quad& quad : quads_) out_.mesh.add_element(ElementType::quad4, quad);
    for (const auto& [name, set] : from_.element_sets)
      for (std::size_t q = 0; q < quads_.size(); ++q)
        if (std::binary_search(set.begin(), set.end(), element_[q]))
          out_.mesh.element_sets[name].push_back(static_cast<Index>(q));
    return std::move(out_);
  }

 private:
  [[noreturn]] void refuse(const std::string& what) const {
    throw Error(StatusCode::invalid_input, fmt::format("mesh '{}': {}", from_.name, what));
  }

  void check_type(Index e) const {
    switch (from_.type(e)) {
      case ElementType::tri3:
      case ElementType::tri6:
      case ElementType::quad4:
      case ElementType::quad8:
        return;
      default:
        refuse(
            fmt::format("element {} is a {}; shells are made of triangles and quadrilaterals, choose these by "
                        "'element_set'",
                        element_name(from_, e), shape_of(from_.type(e)).name));
    }
  }

  void check_nodes(Index e) const {
    const auto nodes = from_.element(e);
    for (std::size_t a = 0; a < nodes.size(); ++a)
      for (std::size_t b = a + 1; b < nodes.size(); ++b)
        if (nodes[a] == nodes[b])
          refuse(fmt::format("element {} has the node {} twice; give it as a triangle", element_name(from_, e),
                             node_name(from_, nodes[a])));
  }

  Index new_node(const Point& x) {
    out_.mesh.nodes.push_back(x);
    out_.mesh.node_labels.push_back(next_label_++);
    return static_cast<Index>(out_.mesh.nodes.size()) - 1;
  }

  Index middle(Index a, Index b) {
    const auto [it, fresh] = middles_.emplace(edge_of(a, b), 0);
    if (fresh) {
      Point x{};
      for (std::size_t i = 0; i < 3; ++i) x[i] = 0.5 * (out_.mesh.nodes[at(a)][i] + out_.mesh.nodes[at(b)][i]);
      it->second = new_node(x);
    }
    return it->second;
  }

  void add(Index e, const std::array<double, 4>& thickness) {
    const auto nodes = from_.element(e);
    const std::size_t corners = corners_of_[at(e)];
    const bool quadratic = nodes.size() > corners;
    if (!quadratic && !divide_) {
      add_quad({nodes[0], nodes[1], nodes[2], nodes[3]}, e, thickness);
      return;
    }
    std::vector<Index> mids;
    for (std::size_t a = 0; a < corners; ++a) {
      const Index b = nodes[(a + 1) % corners];
      mids.push_back(quadratic ? nodes[corners + a] : middle(nodes[a], b));
    }
    // The shape functions of second order in the middle; without nodes at the edges this is the mean of the corners.
    const double of_mid = corners == 4 ? 0.5 : 4.0 / 9, of_corner = corners == 4 ? -0.25 : -1.0 / 9;
    Point x{};
    for (std::size_t a = 0; a < corners; ++a)
      x = plus(plus(x, out_.mesh.nodes[at(nodes[a])], of_corner), out_.mesh.nodes[at(mids[a])], of_mid);
    const Index centre = new_node(x);
    inner_.emplace_back(centre,
                        std::vector<Index>(nodes.begin(), nodes.begin() + static_cast<std::ptrdiff_t>(corners)));
    double mean = 0;
    for (std::size_t a = 0; a < corners; ++a) mean += thickness[a] / static_cast<double>(corners);
    for (std::size_t a = 0; a < corners; ++a) {
      const std::size_t before = (a + corners - 1) % corners, after = (a + 1) % corners;
      add_quad({nodes[a], mids[a], centre, mids[before]}, e,
               {thickness[a], 0.5 * (thickness[a] + thickness[after]), mean, 0.5 * (thickness[before] + thickness[a])});
    }
  }

  void add_quad(const Quad& quad, Index element, const std::array<double, 4>& thickness) {
    quads_.push_back(quad);
    element_.push_back(element);
    thickness_.push_back(thickness);
  }

  /// Edges of one quadrilateral alone bound the surface; more than two are no shell.
  void mark_boundary() {
    for (std::size_t q = 0; q < quads_.size(); ++q)
      for (std::size_t a = 0; a < 4; ++a) sides_[edge_of(quads_[q][a], quads_[q][(a + 1) % 4])].push_back(q);
    std::vector<Index> boundary;
    for (const auto& [edge, quads] : sides_) {
      if (quads.size() > 2)
        refuse(
            fmt::format("{} elements meet at the edge from node {} to {}, element {} among them: walls that branch are "
                        "bodies of their own (element_set), joined by fixed joints",
                        quads.size(), out_.mesh.node_label(edge.first), out_.mesh.node_label(edge.second),
                        element_name(from_, element_[quads.front()])));
      if (quads.size() == 1) boundary.insert(boundary.end(), {edge.first, edge.second});
    }
    sort_unique(boundary);
    out_.mesh.node_sets.emplace("boundary", std::move(boundary));
  }

  [[nodiscard]] bool runs(const Quad& quad, Index a, Index b) const {
    for (std::size_t k = 0; k < 4; ++k)
      if (quad[k] == a && quad[(k + 1) % 4] == b) return true;
    return false;
  }

  /// Neighbours run along a common edge in opposite directions.
  void orient() {
    std::vector<char> known(quads_.size(), 0);
    std::size_t& turned = out_.turned;
    for (std::size_t first = 0; first < quads_.size(); ++first) {
      if (known[first] != 0) continue;
      known[first] = 1;
      std::deque<std::size_t> next = {first};
      while (!next.empty()) {
        const std::size_t q = next.front();
        next.pop_front();
        for (std::size_t a = 0; a < 4; ++a) {
          const Index from = quads_[q][a], to = quads_[q][(a + 1) % 4];
          for (const std::size_t other : sides_[edge_of(from, to)]) {
            if (other == q) continue;
            const bool same = runs(quads_[other], from, to);
            if (known[other] != 0 && same)
              refuse(
                  fmt::format("the surface has one side only (a Moebius strip): elements {} and {} contradict each "
                              "other",
                              element_name(from_, element_[q]), element_name(from_, element_[other])));
            if (known[other] != 0) continue;
            if (same) {
              std::reverse(quads_[other].begin(), quads_[other].end());
              std::reverse(thickness_[other].begin(), thickness_[other].end());
              ++turned;
            }
            known[other] = 1;
            next.push_back(other);
          }
        }
      }
    }
    if (turned > 0)
      out_.notices.push_back(fmt::format(
          "the normals of {} shells are turned to the side of their neighbours, that of the first element", turned));
  }

  /// New nodes belong to a set where the nodes do that they lie between: those of an edge on the boundary, or of an
  /// element.
  void extend_sets() {
    std::vector<Index> boundary = out_.mesh.node_sets["boundary"];
    for (auto& [name, set] : out_.mesh.node_sets) {
      const std::vector<Index> given = set;
      const auto has = [&](Index n) { return std::binary_search(given.begin(), given.end(), n); };
      for (const auto& [centre, corners] : inner_)
        if (std::all_of(corners.begin(), corners.end(), has)) {
          set.push_back(centre);
          for (std::size_t a = 0; a < corners.size(); ++a)
            set.push_back(middles_.at(edge_of(corners[a], corners[(a + 1) % corners.size()])));
        }
      for (const auto& [edge, mid] : middles_)
        if (has(edge.first) && has(edge.second) && std::binary_search(boundary.begin(), boundary.end(), mid))
          set.push_back(mid);
      sort_unique(set);
    }
  }

  [[nodiscard]] Point normal(std::size_t q) const {
    const auto& x = out_.mesh.nodes;
    const Quad& k = quads_[q];
    const Point n = cross(plus(x[at(k[2])], x[at(k[0])], -1), plus(x[at(k[3])], x[at(k[1])], -1));
    if (!(length(n) > 0)) refuse(fmt::format("element {} has no area", element_name(from_, element_[q])));
    for (std::size_t a = 0; a < 4; ++a) {
      const Point& here = x[at(k[a])];
      const Point corner = cross(plus(x[at(k[(a + 1) % 4])], here, -1), plus(x[at(k[(a + 3) % 4])], here, -1));
      if (!(dot(corner, n) > 0))
        refuse(fmt::format("element {} is folded or has an angle of 180 degrees and more at node {}",
                           element_name(from_, element_[q]), out_.mesh.node_labels[at(k[a])]));
    }
    return n;
  }

  void make_directors(double offset) {
    constexpr double kSharpest = 0.35;  // cosine between a director and the normal of a face: folds by 139 degrees
    const std::size_t count = out_.mesh.nodes.size();
    std::vector<Point> sum(count, Point{});
    std::vector<double> thick(count, 0.0), faces(count, 0.0), cosine(count, 0.0), least(count, 1.0);
    double mean = 0;
    for (const auto& t : thickness_) mean += std::accumulate(t.begin(), t.end(), 0.0);
    mean /= 4 * static_cast<double>(thickness_.size());
    out_.thickness = mean;
    for (std::size_t q = 0; q < quads_.size(); ++q) {
      const Point n = normal(q);
      for (std::size_t a = 0; a < 4; ++a) {
        const auto k = at(quads_[q][a]);
        sum[k] = plus(sum[k], n, 1 / length(n));
        thick[k] += thickness_[q][a];
        faces[k] += 1;
      }
    }
    for (std::size_t k = 0; k < count; ++k) {
      const double size = length(sum[k]);
      if (!(size > kSharpest * faces[k]))
        refuse(fmt::format("the shell folds too sharply at node {}", out_.mesh.node_labels[k]));
      for (double& x : sum[k]) x /= size;
    }
    for (std::size_t q = 0; q < quads_.size(); ++q) {
      const Point n = normal(q);
      for (const Index k : quads_[q]) {
        const double c = dot(sum[at(k)], n) / length(n);
        cosine[at(k)] += c / faces[at(k)];
        least[at(k)] = std::min(least[at(k)], c);
      }
    }
    for (std::size_t k = 0; k < count; ++k) {
      if (!(least[k] > kSharpest))
        refuse(
            fmt::format("the shell folds too sharply at node {}: a mitre there would be longer than three "
                        "thicknesses; make the walls bodies of their own (element_set), joined by fixed joints",
                        out_.mesh.node_labels[k]));
      const double scale = thick[k] / faces[k] / mean / cosine[k];
      Point d{};
      for (std::size_t i = 0; i < 3; ++i) d[i] = scale * sum[k][i];
      out_.directors.push_back(d);
      out_.positions.push_back(plus(out_.mesh.nodes[k], d, offset * mean));
    }
  }

  const Mesh& from_;
  ShellMesh out_;
  bool divide_ = false;
  std::int64_t next_label_ = 1;
  std::vector<std::size_t> corners_of_;
  std::vector<Quad> quads_;
  std::vector<Index> element_;                    // that each quadrilateral is of
  std::vector<std::array<double, 4>> thickness_;  // at the corners of each quadrilateral
  std::map<Edge, Index> middles_;
  std::map<Edge, std::vector<std::size_t>> sides_;
  std::vector<std::pair<Index, std::vector<Index>>> inner_;  // new nodes inside elements, with the corners around
};

}  // namespace

ShellMesh make_shell_mesh(const Mesh& mesh, const std::vector<std::array<double, 4>>& thickness, double offset) {
  return ShellMesher(mesh, thickness).make(offset);
}

}  // namespace espalier::dynamics
