/// \file
/// What an .inp file states, before labels are resolved: parts, instances and their sets.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "dynamics/mesh/deck/inp_cards.hpp"
#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

/// Lines that messages name: those of a file, plus this times its place in InpModel::files.
constexpr std::int64_t kLinesOfFile = std::int64_t{1} << 40;

struct InpNode {
  std::int64_t label;
  Point at;
};

struct InpElement {
  ElementType type;
  std::int64_t label;
  std::array<std::int64_t, kMaxElementNodes> nodes;
  std::int64_t line;
};

/// One entry of a set: labels or the name of another set, perhaps of an instance.
struct InpMember {
  std::string instance;  ///< upper case, or empty
  std::string name;      ///< upper case name of a set, or empty
  /// The labels first, first + step ... up to last: more than one of GENERATE. @pre first <= last, step > 0
  std::int64_t first = 0, last = 0, step = 1;
  int face = -1;             ///< of surfaces: 0-based face of the element; -1: those that are on the outside
  int side = -1;             ///< likewise kShellTop (SPOS) or kShellBottom (SNEG) of shells; -1: of none
  bool of_surface = false;   ///< `name` is a surface of nodes, where there is one
  bool of_elements = false;  ///< of sets of nodes: `name` is a set of elements, whose nodes are meant
  std::int64_t line = 0;
};

struct InpSet {
  std::string spelling;  ///< as first written
  std::vector<InpMember> entries;
};
using InpSets = std::map<std::string, InpSet>;  // by upper-case name

/// Content of the file outside of parts, of a part, or of an instance.
struct InpScope {
  std::string name;  ///< upper case
  std::vector<InpNode> nodes;
  std::vector<InpElement> elements;
  InpSets node_sets, element_sets, surfaces, node_surfaces;
  std::map<std::string, std::string> section_material;  ///< upper-case element set -> material as written
  std::set<std::int64_t> passed_over;                   ///< labels of elements that are no solids, shells, beams
};

/// An instance is its part's content plus its own, moved: first translated, then turned about an axis.
struct InpInstance {
  InpScope own;
  std::string part;  ///< upper case
  Point translation{};
  bool turned = false;
  Point axis_from{}, axis_to{};
  double degrees = 0;
  std::int64_t line = 0;
};

struct InpModel {
  std::string path;
  std::string assembly;            ///< its name in upper case, which names of its sets may have in front
  std::vector<std::string> files;  ///< the file itself and those that it includes
  InpScope root;
  std::vector<InpScope> parts;
  std::vector<InpInstance> instances;
  std::vector<MeshMaterial> materials;
  /// How many: elements by their types, keywords by their names, and solids that are read from continuum shells.
  std::map<std::string, long> passed_elements, passed_keywords, solid_shells;
  std::vector<std::string> notices{};         ///< of materials
  std::map<std::string, long> long_elements;  ///< with more nodes than their types have, by these
  /// What was left of a deck: keywords that nobody reads into a mesh, elements that are passed over, and the types of
  /// the others.
  bool is_deck = false;
  std::vector<InpCard> cards;
  int steps = 0;
  std::map<std::string, DeckPlace> read_types;  ///< where the first of each stands
  std::set<std::string> thin_materials;         ///< upper-case names: of sections of shells and beams
};

/// Reads the text of the file `path`, and the files that it includes. @param deck  keep its cards
InpModel parse_inp_text(std::string content, const std::string& path, bool deck = false);
/// "12", "SET-1", "PART-1-1.12", "PART-1-1.SET-1". @param instance  that of names without one
InpMember inp_member(std::string_view field, const std::string& instance, std::int64_t line);

/// What names of a deck's cards mean, when the mesh stands. A home is the name space of an instance, or "".
class InpLookup {
 public:
  virtual ~InpLookup() = default;
  /// The homes that a card of this part or instance speaks for.
  [[nodiscard]] virtual std::vector<std::string> homes(const std::string& scope) const = 0;
  [[nodiscard]] virtual std::vector<Index> nodes(const InpMember& member, const std::string& home) const = 0;
  [[nodiscard]] virtual std::vector<Index> elements(const InpMember& member, const std::string& home) const = 0;
  /// @return false where there is no surface of elements of this name
  [[nodiscard]] virtual bool faces(const InpMember& member, const std::string& home,
                                   std::vector<MeshFace>& out) const = 0;
  /// Whether a label is in a set of elements, those that are passed over too.
  [[nodiscard]] virtual bool in_element_set(std::int64_t label, const std::string& set,
                                            const std::string& home) const = 0;
  [[nodiscard]] virtual const Mesh& mesh() const = 0;
};

/// Numbers nodes and elements and resolves sets. @param use  called when the mesh stands; perhaps none
/// @throws Error naming the line of a reference that leads nowhere
Mesh flatten_inp(const InpModel& model, const std::function<void(const InpLookup&)>& use = {});

}  // namespace espalier::dynamics
