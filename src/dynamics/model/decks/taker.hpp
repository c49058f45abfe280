/// \file
/// Makes entries of a model of what a deck states.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <set>

#include "dynamics/mesh/names.hpp"
#include "dynamics/model/decks/deck_bodies.hpp"
#include "dynamics/model/decks/taken.hpp"
#include "dynamics/model/decks/values.hpp"

namespace espalier::dynamics::model {

/// What a node of the deck is in the model.
/// A mean place has no rotation.
enum class NodeRole { element, rigid_reference, mean_reference, mean_place, mass, alone };

class Taker {
 public:
  Taker(const Deck& deck, const DeckChoice& choice, const std::string& body)
      : deck_(deck),
        choice_(choice),
        body_(body),
        maker_({deck.mesh.name, 0}, fmt::format("bodies.{}.mesh.take", body)) {}
  TakenDeck run();

 private:
  void refuse_left() const;
  void notices();
  void find_roles();
  void find_roles_of(const DeckCoupling& c, int number);
  [[nodiscard]] std::string name(Index node) const { return node_name(deck_.mesh, node); }
  [[nodiscard]] const Point& at(Index node) const { return deck_.mesh.nodes[static_cast<std::size_t>(node)]; }
  [[nodiscard]] bool is_reference(Index node) const {
    return role(node) == NodeRole::rigid_reference || role(node) == NodeRole::mean_reference;
  }
  /// The body that stands for a node of elements.
  [[nodiscard]] const DeckBody& home(Index node) const {
    return bodies_.list[static_cast<std::size_t>(bodies_.home[static_cast<std::size_t>(node)])];
  }
  [[nodiscard]] bool turns(Index node) const {
    return is_reference(node) || (role(node) == NodeRole::element && is_thin(home(node)));
  }
  /// Nodes of beams and shells turn.
  [[nodiscard]] static bool is_thin(const DeckBody& body) { return body.type == "beam" || body.type == "shell"; }
  /// The body that has all these nodes. @throws Error where there is none
  [[nodiscard]] const DeckBody& body_with(const std::vector<Index>& nodes, const DeckPlace& place) const;
  void join_bodies();
  void list_bodies();
  [[nodiscard]] NodeRole role(Index node) const { return roles_[static_cast<std::size_t>(node)]; }
  [[nodiscard]] ValueMaker maker(const DeckPlace& place, const std::string& section, const std::string& entry) const;
  std::string fresh_name(const char* what) { return fmt::format("{}_{}_{}", body_, what, ++numbers_[what]); }
  void add(const char* section, const std::string& entry, Value value);
  /// A set of the mesh for these nodes.
  std::string node_set(std::string set, const std::vector<Index>& nodes);
  /// Adds to the table of a frame which node it is: by its label, where no two have the same.
  void name_node(const ValueMaker& m, Index node, Value& table);
  [[nodiscard]] std::string coupling_name(Index reference) const;
  /// Where a spring or force holds on.
  Value frame(const ValueMaker& m, Index node);
  [[noreturn]] void refuse_alone(const ValueMaker& m, Index node) const;
  /// What is held of a node, in directions 0 to 5.
  struct Held {
    std::array<const DeckHold*, 6> by{};
    [[nodiscard]] bool any(std::size_t from, std::size_t to) const {
      return std::any_of(by.begin() + static_cast<std::ptrdiff_t>(from), by.begin() + static_cast<std::ptrdiff_t>(to),
                         [](const DeckHold* h) { return h != nullptr; });
    }
    [[nodiscard]] bool moved() const {
      return std::any_of(by.begin(), by.end(), [](const DeckHold* h) { return h != nullptr && h->value != 0; });
    }
  };
  void holds();
  void add_support(const std::array<double, 4>& quaternion, const std::vector<Index>& nodes, const Held& held);
  /// As an expression of time.
  std::string motion_of(const DeckHold& h);
  /// The value of a curve, when the step ends.
  [[nodiscard]] double at_end(int curve) const;
  std::string spline(int curve);
  /// What a coupling joins, by a joint to the ground.
  void hold_reference(Index node, const Held& held, const DeckPlace& place);
  /// The place of the node, or of the mean that it stands for.
  [[nodiscard]] Point place_of(Index node) const;
  void add_prescribed(Index node, const DeckHold& h, std::size_t d);
  void masses();
  /// A mass, or a mean place, by displacements.
  void hold_place(Index node, const Held& held);
  /// Force and moment of one node under one curve, in global axes.
  struct Load {
    Point force{}, moment{};
    DeckPlace place;
  };
  void forces();
  void add_load(const Load& load, int curve, Index node);
  void add_force(const ValueMaker& m, const std::string& entry, Value a, const Point& force, const Point& moment,
                 int curve);
  void pressures();
  void line_loads();
  /// Whether a load on volumes is taken, and acts in the step.
  [[nodiscard]] bool acts(const DeckBodyLoad& load) const;
  /// The factor of its curve, where the step ends; 1 in motions.
  [[nodiscard]] double factor_of(const DeckBodyLoad& load) const;
  void body_loads();
  void body_loads_of(const DeckBody& body);
  void add_body_load(const DeckBodyLoad& load, const DeckBody& body);
  /// Weight and centrifugal force of a mass at `place` that is called `entry`.
  void load_mass(const DeckMass& mass, const std::string& entry, const Point& place, Value& body);
  void springs(const std::vector<DeckSpring>& list, const char* what);
  [[nodiscard]] bool is_ground(Index node) const { return role(node) == NodeRole::alone && grounded_.contains(node); }
  /// The frame of the coupling's nodes, carried to a point.
  Value coupling_frame(const ValueMaker& m, const DeckCoupling& c, const Point& point);
  void spring_between(const DeckSpring& s, const std::string& entry);
  Value terms(const ValueMaker& m, const std::vector<DeckEquation::Term>& list);
  void equations();
  void ties();
  void couplings();
  /// A frame of a connector at a point, with z and x along two of its axes where the node turns.
  Value connector_end(const ValueMaker& m, Index node, const Point& point, const std::array<Point, 3>& axes,
                      std::size_t z, std::size_t x);
  void connectors();
  /// @param end  of the connector: a or b, and which of its axes z and x are
  void connector_springs(const DeckConnector& c, const std::string& entry,
                         const std::function<Value(const ValueMaker&, bool, std::size_t, std::size_t)>& end);
  void step();
  void formulations();
  const Deck& deck_;
  const DeckChoice& choice_;
  std::string body_;
  ValueMaker maker_;
  TakenDeck out_;
  DeckBodies bodies_;
  std::map<std::string, std::vector<std::pair<std::string, Value>>> body_keys_;  // by the name of the body
  std::vector<NodeRole> roles_;
  std::map<Index, int> references_, rigid_nodes_;  // -> number of the coupling
  std::map<Index, std::string> mass_bodies_;
  std::set<Index> grounded_;  // nodes of no body that are held in all directions
  std::map<std::string, int> numbers_;
  std::set<std::string> splines_;
  std::vector<std::string> outputs_;
  long turned_ = 0;
  bool unique_labels_ = true;
};

}  // namespace espalier::dynamics::model
