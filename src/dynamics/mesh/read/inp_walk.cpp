#include "dynamics/mesh/read/inp_walk.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "dynamics/mesh/file_source.hpp"

namespace espalier::dynamics {
namespace {

void walk(LineReader& reader, int depth, const std::function<void(LineReader&, const InpKeyword&)>& take) {
  constexpr int kDeepest = 16;
  if (depth > kDeepest) reader.fail("files include one another more than 16 deep");
  std::string_view line;
  while (reader.next(line)) {
    if (is_inp_comment(line) || !trim(line).starts_with('*')) continue;
    const InpKeyword keyword = read_inp_keyword(reader, line);
    take(reader, keyword);
    if (keyword.name != "*INCLUDE") continue;
    const std::string path =
        (std::filesystem::path(reader.path()).parent_path() / keyword.need(reader, "INPUT")).string();
    if (!file_exists(path) || std::filesystem::is_directory(path))
      reader.fail(fmt::format("*INCLUDE: there is no file '{}'", path));
    LineReader inner(path, read_whole_file(path));
    walk(inner, depth + 1, take);
  }
}

}  // namespace

void walk_inp(const std::string& path, const std::function<void(LineReader&, const InpKeyword&)>& take) {
  LineReader reader(path, read_whole_file(path));
  walk(reader, 0, take);
}

void InpInstances::take(const InpKeyword& keyword) {
  if (keyword.name == "*PART") part_ = upper(keyword.get("NAME"));
  if (keyword.name == "*ENDPART") part_.clear();
  if (keyword.name == "*INSTANCE") instances_.emplace(upper(keyword.get("PART")), keyword.get("NAME"));
}

std::vector<std::string> InpInstances::names(const std::string& part, const std::string& set) const {
  std::vector<std::string> out;
  for (auto [it, end] = instances_.equal_range(part); it != end; ++it) out.push_back(it->second + "." + set);
  return out;
}

}  // namespace espalier::dynamics
