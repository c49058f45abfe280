#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <utility>

#include "base/at.hpp"
#include "dynamics/mesh/file_source.hpp"
#include "dynamics/mesh/inp_model.hpp"
#include "dynamics/mesh/read/inp_generate.hpp"
#include "dynamics/mesh/read/inp_lines.hpp"
#include "dynamics/mesh/read/inp_types.hpp"

namespace espalier::dynamics {

namespace {

constexpr int kDeepestInclude = 16, kMostIncludes = 1000;

/// Keywords each of whose lines stands for itself: the lines may come from several files.
bool takes_lines_of_files(const std::string& name) {
  static constexpr std::string_view kNames[] = {"*NODE",  "*ELEMENT", "*NSET",   "*ELSET",    "*SURFACE",  "*NGEN",
                                                "*CLOAD", "*DLOAD",   "*DSLOAD", "*BOUNDARY", "*EQUATION", "*MPC"};
  return std::find(std::begin(kNames), std::end(kNames), name) != std::end(kNames);
}

class InpParser {
 public:
  explicit InpParser(InpModel& model) : model_(model) {}

  void file(const std::string& path, std::string content, int depth) {
    LineReader reader(path, std::move(content));
    const std::int64_t before = std::exchange(file_, static_cast<std::int64_t>(model_.files.size()));
    model_.files.push_back(path);
    std::string_view line;
    while (reader.next(line)) {
      if (is_inp_comment(line)) continue;
      line = trim(line);
      if (line.front() != '*') {  // data of the keyword before, where files meet
        if (!takes_lines_of_files(open_.name))
          reader.fail(fmt::format("expected a keyword that starts with *, found '{}'", line.substr(0, 40)));
        reader.back();
        keyword(reader, open_);
        continue;
      }
      InpKeyword k = read_inp_keyword(reader, line);
      if (k.name == "*INCLUDE") {
        include(reader, k.need(reader, "INPUT"), depth);
        continue;
      }
      const std::string input = takes_lines_of_files(k.name) ? k.get("INPUT") : "";
      if (!input.empty()) k.parameters.erase("INPUT");
      open_ = std::move(k);
      keyword(reader, open_);
      if (!input.empty()) include(reader, input, depth);
    }
    file_ = before;
  }

 private:
  InpScope& scope() {
    if (in_instance_) return model_.instances.back().own;
    return in_part_ ? model_.parts.back() : model_.root;
  }

  [[nodiscard]] std::int64_t here(const LineReader& reader) const { return file_ * kLinesOfFile + reader.line(); }

  void keyword(LineReader& reader, const InpKeyword& k) {
    if (k.name == "*NODE") return nodes(reader, k);
    if (k.name == "*ELEMENT") return elements(reader, k);
    if (k.name == "*NSET") return node_set(reader, k, inp_set(scope().node_sets, k.need(reader, "NSET")));
    if (k.name == "*ELSET") return set(reader, k, inp_set(scope().element_sets, k.need(reader, "ELSET")));
    if (k.name == "*SURFACE") return surface(reader, k);
    if (k.name == "*RESTART" && k.has("READ") && model_.is_deck)
      reader.fail("*RESTART, READ goes on from another run, whose files are not read; take the whole model as a deck");
    if (k.name == "*DENSITY" || k.name == "*ELASTIC") return material(reader, k);
    if (k.name == "*INSTANCE") return instance(reader, k);
    if (k.name == "*SYSTEM") {
      system_ = read_inp_system(reader);
      return;
    }
    if (generator_.generate(reader, k, system_, scope(), file_ * kLinesOfFile)) return;
    if (k.name == "*MATERIAL")
      model_.materials.push_back({k.need(reader, "NAME"), 0, 0, 0});
    else if (k.name == "*SOLIDSECTION")
      scope().section_material[upper(k.need(reader, "ELSET"))] = k.get("MATERIAL");
    else if (k.name == "*SHELLSECTION" || k.name == "*BEAMSECTION")
      return thin_section(reader, k);
    else if (k.name == "*ASSEMBLY")
      model_.assembly = upper(k.get("NAME"));
    else if (k.name == "*PART")
      begin_part(k.need(reader, "NAME"));
    else if (k.name == "*ENDPART" || k.name == "*ENDINSTANCE")
      end_scope();
    else if (k.name == "*NMAP")
      reader.fail("*NMAP is not read; write the nodes out in full");
    else if (!is_idle_inp_keyword(k.name))
      pass_over(reader, k);
    skip(reader);
  }

  /// Read where shells and beams are made of the mesh: here only which materials they have, those of layers too.
  void thin_section(LineReader& reader, const InpKeyword& k) {
    model_.thin_materials.insert(upper(k.get("MATERIAL")));
    std::string_view line, field;
    while (next_inp_data(reader, line)) {
      Fields fields(reader, line, ',');
      if (k.has("COMPOSITE") && fields.next(field) && fields.next(field) && fields.next(field))
        model_.thin_materials.insert(upper(inp_unquoted(field)));
    }
  }

  void pass_over(LineReader& reader, const InpKeyword& k) {
    ++model_.passed_keywords[k.name];
    if (!model_.is_deck) return;
    if (k.name == "*STEP") ++model_.steps;
    InpCard& card = add_card(reader, k);
    std::string_view line;
    while (next_inp_data(reader, line)) card.lines.emplace_back(reader.line(), line);
  }
  InpCard& add_card(const LineReader& reader, const InpKeyword& k) {
    return model_.cards.emplace_back(InpCard{k,
                                             {reader.path(), reader.line()},
                                             {},
                                             in_part_ || in_instance_ ? scope().name : "",
                                             model_.steps,
                                             model_.materials.empty() ? "" : model_.materials.back().name});
  }

  void begin_part(const std::string& name) {
    end_scope();
    model_.parts.emplace_back().name = upper(name);
    in_part_ = true;
  }
  void end_scope() {
    in_part_ = in_instance_ = false;
    system_ = {};
    generator_.forget();
  }

  void include(const LineReader& reader, const std::string& input, int depth) {
    if (depth >= kDeepestInclude) reader.fail("files include one another more than 16 deep");
    if (++includes_ > kMostIncludes) reader.fail(fmt::format("more than {} files are included", kMostIncludes));
    for (const std::string& from : {reader.path(), model_.path}) {  // beside this file, or beside the first one
      const std::string path = (std::filesystem::path(from).parent_path() / input).string();
      if (file_exists(path) && !std::filesystem::is_directory(path))
        return file(path, read_whole_file(path), depth + 1);
    }
    reader.fail(fmt::format("*INCLUDE: there is no file '{}'",
                            (std::filesystem::path(reader.path()).parent_path() / input).string()));
  }

  void nodes(LineReader& reader, const InpKeyword& k) {
    InpSet* set = k.has("NSET") ? &inp_set(scope().node_sets, k.get("NSET")) : nullptr;
    std::string_view line, field;
    while (next_inp_data(reader, line)) {
      Fields fields(reader, line, ',');
      InpNode node{fields.integer("node number"), {}};
      for (double& x : node.at) {
        Fields ahead = fields;
        if (!ahead.next(field) || field.empty()) break;
        x = fields.real("coordinate");
      }
      if (k.has("SYSTEM")) node.at = inp_rectangular(reader, k.get("SYSTEM"), node.at);
      node.at = system_.global(node.at);
      scope().nodes.push_back(node);
      if (set != nullptr) set->entries.push_back(inp_labels(node.label, node.label, here(reader)));
    }
  }

  void elements(LineReader& reader, const InpKeyword& k) {
    const std::string name = upper(k.need(reader, "TYPE"));
    const auto type = inp_shape(name);
    if (is_unknown_inp_solid(name))
      reader.fail(
          fmt::format("element type {} is a solid that is not read (C3D4, C3D10, C3D8, C3D20, C3D6, C3D15, CSS8, "
                      "SC8R, SC6R are, with letters behind them)",
                      name));
    InpSet* set = k.has("ELSET") ? &inp_set(scope().element_sets, k.get("ELSET")) : nullptr;
    if (!type) return passed_over(reader, k, name, set);
    if (model_.is_deck) model_.read_types.emplace(name, DeckPlace{reader.path(), reader.line()});
    std::string_view line;
    while (next_inp_data(reader, line)) {
      InpElement e{*type, 0, {}, here(reader)};
      const int count = shape_of(*type).nodes;
      int have = -1;  // the label comes first
      while (true) {
        Fields fields(reader, line, ',');
        std::string_view field;
        for (Fields ahead = fields; have < count && ahead.next(field) && !field.empty(); ahead = fields) {
          const std::int64_t value = fields.integer(have < 0 ? "element number" : "node number");
          (have < 0 ? e.label : e.nodes[at(have)]) = value;
          ++have;
        }
        if (have == count) {
          std::string_view more;
          if (fields.next(more) && !more.empty()) ++model_.long_elements[name];
          break;
        }
        if (!next_inp_data(reader, line))
          reader.fail(fmt::format("element {} of type {} has {} nodes, {} are needed", e.label, name, have, count));
      }
      scope().elements.push_back(e);
      if (is_inp_solid_shell(name)) ++model_.solid_shells[name];
      if (set != nullptr) set->entries.push_back(inp_labels(e.label, e.label, here(reader)));
    }
  }

  /// Elements that are no solids, surfaces or lines: masses, springs, connectors, rigid faces ...; what sets hold of
  /// them is left out. A line that ends with a comma goes on in the next, but that of a connector to the ground.
  void passed_over(LineReader& reader, const InpKeyword& k, const std::string& name, InpSet* set) {
    InpCard* card = model_.is_deck ? &add_card(reader, k) : nullptr;
    std::string_view line;
    for (bool goes_on = false; next_inp_data(reader, line); goes_on = name != "CONN3D2" && trim(line).back() == ',') {
      if (card != nullptr && goes_on) card->lines.back().second += line;
      if (goes_on) continue;
      if (card != nullptr) card->lines.emplace_back(reader.line(), line);
      const std::int64_t label = Fields(reader, line, ',').integer("element number");
      scope().passed_over.insert(label);
      ++model_.passed_elements[name];
      if (set != nullptr) set->entries.push_back(inp_labels(label, label, here(reader)));
    }
  }

  void node_set(LineReader& reader, const InpKeyword& k, InpSet& target) {
    if (k.has("ELSET")) {
      InpMember& e = target.entries.emplace_back(inp_member(k.get("ELSET"), upper(k.get("INSTANCE")), here(reader)));
      e.of_elements = true;
    }
    set(reader, k, target);
  }

  void set(LineReader& reader, const InpKeyword& k, InpSet& target) {
    const std::string instance = upper(k.get("INSTANCE"));
    std::string_view line, field;
    while (next_inp_data(reader, line)) {
      Fields fields(reader, line, ',');
      if (k.has("GENERATE")) {
        const std::int64_t from = fields.integer("first number"), to = fields.integer("last number");
        Fields ahead = fields;
        const std::int64_t by = ahead.next(field) && !field.empty() ? fields.integer("increment") : 1;
        if (by <= 0 || to < from) reader.fail(fmt::format("GENERATE from {} to {} by {} makes no set", from, to, by));
        InpMember& e = target.entries.emplace_back(inp_labels(from, to, here(reader)));
        e.instance = instance;
        e.step = by;
        continue;
      }
      while (fields.next(field))
        if (!field.empty()) target.entries.push_back(inp_member(field, instance, here(reader)));
    }
  }

  void surface(LineReader& reader, const InpKeyword& k) {
    const std::string name = k.need(reader, "NAME"), type = upper(k.get("TYPE"));
    if (type == "NODE") return set(reader, k, inp_set(scope().node_surfaces, name));
    InpSet& target = inp_set(scope().surfaces, name);
    std::string_view line, field;
    while (next_inp_data(reader, line)) {
      Fields fields(reader, line, ',');
      if (!fields.next(field) || field.empty()) continue;
      InpMember e = inp_member(field, upper(k.get("INSTANCE")), here(reader));
      if (fields.next(field) && !field.empty()) {
        const std::string face = upper(field);
        if (face == "SPOS" || face == "SNEG") {
          e.side = face == "SPOS" ? kShellTop : kShellBottom;
          target.entries.push_back(e);
          continue;
        }
        if (field.size() != 2 || std::toupper(field[0]) != 'S' || field[1] < '1' || field[1] > '6')
          continue;  // sides of shells, edges: no faces of solids
        e.face = field[1] - '1';
      }
      target.entries.push_back(e);
    }
  }

  void material(LineReader& reader, const InpKeyword& k) {
    if (model_.materials.empty()) reader.fail(fmt::format("{} stands before any *MATERIAL", k.name));
    MeshMaterial& m = model_.materials.back();
    const std::string type = upper(k.get("TYPE")), place = fmt::format("{}:{}", reader.path(), reader.line());
    if (!type.empty() && type != "ISO" && type != "ISOTROPIC") {
      model_.notices.push_back(
          fmt::format("{}: material {}: {} TYPE={} is not taken; solids are isotropic", place, m.name, k.name, type));
      if (model_.is_deck) add_card(reader, k);
      return skip(reader);
    }
    const bool density = k.name == "*DENSITY";
    double temperature = 0;
    std::string_view line;
    int rows = 0;
    for (; next_inp_data(reader, line); ++rows) {
      if (rows > 0) continue;
      Fields fields(reader, line, ',');
      (density ? m.density : m.young) = fields.real(density ? "density" : "Young's modulus");
      if (!density) m.poisson = fields.real("Poisson's ratio");
      read_inp_reals(fields, &temperature, 1);
    }
    if (rows > 1)  // as CalculiX does where a deck states no temperatures
      model_.notices.push_back(
          fmt::format("{}: material {}: {} has values for {} temperatures; those of the first, "
                      "{:g}, are taken",
                      place, m.name, k.name, rows, temperature));
  }

  static void skip(LineReader& reader) {
    std::string_view skipped;
    while (next_inp_data(reader, skipped)) {
    }
  }

  void instance(LineReader& reader, const InpKeyword& k) {
    end_scope();
    InpInstance& i = model_.instances.emplace_back();
    i.own.name = upper(k.need(reader, "NAME"));
    i.part = upper(k.get("PART"));
    i.line = here(reader);
    in_instance_ = true;
    std::string_view line;
    if (!next_inp_data(reader, line)) return;
    Fields move(reader, line, ',');
    for (double& x : i.translation) x = move.real("translation");
    if (!next_inp_data(reader, line)) return;
    Fields turn(reader, line, ',');
    for (double& x : i.axis_from) x = turn.real("first point of the axis");
    for (double& x : i.axis_to) x = turn.real("second point of the axis");
    i.degrees = turn.real("angle");
    i.turned = true;
  }

  InpModel& model_;
  InpSystem system_;
  InpGenerator generator_;
  InpKeyword open_;  // the last one but *INCLUDE
  bool in_part_ = false, in_instance_ = false;
  int includes_ = 0;       // of all files together
  std::int64_t file_ = 0;  // in InpModel::files
};

}  // namespace

InpMember inp_member(std::string_view field, const std::string& instance, std::int64_t line) {
  InpMember e;
  e.instance = instance;
  e.line = line;
  std::string text = upper(inp_unquoted(field));
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

InpModel parse_inp_text(std::string content, const std::string& path, bool deck) {
  InpModel model;
  model.path = path;
  model.is_deck = deck;
  InpParser(model).file(path, std::move(content), 0);
  return model;
}

}  // namespace espalier::dynamics
