/// \file
/// What an .inp file states, before labels are resolved: parts, instances and their sets.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "dynamics/mesh/mesh.hpp"

namespace espalier::dynamics {

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
  int face = -1;  ///< of surfaces: 0-based face of the element
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
  InpSets node_sets, element_sets, surfaces;
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
  InpScope root;
  std::vector<InpScope> parts;
  std::vector<InpInstance> instances;
  std::vector<MeshMaterial> materials;
  /// How many: elements by their types, keywords by their names, and solids that are read from continuum shells.
  std::map<std::string, long> passed_elements, passed_keywords, solid_shells;
};

/// Reads the text of the file `path`, and the files that it includes.
InpModel parse_inp_text(std::string content, const std::string& path);
/// Numbers nodes and elements and resolves sets. @throws Error naming the line of a reference that leads nowhere
Mesh flatten_inp(const InpModel& model);

}  // namespace espalier::dynamics
