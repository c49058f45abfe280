#include "dynamics/mesh/shell_sections.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <optional>

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
  const double value = std::strtod(text.c_str(), &end);
  if (*end != '\0' || !std::isfinite(value))
    reader.fail(fmt::format("OFFSET={} must be a number of thicknesses, SPOS or SNEG", text));
  return 0.0 - value;
}

constexpr const char* kInstead = "give the body's 'thickness', 'material' and 'offset' in the model instead";

std::vector<ShellSection> inp_sections(const std::string& path) {
  std::vector<ShellSection> out;
  std::vector<std::string> parts;  // of each section
  InpInstances instances;
  walk_inp(path, [&](LineReader& reader, const InpKeyword& keyword) {
    instances.take(keyword);
    if (keyword.name != "*SHELLSECTION") return;
    ShellSection section{keyword.need(reader, "ELSET"), keyword.get("MATERIAL"), 0, inp_offset(reader, keyword)};
    for (const char* other : {"COMPOSITE", "NODALTHICKNESS"})
      if (keyword.has(other))
        section.fault =
            fmt::format("{}:{}: *SHELL SECTION, {} is not read; {}", reader.path(), reader.line(), other, kInstead);
    std::string_view data;
    if (section.fault.empty() && next_inp_data(reader, data)) {
      Fields fields(reader, data, ',');
      section.thickness = fields.real("thickness");
    }
    if (section.fault.empty() && !(section.thickness > 0)) reader.fail("*SHELL SECTION needs a thickness above 0");
    out.push_back(std::move(section));
    parts.push_back(instances.part());
  });
  for (std::size_t k = 0; k < parts.size(); ++k)
    for (const std::string& name : instances.names(parts[k], out[k].set)) {
      out.push_back(out[k]);
      out.back().set = name;
    }
  return out;
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

std::vector<ShellSection> nastran_sections(const std::string& path) {
  NastranCards cards(read_whole_file(path), path);
  NastranCard card;
  std::map<std::int64_t, ShellSection> properties;
  std::map<std::int64_t, double> offsets;      // of the elements of a property: a length
  std::map<std::int64_t, std::string> faults;  // of elements, by property
  while (cards.next(card)) {
    if (card.name == "PSHELL") {
      const std::int64_t number = card.integer(0, "number");
      ShellSection& s = properties[number];
      s.set = fmt::format("property-{}", number);
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
    for (const std::size_t k : {10, 11, 12, 13})
      if (!card.field(k).empty())
        faults.emplace(number, fmt::format("{}:{}: {}: thicknesses at its nodes (T1 to T4) are not read; {}", card.path,
                                           card.line, card.name, kInstead));
    const auto [known, fresh] = offsets.emplace(number, offset);
    if (!fresh && known->second != offset)
      card.fail(
          fmt::format("ZOFFS {} differs from {} of the elements before it with the property {}; give them a "
                      "property of their own",
                      offset, known->second, number));
  }
  std::vector<ShellSection> out;
  for (auto& [number, section] : properties) {
    if (const auto found = offsets.find(number); found != offsets.end() && section.thickness > 0)
      section.offset = found->second / section.thickness;
    if (const auto found = faults.find(number); found != faults.end()) section.fault = found->second;
    if (offsets.contains(number)) out.push_back(std::move(section));
  }
  return out;
}

}  // namespace

std::vector<ShellSection> read_shell_sections(const std::string& path) {
  std::string name = lower(path);
  if (name.ends_with(".gz")) name.resize(name.size() - 3);
  if (name.ends_with(".inp")) return inp_sections(path);
  if (name.ends_with(".bdf") || name.ends_with(".nas") || name.ends_with(".dat")) return nastran_sections(path);
  return {};
}

}  // namespace espalier::dynamics
