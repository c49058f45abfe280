#include "dynamics/model/decks/held_pieces.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

namespace espalier::dynamics::model {
namespace {

using Row = std::vector<double>;

constexpr std::array<Point, 3> kGlobal = {Point{1, 0, 0}, Point{0, 1, 0}, Point{0, 0, 1}};

/// An orthonormal basis of rows.
class RowSpace {
 public:
  void add(Row row) {
    const double size = norm(row);
    if (!(size > 0) || !(norm(rest(row)) > kNear * size)) return;
    row = rest(rest(row));
    const double left = norm(row);
    for (double& x : row) x /= left;
    rows_.push_back(std::move(row));
  }
  [[nodiscard]] bool has(const Row& unit) const { return norm(rest(unit)) < kNear; }

 private:
  static constexpr double kNear = 1e-6;
  static double norm(const Row& a) { return std::sqrt(std::inner_product(a.begin(), a.end(), a.begin(), 0.0)); }
  [[nodiscard]] Row rest(Row a) const {
    for (const Row& row : rows_) {
      const double along = std::inner_product(a.begin(), a.end(), row.begin(), 0.0);
      for (std::size_t i = 0; i < a.size(); ++i) a[i] -= along * row[i];
    }
    return a;
  }
  std::vector<Row> rows_;
};

class Pieces {
 public:
  Pieces(const Deck& deck, const DeckChoice& choice) : deck_(deck), choice_(choice) {
    const auto nodes = deck.mesh.nodes.size();
    root_.resize(nodes);
    std::iota(root_.begin(), root_.end(), Index{0});
    piece_.assign(nodes, -1);
    std::vector<char> used(nodes, 0);
    thin_.assign(nodes, 0);
    note_solids();
    for (Index e = 0; e < deck.mesh.element_count(); ++e) {
      if (!counts(e)) continue;
      const auto list = deck.mesh.element(e);
      for (const Index n : list) {
        used[at(n)] = 1;
        if (shape_of(deck.mesh.type(e)).dimension < 3) thin_[at(n)] = 1;
        join(list.front(), n);
      }
    }
    std::map<Index, int> numbers;
    for (std::size_t n = 0; n < nodes; ++n)
      if (used[n] != 0)
        piece_[n] = numbers.try_emplace(find(static_cast<Index>(n)), static_cast<int>(numbers.size())).first->second;
    solids_ = static_cast<int>(numbers.size());
    count_ = solids_;
    if (takes(DeckKind::couplings))
      for (const auto& c : deck.couplings)
        if (piece(c.reference) < 0) piece_[at(c.reference)] = count_++;
    centre();
  }
  [[nodiscard]] int solids() const { return solids_; }
  [[nodiscard]] int count() const { return count_; }

  void add_rows() {
    if (takes(DeckKind::boundary))
      for (const auto& h : deck_.holds) {
        busy_.insert(h.node);
        if (h.direction < 3)
          add({{h.node, direction(h.node, h.direction), 1}});
        else
          turn(h.node, h.direction - 3);
      }
    if (takes(DeckKind::couplings)) couplings();
    if (takes(DeckKind::equations))
      for (const auto& e : deck_.equations) {
        std::vector<Term> terms;
        for (const auto& t : e.terms) {
          busy_.insert(t.node);
          if (t.direction < 3) terms.push_back({t.node, kGlobal[at(t.direction)], t.factor});
        }
        add(terms);
      }
    if (takes(DeckKind::ties)) ties();
    if (takes(DeckKind::springs))
      for (const auto& s : deck_.springs)
        if (s.stiffness != 0) between(s.a, s.b, s.direction < 0 ? line(s.a, s.b) : kGlobal[at(s.direction % 3)]);
    if (takes(DeckKind::connectors))
      for (const auto& c : deck_.connectors)
        for (const Point& d : kGlobal) between(c.a >= 0 ? c.a : c.b, c.a >= 0 ? c.b : -1, d);
  }

  [[nodiscard]] bool is_held(int piece) const {
    for (std::size_t k = 0; k < 6; ++k) {
      Row unit(6 * at(count_), 0);
      unit[6 * at(piece) + k] = 1;
      if (!space_.has(unit)) return false;
    }
    return true;
  }
  /// Takes the nodes of an element of the piece: three nodes that nothing leads, which it holds; false where there are
  /// none.
  bool hold(int piece, std::array<Index, 3>& corners) {
    for (Index e = 0; e < deck_.mesh.element_count(); ++e) {
      const auto list = deck_.mesh.element(e);
      if (!counts(e) || list.size() < 3 || this->piece(list.front()) != piece) continue;
      if (busy_.contains(list[0]) || busy_.contains(list[1]) || busy_.contains(list[2])) continue;
      corners = {list[0], list[1], list[2]};
      for (const Index n : corners)
        for (const Point& d : kGlobal) add({{n, d, 1}});
      return true;
    }
    return false;
  }

 private:
  struct Term {
    Index node;
    Point along;
    double factor;
  };
  template <class I>
  static std::size_t at(I i) {
    return static_cast<std::size_t>(i);
  }
  [[nodiscard]] bool takes(DeckKind kind) const { return choice_.takes(kind); }
  [[nodiscard]] int piece(Index node) const { return piece_[at(node)]; }
  void note_solids() {
    for (Index e = 0; e < deck_.mesh.element_count(); ++e)
      has_solids_ = has_solids_ || shape_of(deck_.mesh.type(e)).dimension == 3;
  }
  /// All elements, or of a deck that is not taken as a whole its solids.
  [[nodiscard]] bool counts(Index e) const {
    const int dimension = shape_of(deck_.mesh.type(e)).dimension;
    return dimension == 3 || (dimension > 0 && (choice_.all || !has_solids_));
  }
  Index find(Index n) {
    while (root_[at(n)] != n) n = root_[at(n)] = root_[at(root_[at(n)])];
    return n;
  }
  void join(Index a, Index b) { root_[at(find(b))] = find(a); }
  void centre() {
    const auto& nodes = deck_.mesh.nodes;
    for (const Point& p : nodes)
      for (std::size_t d = 0; d < 3; ++d) centre_[d] += p[d] / static_cast<double>(nodes.size());
    for (const Point& p : nodes)
      for (std::size_t d = 0; d < 3; ++d) size_ = std::max(size_, std::abs(p[d] - centre_[d]));
  }
  [[nodiscard]] Point direction(Index node, int d) const {
    const auto own = deck_.axes.find(node);
    return own == deck_.axes.end() ? kGlobal[at(d)] : own->second[at(d)];
  }
  [[nodiscard]] Point line(Index a, Index b) const {
    Point way{};
    for (std::size_t d = 0; d < 3; ++d) way[d] = deck_.mesh.nodes[at(b)][d] - deck_.mesh.nodes[at(a)][d];
    return way;
  }
  /// Nodes of no piece do not move.
  void add(const std::vector<Term>& terms) {
    Row row(6 * at(count_), 0);
    for (const Term& t : terms) {
      if (piece(t.node) < 0) continue;
      const Point& x = deck_.mesh.nodes[at(t.node)];
      Point r{};
      for (std::size_t d = 0; d < 3; ++d) r[d] = (x[d] - centre_[d]) / size_;
      double* own = row.data() + 6 * at(piece(t.node));
      for (std::size_t d = 0; d < 3; ++d) {
        const std::size_t e = (d + 1) % 3, f = (d + 2) % 3;
        own[d] += t.factor * t.along[d];
        own[3 + d] += t.factor * (r[e] * t.along[f] - r[f] * t.along[e]);
      }
    }
    space_.add(std::move(row));
  }
  void between(Index a, Index b, const Point& along) {
    std::vector<Term> terms = {{a, along, 1}};
    if (b >= 0) terms.push_back({b, along, -1});
    add(terms);
  }
  void turn(Index node, int d) {
    if (piece(node) < 0 || (piece(node) < solids_ && thin_[at(node)] == 0)) return;
    Row row(6 * at(count_), 0);
    row[6 * at(piece(node)) + 3 + at(d)] = 1;
    space_.add(std::move(row));
  }
  void couplings() {
    for (const auto& c : deck_.couplings) {
      if (c.rigid) busy_.insert(c.nodes.begin(), c.nodes.end());
      constexpr std::size_t kEnough = 200;
      const std::size_t stride = c.nodes.size() / kEnough + 1;
      for (std::size_t k = 0; k < c.nodes.size(); k += stride)
        for (const Point& d : kGlobal) between(c.nodes[k], c.reference, d);
    }
  }
  /// Each node goes with the piece of the faces; of several such pieces with the nearest node's.
  void ties() {
    for (const auto& t : deck_.ties) {
      const std::vector<Index> targets = deck_.mesh.nodes_of_faces(t.faces);
      for (const Index n : t.nodes) {
        busy_.insert(n);
        if (piece(n) < 0 || targets.empty()) continue;
        const auto far = [&](Index m) {
          const Point way = line(n, m);
          return std::inner_product(way.begin(), way.end(), way.begin(), 0.0);
        };
        const Index near =
            *std::min_element(targets.begin(), targets.end(), [&](Index a, Index b) { return far(a) < far(b); });
        if (piece(near) < 0) continue;
        for (const Point& d : kGlobal) same_motion(n, piece(near), d);
      }
    }
  }
  /// Couples the motion of a node with another piece, at the node's place.
  void same_motion(Index node, int other, const Point& along) {
    const int own = piece(node);
    Row row(6 * at(count_), 0);
    const Point& x = deck_.mesh.nodes[at(node)];
    Point r{};
    for (std::size_t d = 0; d < 3; ++d) r[d] = (x[d] - centre_[d]) / size_;
    for (const auto& [piece, sign] : {std::pair(own, 1.0), std::pair(other, -1.0)})
      for (std::size_t d = 0; d < 3; ++d) {
        const std::size_t e = (d + 1) % 3, f = (d + 2) % 3;
        row[6 * at(piece) + d] += sign * along[d];
        row[6 * at(piece) + 3 + d] += sign * (r[e] * along[f] - r[f] * along[e]);
      }
    space_.add(std::move(row));
  }

  const Deck& deck_;
  const DeckChoice& choice_;
  std::vector<Index> root_;
  std::vector<int> piece_;  // of each node; -1: none
  std::vector<char> thin_;  // nodes of shells and lines
  bool has_solids_ = false;
  int solids_ = 0, count_ = 0;
  Point centre_{};
  double size_ = 1e-300;
  RowSpace space_;
  std::set<Index> busy_;  // nodes that something leads
};

}  // namespace

FreePieces free_pieces(const Deck& deck, const DeckChoice& choice) {
  Pieces pieces(deck, choice);
  FreePieces out;
  out.pieces = pieces.solids();
  constexpr int kMost = 30;
  if (pieces.count() > kMost) return out;
  pieces.add_rows();
  std::vector<char> held;
  for (int p = 0; p < pieces.solids(); ++p) held.push_back(pieces.is_held(p) ? 1 : 0);
  out.any_held = std::find(held.begin(), held.end(), 1) != held.end();
  for (int p = 0; p < pieces.solids() && out.any_held; ++p) {
    if (pieces.is_held(p)) continue;
    std::array<Index, 3> corners{};
    if (!pieces.hold(p, corners)) return {false, out.pieces, {}};
    out.corners.push_back(corners);
  }
  return out;
}

}  // namespace espalier::dynamics::model
