/// \file
/// What a deck (Abaqus, CalculiX, Nastran) states beside its mesh: supports, loads, springs, couplings and a step,
/// whatever program it was written for.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "base/named.hpp"
#include "dynamics/mesh/line_sections.hpp"
#include "dynamics/mesh/mesh.hpp"
#include "dynamics/mesh/shell_sections.hpp"

namespace espalier::dynamics {

/// What can be taken from a deck, by the words of `take`.
enum class DeckKind : std::uint8_t {
  boundary,    ///< displacements that are held or led
  cload,       ///< forces and moments at nodes
  dload,       ///< pressures on faces, forces on volumes
  gravity,     ///< accelerations of gravity
  springs,     ///< to the ground and between nodes
  dashpots,    ///< likewise
  masses,      ///< of nodes
  couplings,   ///< rigid bodies, kinematic and distributing couplings
  equations,   ///< linear equations of displacements
  ties,        ///< surfaces that are welded
  connectors,  ///< joints between nodes
  step,        ///< statics, modes, or a motion
  others       ///< what cannot be taken
};
/// Without `others`.
inline constexpr base::Named<DeckKind> kDeckWords[] = {
    {"boundary", DeckKind::boundary}, {"cload", DeckKind::cload},           {"dload", DeckKind::dload},
    {"gravity", DeckKind::gravity},   {"springs", DeckKind::springs},       {"dashpots", DeckKind::dashpots},
    {"masses", DeckKind::masses},     {"couplings", DeckKind::couplings},   {"equations", DeckKind::equations},
    {"ties", DeckKind::ties},         {"connectors", DeckKind::connectors}, {"step", DeckKind::step}};

struct DeckPlace {
  std::string file;
  std::int64_t line = 0;
};
/// @throws Error(invalid_input) "file:line: message"
[[noreturn]] void fail(const DeckPlace& place, const std::string& message);

/// Nodes, elements and directions are indices of Deck::mesh, from 0; directions 3 to 5 are rotations about x, y, z.
/// `curve` is a factor over time, -1: none. Directions are those of the node's own axes, where it has some.
struct DeckHold {
  DeckPlace place;
  Index node = 0;
  int direction = 0;
  double value = 0;
  int curve = -1;
};
struct DeckForce {
  DeckPlace place;
  Index node = 0;
  int direction = 0;
  double value = 0;
  int curve = -1;
  int step = 0;  ///< that states it
};
struct DeckPressure {
  DeckPlace place;
  MeshFace face;     ///< of shells kShellTop, where the element's normal points to, or kShellBottom
  double value = 0;  ///< positive towards the face
  int curve = -1;
  int step = 0;  ///< that states it
};
inline constexpr int kShellTop = 0, kShellBottom = 1;
/// Force per length on a beam or bar, or on an edge of a shell.
struct DeckLineLoad {
  DeckPlace place;
  Index element = 0;
  int edge = -1;  ///< of shells: from corner `edge` to the next one
  Point force{};  ///< global axes
  int curve = -1;
  int step = 0;  ///< that states it
};
/// Acts on all elements and masses, or on those of a set; see BodyLoadLaw.
struct DeckBodyLoad {
  DeckPlace place;
  std::string label;              ///< GRAV, CENTRIF ...
  std::vector<Index> elements{};  ///< of the set
  Point acceleration{}, per_volume{}, spin{}, point{};
  int curve = -1;
  int step = 0;                      ///< that states it
  std::string set{};                 ///< as the card says it, in upper case; empty: all
  std::vector<std::string> homes{};  ///< where the set is looked for
};
/// A spring and a dashpot between two nodes, along the line between them or along one direction.
struct DeckSpring {
  DeckPlace place;
  Index a = 0, b = -1;  ///< b: -1: the ground
  int direction = -1;   ///< -1: along the line
  double stiffness = 0, damping = 0;
};
struct DeckMass {
  DeckPlace place;
  Index node = 0;
  double mass = 0;
  Point offset{};
  std::array<double, 6> inertia{};   ///< xx, yy, zz, xy, xz, yz about the mass itself
  std::vector<std::size_t> loads{};  ///< of Deck::body_loads that act on it
};
/// The sum of factor * displacement is `value`.
struct DeckEquation {
  struct Term {
    Index node = 0;
    int direction = 0;
    double factor = 0;
  };
  DeckPlace place;
  std::vector<Term> terms;
  double value = 0;
};
/// Nodes that go with a reference node: as one rigid piece, or in the mean: u = sum w_k u_k / sum w_k, and the rotation
/// whose motion of the nodes about that has the least sum of w_k |difference|^2 (MSC Nastran, Quick Reference Guide,
/// RBE3; CalculiX 2.20, ccx_2.20.pdf, *DISTRIBUTING).
struct DeckCoupling {
  DeckPlace place;
  Index reference = 0;
  std::vector<Index> nodes;
  bool rigid = true;
  std::vector<MeshFace> faces{};  ///< of couplings in the mean: nodes count by the areas of these; empty: all alike
  std::vector<double> weights{};  ///< of couplings in the mean: of each node, instead of faces; empty: all alike
  bool turns = true;              ///< else the displacement of the reference alone follows, wherever it lies
  std::string notice{};           ///< what is to be known of it
};
/// Sets nodes and weights.
void weigh(const std::map<Index, double>& weights, DeckCoupling& coupling);
/// Nodes that stay where they are on faces.
struct DeckTie {
  DeckPlace place;
  std::vector<Index> nodes;
  std::vector<MeshFace> faces;
  double tolerance = 0;  ///< of the distance; 0: a tenth of the faces' size
};
/// A joint between two nodes, with springs and dashpots along and about axes 1, 2, 3 of a.
struct DeckConnector {
  DeckPlace place;
  std::string type;         ///< as the deck calls it
  std::string joint, free;  ///< type of the joint, empty: none; free components of relative motion, of "123456"
  Index a = -1, b = -1;     ///< -1: the ground
  std::array<Point, 3> axes_a{}, axes_b{};
  std::array<double, 6> stiffness{}, damping{};
};
struct DeckStep {
  enum class Kind : std::uint8_t { none, statics, modes, motion };
  DeckPlace place;
  Kind kind = Kind::none;
  bool large = false;  ///< displacements are not small
  bool fixed = false;  ///< steps of the motion all have the length `increment`
  int modes = 0;
  double period = 1, increment = 0, alpha = -0.05;
  double longest = 0;  ///< increment of a motion; 0: any
};
/// What a deck states and nobody takes.
struct DeckLeft {
  DeckPlace place;  ///< of the first
  long count = 0;
};

struct Deck {
  Mesh mesh;
  std::vector<DeckHold> holds;
  std::vector<DeckForce> forces;
  std::vector<DeckPressure> pressures;
  std::vector<DeckLineLoad> line_loads;
  std::vector<DeckBodyLoad> body_loads;
  std::vector<DeckSpring> springs, dashpots;
  std::vector<DeckMass> masses;
  std::vector<DeckCoupling> couplings;
  std::vector<DeckEquation> equations;
  std::vector<DeckTie> ties;
  std::vector<DeckConnector> connectors;
  std::vector<std::vector<std::pair<double, double>>> curves;  ///< points (time, factor)
  std::map<Index, std::array<Point, 3>> axes;                  ///< of nodes that have their own
  std::vector<ShellSection> shell_sections;
  LineSections line_sections;
  DeckStep step;
  int steps = 0;                 ///< that the deck has
  std::string hex8;              ///< formulation of 8-node hexahedra that the deck names; empty: none or several
  bool reduced_hex20 = false;    ///< all 20-node hexahedra are integrated at 8 points
  std::string other_elements{};  ///< types, in a list, whose formulation is none of these; or empty
  std::map<std::pair<DeckKind, std::string>, DeckLeft> left;  ///< by what it is called
  std::vector<std::string> notices{};                         ///< what else is to be known of a run
};

/// Reads a deck. @param step  the one to be taken, from 1, with what those before it leave; 0: the first
/// @throws Error(invalid_input) "file:line: what, and what to do"; for files that are no decks
Deck read_deck(const std::string& path, int step = 0);
/// The deck of .inp and Nastran files; `name` stands for the file in messages.
Deck parse_inp_deck(std::string content, const std::string& name, int step = 0);
Deck parse_nastran_deck(std::string content, const std::string& name, int step = 0);

}  // namespace espalier::dynamics
