#include "batch/equal_patterns.hpp"

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <tuple>

#include "base/at.hpp"
#include "matrix/validate.hpp"
#include "solver/analysis/analysis_file.hpp"

namespace espalier::batch {

namespace {

// Nothing: not valid, or the values decide on the kind.
std::optional<std::uint64_t> hash_of(const MatrixView& a, Kind kind, base::ThreadPool& alone) {
  if (kind == Kind::automatic && !a.symmetric()) return std::nullopt;
  try {
    matrix::validate(a);
  } catch (const Error&) {
    return std::nullopt;
  }
  if (a.values.empty()) return std::nullopt;
  return solver::pattern_hash(a, alone);
}

bool same(const MatrixView& a, const MatrixView& b) {
  return a.rows == b.rows && a.cols == b.cols && a.storage == b.storage &&
         std::equal(a.col_ptr.begin(), a.col_ptr.end(), b.col_ptr.begin(), b.col_ptr.end()) &&
         std::equal(a.row_ind.begin(), a.row_ind.end(), b.row_ind.begin(), b.row_ind.end());
}

}  // namespace

std::vector<std::vector<Index>> equal_patterns(std::span<const System> systems, Kind kind, std::size_t least,
                                               base::ThreadPool& pool) {
  std::vector<std::optional<std::uint64_t>> hashes(systems.size());
  pool.for_each_range(std::ssize(systems), 16, [&](std::int64_t begin, std::int64_t end) {
    base::ThreadPool alone(1);
    for (auto k = at(begin); k < at(end); ++k) hashes[k] = hash_of(systems[k].a, kind, alone);
  });
  std::map<std::tuple<std::uint64_t, Index, bool>, std::vector<Index>> lists;
  for (std::size_t k = 0; k < systems.size(); ++k)
    if (hashes[k])
      lists[{*hashes[k], systems[k].columns, systems[k].transpose != Transpose::no}].push_back(static_cast<Index>(k));
  std::vector<std::vector<Index>> found;
  for (auto& [key, list] : lists) {
    const MatrixView& first = systems[at(list.front())].a;
    std::erase_if(list, [&](Index k) { return !same(first, systems[at(k)].a); });
    if (list.size() >= least) found.push_back(std::move(list));
  }
  std::sort(found.begin(), found.end());
  return found;
}

}  // namespace espalier::batch
