#include "dynamics/model/frames/labels.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>

#include "dynamics/model/assembly/line_body.hpp"

namespace espalier::dynamics::model {
namespace {

using Labelled = std::vector<std::pair<std::int64_t, Index>>;

std::int64_t label_of(const BuiltBody& body, Index node) {
  if (const auto* substructure = std::get_if<SubstructureSpec>(&body.spec.shape))
    return substructure->nodes[at(node)].label;
  const Mesh* mesh = named_mesh(body);
  return mesh != nullptr ? mesh->node_label(node) : std::int64_t{node} + 1;
}

/// From 1 on, as grids and lines are.
bool is_counted(const BuiltBody& body) {
  const auto* shell = std::get_if<ShellSpec>(&body.spec.shape);
  return !body.mesh && !std::holds_alternative<SubstructureSpec>(body.spec.shape) &&
         (shell == nullptr || !shell->file) && line_file(body) == nullptr;
}

/// Sorted by labels.
Labelled labels_of(const BuiltBody& body) {
  Labelled all;
  for (Index k = 0; k < body.flexible->nodes(); ++k) all.emplace_back(label_of(body, k), k);
  std::sort(all.begin(), all.end());
  return all;
}

[[noreturn]] void no_such_node(const BuiltBody& body, const Labelled& all, Labelled::const_iterator next,
                               std::int64_t label) {
  constexpr std::ptrdiff_t kBefore = 2, kShown = 4;
  auto from = next - std::min(kBefore, next - all.begin());
  from -= std::min(from - all.begin(), std::max<std::ptrdiff_t>(0, kShown - (all.end() - from)));
  std::vector<std::int64_t> near;
  for (auto it = from; it != all.end() && it - from < kShown; ++it) near.push_back(it->first);
  const bool numbered = is_counted(body);
  throw std::invalid_argument(
      fmt::format("'{}' has no node {}: its {} nodes are {} {} to {}{}", body.spec.name, label, all.size(),
                  numbered ? "numbered" : "labelled", all.front().first, all.back().first,
                  numbered ? " (-1: the last)" : fmt::format(", the nearest labels are {}", fmt::join(near, ", "))));
}

}  // namespace

const Mesh* named_mesh(const BuiltBody& body) {
  if (const auto* shell = std::get_if<ShellSpec>(&body.spec.shape)) return shell->mesh.get();
  if (const LineFile* lines = line_file(body)) return lines->mesh.get();
  return body.mesh.get();
}

std::vector<Index> nodes_labelled(const BuiltBody& body, const std::vector<std::int64_t>& labels) {
  const bool counted = is_counted(body);
  const Index last = body.flexible->nodes();
  if (labels.size() == 1) {  // one way through them is less than to sort them
    const std::int64_t label = counted && labels[0] == -1 ? last : labels[0];
    for (Index k = 0; k < last; ++k)
      if (label_of(body, k) == label) return {k};
  }
  const Labelled all = labels_of(body);
  std::vector<Index> nodes;
  for (std::int64_t label : labels) {
    if (counted && label == -1) label = last;
    const auto found = std::lower_bound(all.begin(), all.end(), std::pair{label, Index{0}});
    if (found == all.end() || found->first != label) no_such_node(body, all, found, label);
    nodes.push_back(found->second);
  }
  return nodes;
}

std::vector<double> weights_labelled(const BuiltBody& body, const std::vector<std::int64_t>& labels,
                                     const std::vector<double>& weights) {
  const std::vector<Index> nodes = nodes_labelled(body, labels);
  std::map<Index, double> sums;
  for (std::size_t k = 0; k < nodes.size(); ++k) sums[nodes[k]] += weights[k];
  std::vector<double> out;
  for (const auto& [node, sum] : sums) out.push_back(sum);
  return out;
}

}  // namespace espalier::dynamics::model
