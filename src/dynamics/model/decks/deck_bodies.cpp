#include "dynamics/model/decks/deck_bodies.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <set>

#include "base/at.hpp"
#include "dynamics/mesh/deck/point_algebra.hpp"
#include "dynamics/mesh/names.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics::model {
namespace {

/// The section of each element, -1: none. @throws Error where two that differ have the same element
template <class Section>
std::vector<int> sections_of_elements(const Mesh& mesh, const std::vector<Section>& sections, int dimension) {
  std::vector<int> of(at(mesh.element_count()), -1);
  for (std::size_t k = 0; k < sections.size(); ++k) {
    const auto found = find_named(mesh.element_sets, sections[k].set);
    if (found == mesh.element_sets.end()) continue;
    for (const Index e : found->second) {
      if (shape_of(mesh.type(e)).dimension != dimension) continue;
      int& known = of[at(e)];
      if (known >= 0 && sections[at(known)].place != sections[k].place)
        throw Error(StatusCode::invalid_input,
                    fmt::format("{}: element {} has this section, and that of {}: leave it out of one of the sets",
                                sections[k].place, element_name(mesh, e), sections[at(known)].place));
      known = static_cast<int>(k);
    }
  }
  return of;
}

class ShellWalls {
 public:
  ShellWalls(const Mesh& mesh, const std::vector<Index>& shells, std::vector<std::size_t> kinds)
      : mesh_(mesh), shells_(shells), kinds_(std::move(kinds)), turned_(shells.size(), 0) {
    for (std::size_t k = 0; k < shells.size(); ++k) {
      const auto nodes = mesh.element(shells[k]);
      const auto corners = static_cast<std::size_t>(shape_of(mesh.type(shells[k])).corners);
      for (std::size_t a = 0; a < corners; ++a) {
        const Index from = nodes[a], to = nodes[(a + 1) % corners];
        sides_[std::minmax(from, to)].push_back({k, from < to});
      }
      normals_.push_back(normal_of(nodes, corners));
    }
    for (const auto& [edge, sides] : sides_) link(sides);
  }

  /// Elements of one wall after the other, each in its order.
  std::vector<std::vector<std::size_t>> walls() {
    std::vector<std::vector<std::size_t>> out;
    std::vector<char> known(shells_.size(), 0);
    for (std::size_t first = 0; first < shells_.size(); ++first) {
      if (known[first] != 0) continue;
      known[first] = 1;
      std::vector<std::size_t> wall;
      std::deque<std::size_t> next = {first};
      while (!next.empty()) {
        const std::size_t k = next.front();
        next.pop_front();
        wall.push_back(k);
        for (const auto& [other, same] : links_[k]) {
          if (known[other] != 0) continue;
          known[other] = 1;
          turned_[other] = turned_[k] != static_cast<char>(same ? 1 : 0) ? 1 : 0;
          next.push_back(other);
        }
      }
      std::sort(wall.begin(), wall.end());
      out.push_back(std::move(wall));
    }
    return out;
  }
  [[nodiscard]] const std::vector<char>& turned() const { return turned_; }

 private:
  struct Side {
    std::size_t element;
    bool rising;
  };

  [[nodiscard]] Point normal_of(std::span<const Index> nodes, std::size_t corners) const {
    const auto x = [&](std::size_t a) { return mesh_.nodes[at(nodes[a])]; };
    return direction_of(cross_product(difference_of(x(2), x(0)), difference_of(x(corners - 1), x(1))));
  }

  /// Walls go on over an edge of two elements of one kind, and from three on over that of the two that go on best.
  void link(const std::vector<Side>& sides) {
    constexpr double kSharpest = -0.6, kStraight = 0.8;  // cosines between normals: 127 and 37 degrees
    double best = sides.size() == 2 ? kSharpest : kStraight;
    const Side* pair[2] = {nullptr, nullptr};
    for (std::size_t i = 0; i < sides.size(); ++i)
      for (std::size_t j = i + 1; j < sides.size(); ++j) {
        if (kinds_[sides[i].element] != kinds_[sides[j].element]) continue;
        const double cosine = (sides[i].rising == sides[j].rising ? -1 : 1) *
                              dot_product(normals_[sides[i].element], normals_[sides[j].element]);
        if (cosine <= best) continue;
        best = cosine;
        pair[0] = &sides[i];
        pair[1] = &sides[j];
      }
    if (pair[0] == nullptr) return;
    const bool same = pair[0]->rising == pair[1]->rising;  // then one of them is turned
    links_[pair[0]->element].emplace_back(pair[1]->element, same);
    links_[pair[1]->element].emplace_back(pair[0]->element, same);
  }

  const Mesh& mesh_;
  const std::vector<Index>& shells_;
  std::vector<std::size_t> kinds_;
  std::vector<char> turned_;
  std::vector<Point> normals_;
  std::map<std::pair<Index, Index>, std::vector<Side>> sides_;
  std::map<std::size_t, std::vector<std::pair<std::size_t, bool>>> links_;
};

class Maker {
 public:
  Maker(const Deck& deck, bool all, std::string name) : deck_(deck), mesh_(deck.mesh), name_(std::move(name)) {
    const auto count = at(mesh_.element_count());
    out_.of_element.assign(count, -1);
    out_.turned.assign(count, 0);
    out_.home.assign(mesh_.nodes.size(), -1);
    std::vector<Index> solids;
    for (Index e = 0; e < mesh_.element_count(); ++e)
      if (dimension(e) == 3) solids.push_back(e);
    add("solid", "solids", std::move(solids));
    if (!all && !out_.list.empty()) return;
    const std::vector<int> shells = sections_of_elements(mesh_, deck.shell_sections, 2),
                           lines = sections_of_elements(mesh_, deck.line_sections.list, 1);
    const auto check = [&](Index e, const std::vector<int>& sections) {
      if (sections[at(e)] >= 0) return;
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}: element {} (a {}) has no section: it is in no set that one is given for", mesh_.name,
                              element_name(mesh_, e), shape_of(mesh_.type(e)).name));
    };
    std::vector<Index> walls, beams, bars;
    for (Index e = 0; e < mesh_.element_count(); ++e) {
      if (dimension(e) == 2) {
        check(e, shells);
        walls.push_back(e);
      }
      if (dimension(e) != 1) continue;
      check(e, lines);
      const LineSection& section = deck.line_sections.list[at(lines[at(e)])];
      (section.shape == LineShape::bar ? bars : beams).push_back(e);
    }
    add_shells(walls, shells);
    add("beam", "beams", std::move(beams));
    add("cable", "bars", std::move(bars));
  }

  DeckBodies run() {
    // What turns stands for its nodes, so that moments and rotations find them.
    const std::vector<std::string> order = {"beam", "shell", "cable", "solid"};
    const auto rank = [&](int body) {
      return std::find(order.begin(), order.end(), out_.list[at(body)].type) - order.begin();
    };
    std::map<Index, std::set<int>> several;
    for (std::size_t b = 0; b < out_.list.size(); ++b)
      for (const Index e : out_.list[b].elements)
        for (const Index n : mesh_.element(e)) {
          int& home = out_.home[at(n)];
          const int own = static_cast<int>(b);
          if (home == own) continue;
          if (home < 0) {
            home = own;
            continue;
          }
          several[n].insert({home, own});
          if (rank(own) < rank(home)) home = own;
        }
    for (const auto& [node, bodies] : several)
      for (const int b : bodies)
        if (const int home = out_.home[at(node)]; b != home) out_.shared[{b, home}].push_back(node);
    return std::move(out_);
  }

 private:
  [[nodiscard]] int dimension(Index e) const { return shape_of(mesh_.type(e)).dimension; }

  void add(const char* type, const char* plural, std::vector<Index> elements) {
    if (elements.empty()) return;
    const int number = ++numbers_[type];
    std::string name = out_.list.empty() ? name_ : fmt::format("{}_{}", name_, plural);
    if (!out_.list.empty() && number > 1) name += fmt::format("_{}", number);
    for (const Index e : elements) out_.of_element[at(e)] = static_cast<int>(out_.list.size());
    out_.list.push_back({std::move(name), type, std::move(elements)});
  }

  /// Walls that share no node are one body, where they are of one kind.
  void add_shells(const std::vector<Index>& shells, const std::vector<int>& sections) {
    std::map<std::string, std::size_t> kinds;
    std::vector<std::size_t> kind;
    for (const Index e : shells) {
      const ShellSection& s = deck_.shell_sections[at(sections[at(e)])];
      if (!s.fault.empty()) throw Error(StatusCode::invalid_input, s.fault);
      kind.push_back(kinds.emplace(kind_of(s), kinds.size()).first->second);
    }
    ShellWalls walls(mesh_, shells, kind);
    struct Group {
      std::size_t kind;
      std::set<Index> nodes;
      std::vector<Index> elements;
    };
    std::vector<Group> groups;
    for (const std::vector<std::size_t>& wall : walls.walls()) {
      std::set<Index> nodes;
      for (const std::size_t k : wall)
        for (const Index n : mesh_.element(shells[k])) nodes.insert(n);
      const auto fits = [&](const Group& g) {
        return g.kind == kind[wall.front()] &&
               std::none_of(nodes.begin(), nodes.end(), [&](Index n) { return g.nodes.contains(n); });
      };
      auto group = std::find_if(groups.begin(), groups.end(), fits);
      if (group == groups.end()) group = groups.insert(groups.end(), Group{kind[wall.front()], {}, {}});
      group->nodes.merge(nodes);
      for (const std::size_t k : wall) group->elements.push_back(shells[k]);
    }
    for (Group& group : groups) {
      std::sort(group.elements.begin(), group.elements.end());
      add("shell", "shells", std::move(group.elements));
    }
    for (std::size_t k = 0; k < shells.size(); ++k) out_.turned[at(shells[k])] = walls.turned()[k];
  }

  /// What one body of ours has alike.
  static std::string kind_of(const ShellSection& s) {
    std::string kind =
        fmt::format("{} {} {}", lower(s.material), s.offset, s.nodal ? "nodal" : fmt::format("{}", s.thickness));
    for (const ShellLayer& layer : s.layers) kind += fmt::format(" {} {}", layer.thickness, lower(layer.material));
    return kind;
  }

  const Deck& deck_;
  const Mesh& mesh_;
  std::string name_;
  std::map<std::string, int> numbers_;
  DeckBodies out_;
};

}  // namespace

DeckBodies make_deck_bodies(const Deck& deck, bool all, const std::string& name) {
  return Maker(deck, all, name).run();
}

}  // namespace espalier::dynamics::model
