#include "dynamics/mesh/line_mesh.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <map>

#include "dynamics/mesh/names.hpp"

namespace espalier::dynamics {
namespace {

using Vector = Eigen::Vector3d;
constexpr double kSame = 1e-6;  // between unit vectors

Vector vector_of(const Point& p) { return {p[0], p[1], p[2]}; }
Point point_of(const Vector& v) { return {v.x(), v.y(), v.z()}; }

/// Half of an element of three nodes, or a whole one.
struct Piece {
  std::array<Index, 2> nodes{};
  Index element = 0;
  double length = 0;
  Vector x, y;
  int next = -1;      // the piece that goes on
  bool first = true;  // no piece comes before
};

class Maker {
 public:
  Maker(const Mesh& mesh, const LineElements& elements) : mesh_(mesh), elements_(elements) {
    for (Index e = 0; e < mesh.element_count(); ++e) split(e);
  }

  LineMesh run() {
    if (!elements_.pinned) link();
    out_.mesh.name = mesh_.name;
    out_.mesh.notices = mesh_.notices;
    out_.mesh.materials = mesh_.materials;
    for (std::size_t k = 0; k < pieces_.size(); ++k)
      if (pieces_[k].first) add_chain(k);
    for (const auto& [name, nodes] : mesh_.node_sets) {
      auto& set = out_.mesh.node_sets[name];
      for (const Index n : nodes)
        if (const auto at = first_.find(n); at != first_.end()) set.push_back(at->second);
      sort_unique(set);
    }
    for (const auto& [name, list] : mesh_.element_sets) {
      auto& set = out_.mesh.element_sets[name];
      for (const Index e : list) set.insert(set.end(), made_of_[e].begin(), made_of_[e].end());
      sort_unique(set);
    }
    return std::move(out_);
  }

 private:
  [[nodiscard]] Vector place(Index n) const { return vector_of(mesh_.nodes[static_cast<std::size_t>(n)]); }

  void split(Index e) {
    const auto nodes = mesh_.element(e);
    if (mesh_.type(e) == ElementType::line2) return add_piece(e, nodes[0], nodes[1]);
    // Files count the node in the middle second or last: it is the one that is nearest to both others.
    std::array<double, 3> sum{};
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t other = 0; other < 3; ++other) sum[k] += (place(nodes[k]) - place(nodes[other])).norm();
    const auto middle = static_cast<std::size_t>(std::min_element(sum.begin(), sum.end()) - sum.begin());
    const std::size_t last = middle == 2 ? 1 : 2;
    if (middle == 0)
      throw Error(StatusCode::invalid_input,
                  fmt::format("mesh '{}', element {}: its first node lies between the others", mesh_.name,
                              element_name(mesh_, e)));
    add_piece(e, nodes[0], nodes[middle]);
    add_piece(e, nodes[middle], nodes[last]);
  }

  void add_piece(Index e, Index a, Index b) {
    Piece piece{{a, b}, e, (place(b) - place(a)).norm(), {}, {}};
    if (!(piece.length > 0))
      throw Error(StatusCode::invalid_input,
                  fmt::format("mesh '{}': element {} has no length", mesh_.name, element_name(mesh_, e)));
    piece.x = (place(b) - place(a)) / piece.length;
    const Vector towards = vector_of(elements_.y[static_cast<std::size_t>(e)]);
    piece.y = towards - towards.dot(piece.x) * piece.x;
    if (!(piece.y.norm() > kSame * towards.norm()))
      throw Error(
          StatusCode::invalid_input,
          fmt::format("mesh '{}': the y axis of the section of element {} lies along it: state another direction, "
                      "in the file or by 'y'",
                      mesh_.name, element_name(mesh_, e)));
    piece.y.normalize();
    at_[a].push_back(pieces_.size());
    at_[b].push_back(pieces_.size());
    pieces_.push_back(piece);
  }

  void link() {
    for (const auto& [node, list] : at_) {
      if (list.size() != 2) continue;
      for (const auto& [before, after] : {std::pair{list[0], list[1]}, std::pair{list[1], list[0]}}) {
        Piece &a = pieces_[before], &b = pieces_[after];
        const auto section = [&](const Piece& p) { return elements_.section[static_cast<std::size_t>(p.element)]; };
        if (a.nodes[1] != node || b.nodes[0] != node || section(a) != section(b) || (a.x - b.x).norm() > kSame ||
            (a.y - b.y).norm() > kSame)
          continue;
        a.next = static_cast<int>(after);
        b.first = false;
      }
    }
  }

  void add_chain(std::size_t piece) {
    LineChain chain{static_cast<Index>(out_.mesh.nodes.size()),
                    {},
                    elements_.section[static_cast<std::size_t>(pieces_[piece].element)]};
    add_node(pieces_[piece].nodes[0], pieces_[piece]);
    for (int k = static_cast<int>(piece); k >= 0; k = pieces_[static_cast<std::size_t>(k)].next) {
      const Piece& p = pieces_[static_cast<std::size_t>(k)];
      const Index last = add_node(p.nodes[1], p);
      made_of_[p.element].push_back(out_.mesh.add_element(ElementType::line2, std::array{last - 1, last}));
      out_.mesh.element_labels.push_back(mesh_.element_label(p.element));
      chain.lengths.push_back(p.length);
    }
    out_.chains.push_back(std::move(chain));
  }

  Index add_node(Index n, const Piece& p) {
    const auto own = static_cast<Index>(out_.mesh.nodes.size());
    out_.mesh.nodes.push_back(mesh_.nodes[static_cast<std::size_t>(n)]);
    out_.mesh.node_labels.push_back(mesh_.node_label(n));
    out_.axes.push_back({point_of(p.x), point_of(p.y), point_of(p.x.cross(p.y))});
    if (const auto [known, fresh] = first_.emplace(n, own); !fresh) out_.joined.push_back({known->second, own});
    return own;
  }

  const Mesh& mesh_;
  const LineElements& elements_;
  std::vector<Piece> pieces_;
  std::map<Index, std::vector<std::size_t>> at_;  // pieces at each node
  std::map<Index, Index> first_;                  // node of the file -> of the body
  std::map<Index, std::vector<Index>> made_of_;   // element of the file -> of the body
  LineMesh out_;
};

}  // namespace

LineMesh make_line_mesh(const Mesh& mesh, const LineElements& elements) { return Maker(mesh, elements).run(); }

}  // namespace espalier::dynamics
