#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <optional>

#include "dynamics/mesh/inp_model.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {

namespace {

constexpr int kDeepestInclude = 16, kMostIncludes = 1000;

struct InpType {
  const char* name;
  ElementType type;
};
// A type matches when its name is this, or this followed by letters (R: reduced, I: incompatible, H: hybrid, M, T ...).
constexpr InpType kTypes[] = {
    {"C3D4", ElementType::tet4},     {"C3D10", ElementType::tet10}, {"C3D8", ElementType::hex8},
    {"C3D20", ElementType::hex20},   {"C3D6", ElementType::wedge6}, {"C3D15", ElementType::wedge15},
    {"C3D5", ElementType::pyramid5}, {"S3", ElementType::tri3},     {"S4", ElementType::quad4},
    {"S6", ElementType::tri6},       {"S8", ElementType::quad8},    {"STRI3", ElementType::tri3},
    {"STRI65", ElementType::tri6},   {"M3D3", ElementType::tri3},   {"M3D4", ElementType::quad4},
    {"M3D6", ElementType::tri6},     {"M3D8", ElementType::quad8},  {"SFM3D3", ElementType::tri3},
    {"SFM3D4", ElementType::quad4},  {"SFM3D6", ElementType::tri6}, {"SFM3D8", ElementType::quad8},
    {"CPS3", ElementType::tri3},     {"CPS4", ElementType::quad4},  {"CPS6", ElementType::tri6},
    {"CPS8", ElementType::quad8},    {"CPE3", ElementType::tri3},   {"CPE4", ElementType::quad4},
    {"CPE6", ElementType::tri6},     {"CPE8", ElementType::quad8},  {"CAX3", ElementType::tri3},
    {"CAX4", ElementType::quad4},    {"CAX6", ElementType::tri6},   {"CAX8", ElementType::quad8},
    {"B31", ElementType::line2},     {"B32", ElementType::line3},   {"T3D2", ElementType::line2},
    {"T3D3", ElementType::line3}};

std::optional<ElementType> type_of(const std::string& name) {
  for (const InpType& t : kTypes) {
    const std::string_view known(t.name);
    if (name.size() < known.size() || name.compare(0, known.size(), known) != 0) continue;
    if (std::all_of(name.begin() + static_cast<std::ptrdiff_t>(known.size()), name.end(),
                    [](unsigned char c) { return std::isalpha(c) != 0; }))
      return t.type;
  }
  return std::nullopt;
}

/// "*NSET, NSET=Fix, GENERATE": the keyword without blanks, and its parameters by upper-case name.
struct Keyword {
  std::string name;
  std::map<std::string, std::string> parameters;
  [[nodiscard]] bool has(const char* key) const { return parameters.contains(key); }
  [[nodiscard]] std::string get(const char* key) const {
    const auto found = parameters.find(key);
    return found == parameters.end() ? std::string() : found->second;
  }
};

std::string without_blanks(std::string text) {
  std::erase_if(text, [](char c) { return c == ' ' || c == '\t'; });
  return text;
}

std::string unquoted(std::string_view text) {
  text = trim(text);
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return std::string(text);
}

class InpParser {
 public:
  explicit InpParser(InpModel& model) : model_(model) {}

  void file(const std::string& path, int depth) {
    LineReader reader(path, read_whole_file(path));
    std::string_view line;
    while (reader.next(line)) {
      if (comment(line)) continue;
      if (line.front() != '*')
        reader.fail(fmt::format("expected a keyword that starts with *, found '{}'", line.substr(0, 40)));
      keyword(reader, read_keyword(reader, line), depth);
    }
  }

 private:
  static bool comment(std::string_view line) { return trim(line).empty() || line.starts_with("**"); }

  static Keyword read_keyword(LineReader& reader, std::string_view first) {
    std::string text(trim(first));
    std::string_view more;
    while (!text.empty() && text.back() == ',' && reader.next(more)) text += trim(more);
    Keyword k;
    Fields fields(reader, text, ',');
    std::string_view field;
    for (bool head = true; fields.next(field); head = false) {
      if (field.empty()) continue;
      const std::size_t equal = field.find('=');
      const std::string key = without_blanks(upper(field.substr(0, equal)));
      if (head)
        k.name = key;
      else
        k.parameters[key] = equal == std::string_view::npos ? std::string() : unquoted(field.substr(equal + 1));
    }
    return k;
  }

  /// The next data line. @return false at a keyword or at the end
  static bool data(LineReader& reader, std::string_view& line) {
    while (reader.next(line)) {
      if (comment(line)) continue;
      if (line.front() != '*') return true;
      reader.back();
      return false;
    }
    return false;
  }

  InpScope& scope() {
    if (in_instance_) return model_.instances.back().own;
    return in_part_ ? model_.parts.back() : model_.root;
  }

  static InpSet& set_in(InpSets& sets, const std::string& name) {
    InpSet& set = sets[upper(name)];
    if (set.spelling.empty()) set.spelling = name;
    return set;
  }

  void keyword(LineReader& reader, const Keyword& k, int depth) {
    static const char* const kGenerators[] = {"*NGEN", "*NFILL", "*NCOPY", "*NMAP", "*ELGEN", "*ELCOPY", "*SYSTEM"};
    if (k.name == "*NODE") return nodes(reader, k);
    if (k.name == "*ELEMENT") return elements(reader, k);
    if (k.name == "*NSET") return set(reader, k, set_in(scope().node_sets, need(reader, k, "NSET")));
    if (k.name == "*ELSET") return set(reader, k, set_in(scope().element_sets, need(reader, k, "ELSET")));
    if (k.name == "*SURFACE") return surface(reader, k);
    if (k.name == "*MATERIAL") model_.materials.push_back({need(reader, k, "NAME"), 0, 0, 0});
    if (k.name == "*DENSITY" || k.name == "*ELASTIC") return material(reader, k);
    if (k.name == "*SOLIDSECTION") scope().section_material[upper(need(reader, k, "ELSET"))] = k.get("MATERIAL");
    if (k.name == "*PART") {
      model_.parts.emplace_back().name = upper(need(reader, k, "NAME"));
      in_part_ = true;
    }
    if (k.name == "*ENDPART") in_part_ = false;
    if (k.name == "*INSTANCE") return instance(reader, k);
    if (k.name == "*ENDINSTANCE") in_instance_ = false;
    if (k.name == "*INCLUDE") include(reader, k, depth);
    for (const char* generator : kGenerators)
      if (k.name == generator) reader.fail(fmt::format("{} is not read; write nodes and elements out in full", k.name));
    std::string_view skipped;
    while (data(reader, skipped)) {
    }
  }

  static std::string need(const LineReader& reader, const Keyword& k, const char* key) {
    if (k.get(key).empty()) reader.fail(fmt::format("{} needs {}=", k.name, key));
    return k.get(key);
  }

  void include(const LineReader& reader, const Keyword& k, int depth) {
    if (depth >= kDeepestInclude) reader.fail("files include one another more than 16 deep");
    if (++includes_ > kMostIncludes) reader.fail(fmt::format("more than {} files are included", kMostIncludes));
    file((std::filesystem::path(reader.path()).parent_path() / need(reader, k, "INPUT")).string(), depth + 1);
  }

  void nodes(LineReader& reader, const Keyword& k) {
    if (k.has("SYSTEM") && upper(k.get("SYSTEM")) != "R")
      reader.fail("*NODE in other than rectangular coordinates is not read");
    InpSet* set = k.has("NSET") ? &set_in(scope().node_sets, k.get("NSET")) : nullptr;
    std::string_view line, field;
    while (data(reader, line)) {
      Fields fields(reader, line, ',');
      InpNode node{fields.integer("node number"), {}};
      for (double& x : node.at) {
        Fields ahead = fields;
        if (!ahead.next(field) || field.empty()) break;
        x = fields.real("coordinate");
      }
      scope().nodes.push_back(node);
      if (set != nullptr) set->entries.push_back(labels(node.label, node.label, reader));
    }
  }

  void elements(LineReader& reader, const Keyword& k) {
    const std::string name = upper(need(reader, k, "TYPE"));
    const auto type = type_of(name);
    if (!type)
      reader.fail(
          fmt::format("element type {} is not read (C3D4, C3D10, C3D8, C3D20, C3D6, C3D15, and shells, "
                      "membranes, beams and trusses are)",
                      name));
    InpSet* set = k.has("ELSET") ? &set_in(scope().element_sets, k.get("ELSET")) : nullptr;
    std::string_view line;
    while (data(reader, line)) {
      InpElement e{*type, 0, {}, reader.line()};
      const int count = shape_of(*type).nodes;
      int have = -1;  // the label comes first
      while (true) {
        Fields fields(reader, line, ',');
        std::string_view field;
        for (Fields ahead = fields; have < count && ahead.next(field) && !field.empty(); ahead = fields) {
          const std::int64_t value = fields.integer(have < 0 ? "element number" : "node number");
          (have < 0 ? e.label : e.nodes[static_cast<std::size_t>(have)]) = value;
          ++have;
        }
        if (have == count) break;
        if (!data(reader, line))
          reader.fail(fmt::format("element {} of type {} has {} nodes, {} are needed", e.label, name, have, count));
      }
      scope().elements.push_back(e);
      if (set != nullptr) set->entries.push_back(labels(e.label, e.label, reader));
    }
  }

  static InpMember labels(std::int64_t first, std::int64_t last, const LineReader& reader) {
    InpMember e;
    e.first = first;
    e.last = last;
    e.line = reader.line();
    return e;
  }

  /// "12", "SET-1", "PART-1-1.12", "PART-1-1.SET-1"
  static InpMember entry(std::string_view field, const std::string& instance, std::int64_t line) {
    InpMember e;
    e.instance = instance;
    e.line = line;
    std::string text = upper(unquoted(field));
    if (const std::size_t dot = text.find('.'); dot != std::string::npos) {
      e.instance = text.substr(0, dot);
      text = text.substr(dot + 1);
    }
    const bool number =
        !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
    if (number && text.size() < 18)
      e.first = e.last = std::stoll(text);
    else
      e.name = text;
    return e;
  }

  void set(LineReader& reader, const Keyword& k, InpSet& target) {
    const std::string instance = upper(k.get("INSTANCE"));
    std::string_view line, field;
    while (data(reader, line)) {
      Fields fields(reader, line, ',');
      if (k.has("GENERATE")) {
        const std::int64_t from = fields.integer("first number"), to = fields.integer("last number");
        Fields ahead = fields;
        const std::int64_t by = ahead.next(field) && !field.empty() ? fields.integer("increment") : 1;
        if (by <= 0 || to < from) reader.fail(fmt::format("GENERATE from {} to {} by {} makes no set", from, to, by));
        InpMember& e = target.entries.emplace_back(labels(from, to, reader));
        e.instance = instance;
        e.step = by;
        continue;
      }
      while (fields.next(field))
        if (!field.empty()) target.entries.push_back(entry(field, instance, reader.line()));
    }
  }

  void surface(LineReader& reader, const Keyword& k) {
    const std::string name = need(reader, k, "NAME"), type = upper(k.get("TYPE"));
    if (type == "NODE") return set(reader, k, set_in(scope().node_sets, name));
    InpSet& target = set_in(scope().surfaces, name);
    std::string_view line, field;
    while (data(reader, line)) {
      Fields fields(reader, line, ',');
      if (!fields.next(field) || field.empty()) continue;
      InpMember e = entry(field, upper(k.get("INSTANCE")), reader.line());
      if (!fields.next(field) || field.size() != 2 || std::toupper(field[0]) != 'S' || field[1] < '1' || field[1] > '6')
        continue;  // sides of shells, free surfaces: no faces of solids
      e.face = field[1] - '1';
      target.entries.push_back(e);
    }
  }

  void material(LineReader& reader, const Keyword& k) {
    if (model_.materials.empty()) reader.fail(fmt::format("{} stands before any *MATERIAL", k.name));
    MeshMaterial& m = model_.materials.back();
    const std::string type = upper(k.get("TYPE"));
    const bool isotropic = type.empty() || type == "ISO" || type == "ISOTROPIC";
    std::string_view line;
    for (bool first = true; data(reader, line); first = false) {
      if (!first || !isotropic) continue;  // further lines: other temperatures
      Fields fields(reader, line, ',');
      if (k.name == "*DENSITY") {
        m.density = fields.real("density");
      } else {
        m.young = fields.real("Young's modulus");
        m.poisson = fields.real("Poisson's ratio");
      }
    }
  }

  void instance(LineReader& reader, const Keyword& k) {
    InpInstance& i = model_.instances.emplace_back();
    i.own.name = upper(need(reader, k, "NAME"));
    i.part = upper(k.get("PART"));
    i.line = reader.line();
    in_instance_ = true;
    std::string_view line;
    if (!data(reader, line)) return;
    Fields move(reader, line, ',');
    for (double& x : i.translation) x = move.real("translation");
    if (!data(reader, line)) return;
    Fields turn(reader, line, ',');
    for (double& x : i.axis_from) x = turn.real("first point of the axis");
    for (double& x : i.axis_to) x = turn.real("second point of the axis");
    i.degrees = turn.real("angle");
    i.turned = true;
  }

  InpModel& model_;
  bool in_part_ = false, in_instance_ = false;
  int includes_ = 0;  // of all files together
};

}  // namespace

InpModel parse_inp(const std::string& path) {
  InpModel model;
  model.path = path;
  InpParser(model).file(path, 0);
  return model;
}

}  // namespace espalier::dynamics
