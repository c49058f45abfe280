// Multi-point constraints of an .inp deck, as linear equations.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dynamics/mesh/deck/inp_deck.hpp"
#include "dynamics/mesh/deck/point_algebra.hpp"
#include "dynamics/mesh/names.hpp"

namespace espalier::dynamics {
namespace {

int largest_component(const Point& a) {
  int best = 0;
  for (int d = 1; d < 3; ++d)
    if (std::abs(a[static_cast<std::size_t>(d)]) > std::abs(a[static_cast<std::size_t>(best)])) best = d;
  return best;
}

/// One constraint: its type and nodes.
class InpMpc {
 public:
  InpMpc(const InpTarget& target, const DeckPlace& place, std::string type)
      : target_(target), place_(place), type_(std::move(type)) {}

  void add(std::vector<Index> nodes) { lists_.push_back(std::move(nodes)); }

  void finish() {
    if (type_ == "TIE" || type_ == "PIN") return tie();
    if (type_ == "LINK") type_ = "BEAM";  // as Abaqus calls it between nodes that do not turn
    const bool known = type_ == "BEAM" || type_ == "PLANE" || type_ == "STRAIGHT";
    if (!known) return target_.leave(DeckKind::equations, fmt::format("*MPC {}", type_), place_);
    if (const DeckStep& step = target_.deck().step; step.large || step.kind == DeckStep::Kind::motion)
      return target_.leave(DeckKind::equations, fmt::format("*MPC {} in a step with large displacements", type_),
                           place_);
    for (const std::vector<Index>& list : lists_) nodes_.insert(nodes_.end(), list.begin(), list.end());
    const std::size_t least = type_ == "BEAM" ? 2 : type_ == "STRAIGHT" ? 3 : 4;
    if (nodes_.size() < least || (type_ == "BEAM" && nodes_.size() > least))
      fail(place_, fmt::format("*MPC {} has {} nodes; it needs {}{}", type_, nodes_.size(), least,
                               type_ == "BEAM" ? "" : " or more"));
    if (type_ == "BEAM")
      beam();
    else if (type_ == "PLANE")
      plane();
    else
      straight();
  }

 private:
  [[nodiscard]] const Point& at(std::size_t k) const {
    return target_.lookup().mesh().nodes[static_cast<std::size_t>(nodes_[k])];
  }

  void tie() {
    if (lists_.size() != 2) fail(place_, fmt::format("*MPC {} needs two nodes, or two sets", type_));
    const std::vector<Index>&a = lists_[0], &b = lists_[1];
    if (b.size() != 1 && b.size() != a.size())
      fail(place_,
           fmt::format("*MPC {}: the sets have {} and {} nodes; as many are needed", type_, a.size(), b.size()));
    for (std::size_t k = 0; k < a.size(); ++k)
      for (int d = 0; d < 3; ++d)
        target_.deck().equations.push_back({place_, {{a[k], d, 1}, {b.size() == 1 ? b[0] : b[k], d, -1}}, 0});
  }

  /// factors[k] . u of the k-th node add up to zero; the last node follows, along its largest factor.
  void add_equation(const std::vector<std::pair<Index, Point>>& factors) {
    DeckEquation out{place_, {}, 0};
    const int first = largest_component(factors.back().second);
    for (int d = 0; d < 3; ++d)
      if (const int way = (first + d) % 3; factors.back().second[static_cast<std::size_t>(way)] != 0)
        out.terms.push_back({factors.back().first, way, factors.back().second[static_cast<std::size_t>(way)]});
    for (std::size_t k = 0; k + 1 < factors.size(); ++k)
      for (int d = 0; d < 3; ++d)
        if (const double f = factors[k].second[static_cast<std::size_t>(d)]; f != 0)
          out.terms.push_back({factors[k].first, d, f});
    target_.deck().equations.push_back(std::move(out));
  }

  /// The distance of the nodes stays: (x_b - x_a) . (u_b - u_a) = 0.
  void beam() {
    const Point line = difference_of(at(1), at(0));
    if (line == Point{}) fail(place_, "*MPC BEAM: the nodes lie at the same place; *MPC TIE joins such nodes");
    add_equation({{nodes_[0], scaled_by(-1, line)}, {nodes_[1], line}});
  }

  /// Nodes stay in the plane of the first three: n . (u - sum b_k u_k) = 0, with x = sum b_k x_k.
  void plane() {
    const Point p = difference_of(at(1), at(0)), q = difference_of(at(2), at(0)), n = cross_product(p, q);
    const double square = dot_product(n, n), size = std::max(dot_product(p, p), dot_product(q, q));
    if (!(square > 1e-12 * size * size)) fail(place_, "*MPC PLANE: the first three nodes lie on a line");
    for (std::size_t k = 3; k < nodes_.size(); ++k) {
      const Point x = difference_of(at(k), at(0));
      check_distance(k, std::abs(dot_product(n, x)) / std::sqrt(square), std::sqrt(size));
      const double b1 = dot_product(cross_product(x, q), n) / square, b2 = dot_product(cross_product(p, x), n) / square;
      const Point unit = direction_of(n);
      add_equation({{nodes_[0], scaled_by(b1 + b2 - 1, unit)},
                    {nodes_[1], scaled_by(-b1, unit)},
                    {nodes_[2], scaled_by(-b2, unit)},
                    {nodes_[k], unit}});
    }
  }

  /// Nodes stay on the line through the first two: d x (u - (1 - s) u_1 - s u_2) = 0.
  void straight() {
    const Point line = difference_of(at(1), at(0));
    const double square = dot_product(line, line);
    if (!(square > 0)) fail(place_, "*MPC STRAIGHT: the first two nodes lie at the same place");
    const int along = largest_component(line);
    for (std::size_t k = 2; k < nodes_.size(); ++k) {
      const Point x = difference_of(at(k), at(0));
      const double s = dot_product(x, line) / square;
      check_distance(k,
                     std::sqrt(dot_product(difference_of(x, scaled_by(s, line)), difference_of(x, scaled_by(s, line)))),
                     std::sqrt(square));
      for (int d = 0; d < 3; ++d) {
        if (d == along) continue;
        Point f{};
        f[static_cast<std::size_t>(d)] = 1;
        f[static_cast<std::size_t>(along)] = -line[static_cast<std::size_t>(d)] / line[static_cast<std::size_t>(along)];
        add_equation({{nodes_[0], scaled_by(s - 1, f)}, {nodes_[1], scaled_by(-s, f)}, {nodes_[k], f}});
      }
    }
  }

  void check_distance(std::size_t k, double distance, double size) const {
    constexpr double kMost = 1e-4;
    if (distance > kMost * size)
      fail(place_, fmt::format("*MPC {}: node {} lies {:g} beside it from the start", type_,
                               node_name(target_.lookup().mesh(), nodes_[k]), distance));
  }

  const InpTarget& target_;
  DeckPlace place_;
  std::string type_;
  std::vector<std::vector<Index>> lists_;  // of each field
  std::vector<Index> nodes_;
};

bool is_label(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace

void read_inp_mpc(const InpCard& card, const InpTarget& target) {
  std::vector<InpMpc> all;
  for (std::size_t l = 0; l < card.lines.size(); ++l) {
    const CardFields f = card.fields(l);
    // A line that begins with a number goes on with the nodes of the line before.
    const bool fresh = !f.text(0).empty() && !is_label(f.text(0));
    if (fresh) all.emplace_back(target, f.place(), upper(f.text(0)));
    if (all.empty()) fail(f.place(), "*MPC: the type stands first");
    for (std::size_t k = fresh ? 1 : 0; k < f.size(); ++k)
      if (f.has(k) && f.text(k) != "0") all.back().add(target.nodes(card, f, k));
  }
  for (InpMpc& mpc : all) mpc.finish();
}

}  // namespace espalier::dynamics
