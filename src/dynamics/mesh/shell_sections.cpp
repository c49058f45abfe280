#include "dynamics/mesh/shell_sections.hpp"

#include <fmt/format.h>

#include <cmath>
#include <map>

#include "base/strtod.hpp"
#include "dynamics/mesh/names.hpp"
#include "dynamics/mesh/nastran_cards.hpp"
#include "dynamics/mesh/read/inp_walk.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {
namespace {

/// OFFSET is that of the nodes from the middle: SPOS, the nodes are on the top, is 0.5.
double inp_offset(const LineReader& reader, const InpKeyword& keyword) {
  const std::string text = upper(keyword.get("OFFSET"));
  if (text.empty()) return 0;
  if (text == "SPOS") return -0.5;
  if (text == "SNEG") return 0.5;
  char* end = nullptr;
  const double value = base::strtod(text.c_str(), &end);
  if (*end != '\0' || !std::isfinite(value))
    reader.fail(fmt::format("OFFSET={} must be a number of thicknesses, SPOS or SNEG", text));
  return 0.0 - value;
}

constexpr const char* kInstead = "give the body's 'thickness', 'material' and 'offset' in the model instead";

/// "thickness, points, material, orientation" of each layer.
void read_layers(LineReader& reader, ShellSection& section) {
  std::string_view line, field;
  while (next_inp_data(reader, line)) {
    Fields fields(reader, line, ',');
    ShellLayer layer{fields.real("thickness"), section.material};
    if (!(layer.thickness > 0)) reader.fail("*SHELL SECTION, COMPOSITE: a layer needs a thickness above 0");
    fields.next(field);  // points of integration
    if (fields.next(field) && !field.empty()) layer.material = inp_unquoted(field);
    section.thickness += layer.thickness;
    section.layers.push_back(std::move(layer));
  }
  if (section.layers.empty()) reader.fail("*SHELL SECTION, COMPOSITE has no layers");
}

ShellSections inp_sections(const std::string& path) {
  ShellSections all;
  std::vector<ShellSection>& out = all.list;
  std::vector<std::string> parts;  // of each section
  InpInstances instances;
  walk_inp(path, [&](LineReader& reader, const InpKeyword& keyword) {
    instances.take(keyword);
    std::string_view data;
    if (keyword.name == "*NODALTHICKNESS") {
      while (next_inp_data(reader, data)) {
        const std::size_t comma = data.find(',');
        if (comma == std::string_view::npos) reader.fail("*NODAL THICKNESS: needs a node or a set, and a thickness");
        Fields fields(reader, data.substr(comma + 1), ',');
        all.of_nodes.emplace_back(inp_unquoted(trim(data.substr(0, comma))), fields.real("thickness"));
        if (!(all.of_nodes.back().second > 0)) reader.fail("*NODAL THICKNESS: thicknesses are above 0");
      }
      return;
    }
    if (keyword.name != "*SHELLSECTION") return;
    ShellSection section{keyword.need(reader, "ELSET"), keyword.get("MATERIAL"), 0, inp_offset(reader, keyword)};
    section.place = fmt::format("{}:{}", reader.path(), reader.line());
    section.nodal = keyword.has("NODALTHICKNESS");
    if (keyword.has("COMPOSITE"))
      read_layers(reader, section);
    else if (next_inp_data(reader, data) && !section.nodal)
      section.thickness = Fields(reader, data, ',').real("thickness");
    if (section.nodal && !section.layers.empty())
      section.fault = fmt::format("{}: COMPOSITE with NODAL THICKNESS is not read; {}", section.place, kInstead);
    if (!section.nodal && !(section.thickness > 0)) reader.fail("*SHELL SECTION needs a thickness above 0");
    out.push_back(std::move(section));
    parts.push_back(instances.part());
  });
  for (std::size_t k = 0; k < parts.size(); ++k)
    for (const std::string& name : instances.names(parts[k], out[k].set)) {
      out.push_back(out[k]);
      out.back().set = name;
    }
  return all;
}

bool is_shell_card(const std::string& name) {
  return name == "CQUAD4" || name == "CQUAD8" || name == "CQUADR" || name == "CTRIA3" || name == "CTRIA6" ||
         name == "CTRIAR";
}

/// What a PSHELL says beside thickness and material.
void read_rest_of_pshell(const NastranCard& card, ShellSection& s) {
  const auto other = [&](const std::string& what) {
    s.fault = fmt::format("{}:{}: PSHELL: {} is not read; {}", card.path, card.line, what, kInstead);
  };
  if (card.field(3).empty())
    s.notice = fmt::format("{} has no MID2, which makes a membrane of it in Nastran: here it bends as well", s.set);
  else if (card.field(3) != card.field(1))
    other("a material of bending (MID2) that is another than MID1");
  if (card.real(4, "12I/T**3", 1) != 1) other("a bending stiffness other than that of the thickness (12I/T**3)");
  if (card.real(7, "NSM", 0) != 0) other("mass beside that of the material (NSM)");
  if (!card.field(10).empty()) other("coupling of membrane and bending (MID4)");
}

/// PID Z0 NSM SB FT TREF GE LAM - MID1 T1 THETA1 SOUT1 - MID2 ...: layers from the bottom, which lies at Z0.
void read_pcomp(const NastranCard& card, ShellSection& s) {
  const auto other = [&](const std::string& what) {
    s.fault = fmt::format("{}:{}: PCOMP: {} is not read; {}", card.path, card.line, what, kInstead);
  };
  const std::string lam = upper(card.field(7));
  if (!lam.empty() && lam != "SYM") other("LAM = " + lam);
  if (card.real(2, "NSM", 0) != 0) other("mass beside that of the material (NSM)");
  for (std::size_t k = 8; k < card.fields.size(); k += 4) {
    if (card.field(k).empty() && card.field(k + 1).empty()) continue;
    ShellLayer layer = s.layers.empty() ? ShellLayer{} : s.layers.back();  // blanks repeat the layer before
    if (!card.field(k).empty()) layer.material = fmt::format("MAT1-{}", card.integer(k, "material"));
    if (!card.field(k + 1).empty()) layer.thickness = card.real(k + 1, "thickness");
    if (!(layer.thickness > 0)) card.fail("a layer needs a thickness above 0");
    s.layers.push_back(std::move(layer));
  }
  if (s.layers.empty()) card.fail("has no layers");
  if (lam == "SYM")
    for (std::size_t k = s.layers.size(); k-- > 0;) s.layers.push_back(ShellLayer(s.layers[k]));
  for (const ShellLayer& layer : s.layers) s.thickness += layer.thickness;
  if (!card.field(1).empty()) s.offset = card.real(1, "Z0") / s.thickness + 0.5;
}

/// T1 to T4 of an element; with TFLAG = 1 they are parts of the section's thickness.
void read_corners(const NastranCard& card, ShellSections& out) {
  const bool many = card.name == "CQUAD8";
  std::array<double, 4> t{};
  for (std::size_t k = 0; k < 4; ++k)
    if (!card.field(10 + k).empty() && !(card.name == "CTRIA6" && k == 3)) t[k] = card.real(10 + k, "thickness");
  if (t == std::array<double, 4>{}) return;
  if (card.integer(many ? 16 : card.name == "CTRIA6" ? 13 : 9, "TFLAG", 0) != 0)
    for (double& x : t) x = -x;  // times that of the section
  for (const double x : t)
    if (!std::isfinite(x)) card.fail("thicknesses T1 to T4 must be numbers");
  out.corners[card.integer(0, "number")] = t;
}

ShellSections nastran_sections(const std::string& path) {
  NastranCards cards(read_whole_file(path), path);
  NastranCard card;
  std::map<std::int64_t, ShellSection> properties;
  std::map<std::int64_t, double> offsets;  // of the elements of a property: a length
  ShellSections out;
  while (cards.next(card)) {
    if (card.name == "PSHELL" || card.name == "PCOMP") {
      const std::int64_t number = card.integer(0, "number");
      ShellSection& s = properties[number];
      s.set = fmt::format("property-{}", number);
      s.place = fmt::format("{}:{}", card.path, card.line);
      if (card.name == "PCOMP") {
        read_pcomp(card, s);
        continue;
      }
      if (!card.field(1).empty()) s.material = fmt::format("MAT1-{}", card.integer(1, "material"));
      s.thickness = card.real(2, "thickness", 0);
      read_rest_of_pshell(card, s);
    }
    if (!is_shell_card(card.name)) continue;
    const std::size_t at = card.name == "CQUAD4" || card.name == "CQUADR"   ? 7
                           : card.name == "CTRIA3" || card.name == "CTRIAR" ? 6
                           : card.name == "CQUAD8"                          ? 15
                                                                            : 9;
    const double offset = card.real(at, "ZOFFS", 0);
    const std::int64_t number = card.integer(1, "property", card.integer(0, "number"));
    read_corners(card, out);
    const auto [known, fresh] = offsets.emplace(number, offset);
    if (!fresh && known->second != offset)
      card.fail(
          fmt::format("ZOFFS {} differs from {} of the elements before it with the property {}; give them a "
                      "property of their own",
                      offset, known->second, number));
  }
  for (auto& [number, section] : properties) {
    if (const auto found = offsets.find(number); found != offsets.end() && section.thickness > 0)
      section.offset += found->second / section.thickness;
    if (offsets.contains(number)) out.list.push_back(std::move(section));
  }
  return out;
}

const MeshMaterial* material_named(const std::vector<MeshMaterial>& materials, const std::string& name) {
  for (const MeshMaterial& m : materials)
    if (same_word(m.name, name) && m.young > 0) return &m;
  return nullptr;
}

}  // namespace

std::pair<double, MeshMaterial> equivalent_layer(const ShellSection& section,
                                                 const std::vector<MeshMaterial>& materials) {
  constexpr double kAlike = 1e-9;
  const auto refuse = [&](const std::string& what) {
    throw Error(StatusCode::invalid_input,
                fmt::format("{}: layers {}: that is no section of our shells, which are of one isotropic material; {}",
                            section.place, what, kInstead));
  };
  double stretch = 0, couple = 0, bend = 0, mass = 0, z = -0.5 * section.thickness;
  MeshMaterial out;
  bool weighs = true;
  for (const ShellLayer& layer : section.layers) {
    const MeshMaterial* m = material_named(materials, layer.material);
    if (m == nullptr) refuse(fmt::format("of '{}', which has no Young's modulus (of one direction)", layer.material));
    if (out.young > 0 && std::abs(m->poisson - out.poisson) > kAlike) refuse("with different Poisson's ratios");
    out.young = m->young;
    out.poisson = m->poisson;
    weighs = weighs && m->density > 0;
    const double top = z + layer.thickness;
    stretch += m->young * layer.thickness;
    couple += m->young * (top * top - z * z) / 2;
    bend += m->young * (top * top * top - z * z * z) / 3;
    mass += m->density * layer.thickness;
    z = top;
  }
  if (std::abs(couple) > kAlike * stretch * section.thickness) refuse("that do not lie alike about the middle");
  const double thickness = std::sqrt(12 * bend / stretch);
  out.name = section.place;
  out.young = stretch / thickness;
  out.density = weighs ? mass / thickness : 0;
  return {thickness, out};
}

ShellSections read_shell_sections(const std::string& path) {
  std::string name = lower(path);
  if (name.ends_with(".gz")) name.resize(name.size() - 3);
  if (name.ends_with(".inp")) return inp_sections(path);
  if (name.ends_with(".bdf") || name.ends_with(".nas") || name.ends_with(".dat")) return nastran_sections(path);
  return {};
}

}  // namespace espalier::dynamics
