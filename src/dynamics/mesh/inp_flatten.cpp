#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <unordered_map>

#include "dynamics/mesh/inp_model.hpp"
#include "dynamics/mesh/names.hpp"
#include "dynamics/mesh/read.hpp"
#include "dynamics/mesh/read/inp_system.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {
namespace {

/// Labels of one instance (or part, or the file) and what they became.
struct Labels {
  std::unordered_map<std::int64_t, Index> nodes, elements;
  std::vector<const InpScope*> scopes;  // where sets of this name space are defined
};

/// First translated, then turned.
Point moved(const InpInstance& i, Point p) {
  for (std::size_t d = 0; d < 3; ++d) p[d] += i.translation[d];
  return i.turned ? turned_about(i.axis_from, i.axis_to, i.degrees, p) : p;
}

class Flattener final : public InpLookup {
 public:
  explicit Flattener(const InpModel& model) : model_(model) { mesh_.name = model.path; }

  Mesh run(const std::function<void(const InpLookup&)>& use) {
    check_instances();
    const auto keep = [](const Point& p) { return p; };
    if (model_.instances.empty())
      for (const InpScope& part : model_.parts) add_scope(part, space_[part.name], keep);
    for (const InpInstance& i : model_.instances) add_instance(i);
    if (model_.instances.empty()) merge_into_root();
    add_scope(model_.root, space_[""], keep);
    if (mesh_.nodes.empty())
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}: the file has no nodes that belong to the model", model_.path));
    add_sets();
    mesh_.materials = model_.materials;
    add_notices();
    if (use) use(*this);
    return std::move(mesh_);
  }

  [[nodiscard]] const Mesh& mesh() const override { return mesh_; }
  [[nodiscard]] std::vector<std::string> homes(const std::string& scope) const override {
    if (scope.empty() || model_.instances.empty()) return {""};
    std::vector<std::string> names;
    for (const InpInstance& i : model_.instances)
      if (i.part == scope || i.own.name == scope) names.push_back(i.own.name);
    return names;
  }
  [[nodiscard]] std::vector<Index> nodes(const InpMember& member, const std::string& home) const override {
    return members(member, home, true);
  }
  [[nodiscard]] std::vector<Index> elements(const InpMember& member, const std::string& home) const override {
    return members(member, home, false);
  }
  [[nodiscard]] bool faces(const InpMember& member, const std::string& home,
                           std::vector<MeshFace>& out) const override {
    const Labels& space = space_of(member, space_.at(home));
    bool found = false;
    for (const InpScope* scope : space.scopes)
      if (const auto surface = scope->surfaces.find(member.name); surface != scope->surfaces.end()) {
        add_faces(space, surface->second, true, out);
        found = true;
      }
    return found;
  }
  [[nodiscard]] bool in_element_set(std::int64_t label, const std::string& set,
                                    const std::string& home) const override {
    return holds(inp_member(set, "", 0), space_.at(home), label, 0);
  }

 private:
  std::vector<Index> members(const InpMember& member, const std::string& home, bool nodes) const {
    std::vector<Index> out;
    resolve(member, space_.at(home), nodes, 0, out);
    sort_unique(out);
    return out;
  }

  [[nodiscard]] bool holds(const InpMember& entry, const Labels& home, std::int64_t label, int depth) const {
    const Labels& space = space_of(entry, home);
    if (entry.name.empty())
      return label >= entry.first && label <= entry.last && (label - entry.first) % entry.step == 0;
    constexpr int kDeepest = 32;
    if (depth > kDeepest) return false;
    for (const InpScope* scope : space.scopes)
      if (const auto set = scope->element_sets.find(entry.name); set != scope->element_sets.end())
        for (const InpMember& inner : set->second.entries) {
          count_member(inner);
          if (holds(inner, space, label, depth + 1)) return true;
        }
    return false;
  }

  [[nodiscard]] std::string place_of(std::int64_t line) const {
    return fmt::format("{}:{}", model_.files[static_cast<std::size_t>(line / kLinesOfFile)], line % kLinesOfFile);
  }
  [[noreturn]] void fail(std::int64_t line, const std::string& message) const {
    throw Error(StatusCode::invalid_input, fmt::format("{}: {}", place_of(line), message));
  }

  void add_notices() {
    if (undefined_ > 0)
      mesh_.notices.push_back(fmt::format("{}: members of sets that are not defined are left out: {}, the first is {}",
                                          model_.path, undefined_, first_undefined_));
    const auto note = [this](const char* what, const std::map<std::string, long>& counts) {
      std::vector<std::string> list;
      for (const auto& [name, count] : counts) list.push_back(fmt::format("{} ({})", name, count));
      if (!list.empty()) mesh_.notices.push_back(fmt::format("{}: {}: {}", model_.path, what, fmt::join(list, ", ")));
    };
    if (!model_.is_deck) note("elements that were passed over", model_.passed_elements);
    if (!model_.is_deck)
      note("keywords that were passed over; take = \"all\" beside the file takes supports, loads and steps over",
           model_.passed_keywords);
    mesh_.notices.insert(mesh_.notices.end(), model_.notices.begin(), model_.notices.end());
    note("elements with more nodes than their type has, those behind are left out", model_.long_elements);
    note("continuum shells are read as solids; they bend well with hex8 = \"shell\"", model_.solid_shells);
  }

  /// An instance takes one line, its part any number of nodes.
  void check_instances() const {
    constexpr std::size_t kMost = 100000000;
    std::map<std::string, std::size_t> sizes;
    for (const InpScope& part : model_.parts) sizes[part.name] += part.nodes.size() + part.elements.size();
    std::size_t total = 0;
    for (const InpInstance& i : model_.instances) {
      if (const auto part = sizes.find(i.part); part != sizes.end()) total += part->second;
      if (total > kMost)
        fail(i.line, fmt::format("the instances up to here have more than {} nodes and elements", kMost));
    }
  }

  template <class Move>
  void add_scope(const InpScope& scope, Labels& labels, const Move& move) {
    labels.scopes.push_back(&scope);
    for (const InpNode& n : scope.nodes) {
      labels.nodes[n.label] = static_cast<Index>(mesh_.nodes.size());  // a later definition replaces an earlier one
      mesh_.nodes.push_back(move(n.at));
      mesh_.node_labels.push_back(n.label);
    }
    for (const InpElement& e : scope.elements) {
      std::array<Index, kMaxElementNodes> nodes{};
      const std::size_t count = static_cast<std::size_t>(shape_of(e.type).nodes);
      for (std::size_t a = 0; a < count; ++a) {
        const auto found = labels.nodes.find(e.nodes[a]);
        if (found == labels.nodes.end())
          fail(e.line, fmt::format("element {} uses node {}, which is not defined", e.label, e.nodes[a]));
        nodes[a] = found->second;
      }
      const Index index = mesh_.add_element(e.type, std::span(nodes).first(count));
      if (!labels.elements.emplace(e.label, index).second)
        fail(e.line, fmt::format("element {} is defined twice", e.label));
      mesh_.element_labels.push_back(e.label);
    }
  }

  void add_instance(const InpInstance& i) {
    const auto move = [&](const Point& p) { return moved(i, p); };
    Labels& labels = space_[i.own.name];
    const auto first_node = static_cast<Index>(mesh_.nodes.size()), first_element = mesh_.element_count();
    for (const InpScope& part : model_.parts)
      if (part.name == i.part) add_scope(part, labels, move);
    if (labels.scopes.empty() && i.own.nodes.empty())
      fail(i.line, fmt::format("instance {} refers to part {}, which is not defined", i.own.name, i.part));
    add_scope(i.own, labels, move);
    order_.push_back(i.own.name);
    if (model_.instances.size() < 2) return;
    for (auto n = first_node; n < static_cast<Index>(mesh_.nodes.size()); ++n)
      mesh_.node_sets[i.own.name + kWholeInstance].push_back(n);
    for (auto e = first_element; e < mesh_.element_count(); ++e)
      mesh_.element_sets[i.own.name + kWholeInstance].push_back(e);
  }

  /// Without instances all parts share one name space with the rest of the file.
  void merge_into_root() {
    Labels& root = space_[""];
    for (const InpScope& part : model_.parts) {
      const Labels& labels = space_[part.name];
      root.nodes.insert(labels.nodes.begin(), labels.nodes.end());
      root.elements.insert(labels.elements.begin(), labels.elements.end());
      root.scopes.insert(root.scopes.end(), labels.scopes.begin(), labels.scopes.end());
    }
  }

  /// Calls body(name space) for the one that an entry belongs to.
  const Labels& space_of(const InpMember& entry, const Labels& home) const {
    if (entry.instance.empty()) return home;
    const auto found = space_.find(entry.instance);
    if (found == space_.end() && entry.instance == model_.assembly) return space_.at("");
    if (found == space_.end()) fail(entry.line, fmt::format("instance {} is not defined", entry.instance));
    return found->second;
  }

  /// Resolves one entry to indices, nested sets included.
  void resolve(const InpMember& entry, const Labels& home, bool nodes, int depth, std::vector<Index>& out) const {
    const char* kind = nodes ? "node" : "element";
    const Labels& space = space_of(entry, home);
    if (entry.name.empty()) return resolve_labels(entry, space, nodes, out);
    if (nodes && entry.of_elements) return resolve_nodes_of(entry, space, depth, out);
    if (depth > 32) fail(entry.line, fmt::format("{} set {} contains itself", kind, entry.name));
    bool found = false;
    for (const InpScope* scope : space.scopes) {
      const InpSet* set = nodes ? find_node_set(*scope, entry) : find_set(scope->element_sets, entry.name);
      if (set == nullptr) continue;
      found = true;
      for (const InpMember& inner : set->entries) resolve(inner, space, nodes, depth + 1, out);
    }
    if (!found) fail(entry.line, fmt::format("{} set {} is not defined", kind, entry.name));
  }

  static const InpSet* find_set(const InpSets& sets, const std::string& name) {
    const auto found = sets.find(name);
    return found == sets.end() ? nullptr : &found->second;
  }
  /// Sets and surfaces of nodes may have one name.
  static const InpSet* find_node_set(const InpScope& scope, const InpMember& entry) {
    const InpSet* surface = find_set(scope.node_surfaces, entry.name);
    const InpSet* set = find_set(scope.node_sets, entry.name);
    return set == nullptr || (entry.of_surface && surface != nullptr) ? surface : set;
  }

  void resolve_nodes_of(const InpMember& set, const Labels& space, int depth, std::vector<Index>& out) const {
    std::vector<Index> elements;
    resolve(set, space, false, depth, elements);
    for (const Index e : elements) {
      count_member(set);
      const auto nodes = mesh_.element(e);
      out.insert(out.end(), nodes.begin(), nodes.end());
    }
  }

  /// The labels of one entry that are defined, as Abaqus and CalculiX take them.
  void resolve_labels(const InpMember& entry, const Labels& space, bool nodes, std::vector<Index>& out) const {
    for (std::int64_t label = entry.first;; label += entry.step) {
      const Index found = index_of(label, space, nodes);
      if (found >= 0)
        out.push_back(found);
      else if (nodes || !was_passed_over(label, space))
        note_undefined(entry, label, nodes);
      count_member(entry);
      // Without overflow, whatever the labels.
      if (static_cast<std::uint64_t>(entry.last) - static_cast<std::uint64_t>(label) <
          static_cast<std::uint64_t>(entry.step))
        return;
    }
  }

  void note_undefined(const InpMember& entry, std::int64_t label, bool nodes) const {
    if (undefined_++ == 0)
      first_undefined_ = fmt::format("{} {} in {}", nodes ? "node" : "element", label, place_of(entry.line));
  }

  [[nodiscard]] bool was_passed_over(std::int64_t label, const Labels& space) const {
    const auto in = [&](const Labels& labels) {
      return std::any_of(labels.scopes.begin(), labels.scopes.end(),
                         [&](const InpScope* scope) { return scope->passed_over.contains(label); });
    };
    return in(space) || (order_.size() == 1 && in(space_.at(order_.front())));
  }

  /// The node or element with this label, or -1. A bare label at assembly level is unique when there is a single
  /// instance.
  [[nodiscard]] Index index_of(std::int64_t label, const Labels& space, bool nodes) const {
    const auto& labels = nodes ? space.nodes : space.elements;
    if (const auto found = labels.find(label); found != labels.end()) return found->second;
    if (order_.size() != 1 || &space != &space_.at("")) return -1;
    const Labels& only = space_.at(order_.front());
    const auto& in_instance = nodes ? only.nodes : only.elements;
    const auto found = in_instance.find(label);
    return found == in_instance.end() ? -1 : found->second;
  }

  /// Sets that hold one another, or ranges without end, make members of a few lines.
  void count_member(const InpMember& entry) const {
    constexpr std::size_t kFree = 1000000, kEach = 100;
    if (++members_ > kFree + kEach * (mesh_.nodes.size() + mesh_.element_labels.size()))
      fail(entry.line,
           fmt::format("the sets up to here have more than {} members; are they nested without end?", members_ - 1));
  }

  void add_sets() {
    for (const std::string& instance : order_) add_sets_of(space_.at(instance), order_.size() > 1 ? instance : "");
    add_sets_of(space_.at(""), "");
    for (auto& [name, set] : mesh_.node_sets) sort_unique(set);
    for (auto& [name, set] : mesh_.element_sets) sort_unique(set);
  }

  void add_sets_of(const Labels& space, const std::string& instance) {
    for (const InpScope* scope : space.scopes) {
      for (const bool nodes : {true, false})
        for (const auto& [key, set] : nodes ? scope->node_sets : scope->element_sets) {
          std::vector<Index> members;
          for (const InpMember& entry : set.entries) resolve(entry, space, nodes, 0, members);
          if (members.empty() && !set.entries.empty()) continue;  // of elements that were passed over
          auto& sets = nodes ? mesh_.node_sets : mesh_.element_sets;
          append(sets[spelling(nodes ? node_names_ : element_names_, set.spelling)], members);
          if (!instance.empty()) append(sets[instance + "." + set.spelling], members);
        }
      for (const auto& [key, surface] : scope->node_surfaces) {
        if (scope->node_sets.contains(key)) continue;
        std::vector<Index> members;
        for (const InpMember& entry : surface.entries) resolve(entry, space, true, 0, members);
        append(mesh_.node_sets[spelling(node_names_, surface.spelling)], members);
        if (!instance.empty()) append(mesh_.node_sets[instance + "." + surface.spelling], members);
      }
      for (const auto& [key, surface] : scope->surfaces) add_surface(space, surface);
      // Sets of several instances have the same names.
      for (const auto& [key, material] : scope->section_material) {
        const auto set = scope->element_sets.find(key);
        const std::string name = instance.empty() || set == scope->element_sets.end()
                                     ? spelling(element_names_, key)
                                     : instance + "." + set->second.spelling;
        mesh_.section_material[name] = material_name(material);
      }
    }
  }

  void add_surface(const Labels& space, const InpSet& surface) {
    const std::string name = spelling(surface_names_, surface.spelling);
    auto& faces = mesh_.face_sets[name];
    add_faces(space, surface, false, faces);
    if (faces.empty()) mesh_.face_sets.erase(name);
  }

  void add_faces(const Labels& space, const InpSet& surface, bool of_shells, std::vector<MeshFace>& faces) const {
    for (const InpMember& entry : surface.entries) {
      std::vector<Index> elements;
      resolve(entry, space, false, 0, elements);
      for (const Index e : elements) {
        if (shape_of(mesh_.type(e)).dimension == 2 && of_shells && (entry.side >= 0 || entry.face < 0))
          faces.push_back({e, std::max(entry.side, kShellTop)});
        if (shape_of(mesh_.type(e)).dimension < 3) continue;  // edges and sides of surface elements
        if (entry.side >= 0)
          fail(entry.line, fmt::format("element {} is no shell, which has SPOS and SNEG", mesh_.element_label(e)));
        if (entry.face < 0) {
          add_outer_faces(e, faces);
          continue;
        }
        if (static_cast<std::size_t>(entry.face) >= shape_of(mesh_.type(e)).faces.size())
          fail(entry.line, fmt::format("element {} ({}) has no face S{}", mesh_.element_label(e),
                                       shape_of(mesh_.type(e)).name, entry.face + 1));
        faces.push_back({e, entry.face});
      }
    }
  }

  void add_outer_faces(Index element, std::vector<MeshFace>& faces) const {
    if (outer_faces_.empty()) outer_faces_ = mesh_.boundary_faces();
    for (auto f = std::lower_bound(outer_faces_.begin(), outer_faces_.end(), MeshFace{element, 0});
         f != outer_faces_.end() && f->element == element; ++f)
      faces.push_back(*f);
  }

  /// A material's name as *MATERIAL spells it.
  [[nodiscard]] const std::string& material_name(const std::string& name) const {
    for (const MeshMaterial& m : model_.materials)
      if (upper(m.name) == upper(name)) return m.name;
    return name;
  }

  /// Names are not case-sensitive: the first spelling stays.
  static std::string spelling(std::map<std::string, std::string>& names, const std::string& name) {
    return names.emplace(upper(name), name).first->second;
  }
  static void append(std::vector<Index>& to, const std::vector<Index>& from) {
    to.insert(to.end(), from.begin(), from.end());
  }

  const InpModel& model_;
  Mesh mesh_;
  mutable std::vector<MeshFace> outer_faces_;  // in order; empty: not asked for yet
  mutable std::size_t members_ = 0;            // of all sets
  mutable std::size_t undefined_ = 0;          // members that do not exist
  mutable std::string first_undefined_;
  std::map<std::string, Labels> space_;  // by upper-case instance or part; "": the file
  std::vector<std::string> order_;       // instances in order of the file
  std::map<std::string, std::string> node_names_, element_names_, surface_names_;
};

}  // namespace

Mesh flatten_inp(const InpModel& model, const std::function<void(const InpLookup&)>& use) {
  return Flattener(model).run(use);
}

Mesh parse_inp(std::string content, const std::string& name) {
  return flatten_inp(parse_inp_text(std::move(content), name));
}

Mesh read_inp(const std::string& path) { return parse_inp(read_whole_file(path), path); }

}  // namespace espalier::dynamics
