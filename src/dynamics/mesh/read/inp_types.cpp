#include "dynamics/mesh/read/inp_types.hpp"

#include <algorithm>
#include <string_view>

namespace espalier::dynamics {
namespace {

struct InpType {
  std::string_view name;
  ElementType type;
};
// A type matches when its name is this, or this followed by letters (R: reduced, I: incompatible, H: hybrid, M, T ...),
// or by a 5 (shells with five unknowns a node).
constexpr InpType kTypes[] = {
    {"C3D4", ElementType::tet4},     {"C3D10", ElementType::tet10}, {"C3D8", ElementType::hex8},
    {"C3D20", ElementType::hex20},   {"C3D6", ElementType::wedge6}, {"C3D15", ElementType::wedge15},
    {"C3D5", ElementType::pyramid5}, {"CSS8", ElementType::hex8},   {"SC8", ElementType::hex8},
    {"SC6", ElementType::wedge6},    {"S3", ElementType::tri3},     {"S4", ElementType::quad4},
    {"S6", ElementType::tri6},       {"S8", ElementType::quad8},    {"STRI3", ElementType::tri3},
    {"STRI65", ElementType::tri6},   {"M3D3", ElementType::tri3},   {"M3D4", ElementType::quad4},
    {"M3D6", ElementType::tri6},     {"M3D8", ElementType::quad8},  {"SFM3D3", ElementType::tri3},
    {"SFM3D4", ElementType::quad4},  {"SFM3D6", ElementType::tri6}, {"SFM3D8", ElementType::quad8},
    {"CPS3", ElementType::tri3},     {"CPS4", ElementType::quad4},  {"CPS6", ElementType::tri6},
    {"CPS8", ElementType::quad8},    {"CPE3", ElementType::tri3},   {"CPE4", ElementType::quad4},
    {"CPE6", ElementType::tri6},     {"CPE8", ElementType::quad8},  {"CAX3", ElementType::tri3},
    {"CAX4", ElementType::quad4},    {"CAX6", ElementType::tri6},   {"CAX8", ElementType::quad8},
    {"B31", ElementType::line2},     {"B32", ElementType::line3},   {"B33", ElementType::line2},
    {"T3D2", ElementType::line2},    {"T3D3", ElementType::line3}};

bool are_letters(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c >= 'A' && c <= 'Z'; });
}

}  // namespace

std::optional<ElementType> inp_shape(const std::string& name) {
  for (const InpType& t : kTypes) {
    if (!name.starts_with(t.name)) continue;
    std::string_view rest = std::string_view(name).substr(t.name.size());
    if (t.name.front() == 'S' && rest == "R5") return t.type;
    if (t.type == ElementType::wedge15 && rest.starts_with('V')) continue;  // 15 to 18 nodes
    if (are_letters(rest)) return t.type;
  }
  return std::nullopt;
}

bool is_unknown_inp_solid(const std::string& name) { return name.starts_with("C3D") && !inp_shape(name); }

bool is_inp_solid_shell(const std::string& name) { return name.starts_with("CSS8") || name.starts_with("SC"); }

bool is_idle_inp_keyword(const std::string& name) {
  static constexpr std::string_view kIdle[] = {
      "*HEADING",           "*PREPRINT",     "*ASSEMBLY",    "*ENDASSEMBLY",   "*ENDPART",       "*ENDINSTANCE",
      "*ENDSTEP",           "*RESTART",      "*OUTPUT",      "*NODEOUTPUT",    "*ELEMENTOUTPUT", "*NODEPRINT",
      "*NODEFILE",          "*ELPRINT",      "*ELFILE",      "*CONTACTOUTPUT", "*ENERGYPRINT",   "*ENERGYFILE",
      "*ENERGYOUTPUT",      "*CONTACTPRINT", "*CONTACTFILE", "*FILEFORMAT",    "*MONITOR",       "*NODALTHICKNESS",
      "*BEAMGENERALSECTION"};  // read where shells and beams are made of the mesh
  return std::find(std::begin(kIdle), std::end(kIdle), name) != std::end(kIdle);
}

}  // namespace espalier::dynamics
