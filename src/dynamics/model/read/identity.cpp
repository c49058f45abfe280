#include "dynamics/model/read/identity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <set>

#include "base/checksum.hpp"
#include "dynamics/mesh/mesh.hpp"
#include "dynamics/model/read/value.hpp"

namespace espalier::dynamics::model {
namespace {

bool free_to_change(std::string_view path) {
  constexpr std::array<std::string_view, 7> kFree = {"output",        "solver",         "title",           "harmonic",
                                                     "initial.modes", "integrator.end", "integrator.steps"};
  return std::find(kFree.begin(), kFree.end(), path) != kFree.end() ||
         (path.starts_with("bodies.") && path.ends_with(".mesh.file")) ||
         (path.starts_with("splines.") && path.ends_with(".file"));
}

/// "; length = 2" for every name with a number that stands in an expression.
std::string named_numbers(const std::string& text, const Scope& scope) {
  const auto in_name = [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; };
  std::set<std::string> found;
  for (auto at = text.begin(); at != text.end();) {
    const auto end = std::find_if_not(at, text.end(), in_name);
    if (const std::string name(at, end); scope.contains(name)) found.insert(name);
    at = end == at ? at + 1 : end;
  }
  std::string result;
  for (const std::string& name : found) result += fmt::format("; {} = {}", name, scope.at(name));
  return result;
}

std::string scalar(const Value& value) {
  switch (value.type) {
    case Value::Type::boolean:
      return value.boolean ? "true" : "false";
    case Value::Type::text:
      return fmt::format("\"{}\"{}", value.text, value.scope ? named_numbers(value.text, *value.scope) : "");
    default:
      return fmt::format("{}", value.real);
  }
}

void collect(const Value& value, const std::string& path, ModelKeys& keys) {
  if (free_to_change(path)) return;
  if (value.is_table()) {
    for (const auto& [name, entry] : value.entries)
      collect(entry, path.empty() ? name : fmt::format("{}.{}", path, name), keys);
  } else if (value.type == Value::Type::array) {
    for (std::size_t k = 0; k < value.items.size(); ++k) collect(value.items[k], fmt::format("{}[{}]", path, k), keys);
  } else {
    keys.emplace_back(path, scalar(value));
  }
}

void add_text(base::Checksum& sum, const std::string& text) { sum.add_list<char>(text); }

template <class Sets>
void add_sets(base::Checksum& sum, const Sets& sets) {
  for (const auto& [name, members] : sets) {
    add_text(sum, name);
    sum.add_list<Index>(members);
  }
}

}  // namespace

ModelKeys model_keys(const Value& root) {
  ModelKeys keys;
  collect(root, "", keys);
  return keys;
}

std::string mesh_digest(const Mesh& mesh) {
  base::Checksum sum;
  for (const Point& p : mesh.nodes) sum.add_list<double>(p);
  for (Index e = 0; e < mesh.element_count(); ++e) {
    const std::uint64_t type = static_cast<std::uint64_t>(mesh.type(e));
    sum.add(&type, sizeof type);
    sum.add_list<Index>(mesh.element(e));
  }
  add_sets(sum, mesh.node_sets);
  add_sets(sum, mesh.element_sets);
  for (const auto& [name, faces] : mesh.face_sets) {
    add_text(sum, name);
    sum.add_list<MeshFace>(faces);
  }
  for (const MeshMaterial& m : mesh.materials) {
    add_text(sum, m.name);
    sum.add_list<double>(std::array{m.young, m.poisson, m.density});
  }
  for (const auto& [set, material] : mesh.section_material) {
    add_text(sum, set);
    add_text(sum, material);
  }
  return fmt::format("{:016x}", sum.value());
}

std::vector<std::string> differences(const ModelKeys& then, const ModelKeys& now) {
  const std::map<std::string, std::string> before(then.begin(), then.end()), here(now.begin(), now.end());
  std::vector<std::string> result;
  const auto shown = [](const std::string& text) { return text.size() > 60 ? text.substr(0, 60) + "..." : text; };
  for (const auto& [key, value] : now) {
    const auto old = before.find(key);
    if (old == before.end()) {
      result.push_back(fmt::format("{}: absent then, {} now", key, shown(value)));
    } else if (old->second != value) {
      result.push_back(fmt::format("{}: {} then, {} now", key, shown(old->second), shown(value)));
    }
  }
  for (const auto& [key, value] : then)
    if (!here.contains(key)) result.push_back(fmt::format("{}: {} then, absent now", key, shown(value)));
  return result;
}

}  // namespace espalier::dynamics::model
