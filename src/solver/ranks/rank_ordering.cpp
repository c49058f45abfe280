#include "solver/ranks/rank_ordering.hpp"

#include <vector>

#include "ranks/first_rank.hpp"
#include "ranks/packing.hpp"

namespace espalier::solver {

namespace {

using analysis::AssemblyTree;

template <class Tree, class Use>
void each_part(Tree& t, Use&& use) {
  use(t.n);
  use(t.border);
  use(t.order);
  use(t.first);
  use(t.parent);
  use(t.row_ptr);
  use(t.rows);
}

}  // namespace

AssemblyTree ordered_once(const Context& context, const std::function<AssemblyTree(base::ThreadPool& pool)>& build) {
  if (context.link == nullptr) return build(context.pool);
  ranks::Communicator& link = *context.link;
  AssemblyTree tree;
  ranks::by_first_rank(link, context.pool, [&] {
    ranks::FirstRankPool threads(link, context.pool);
    tree = build(threads.get());
  });
  ranks::Packer packer;
  if (link.rank() == 0) each_part(tree, [&](const auto& part) { packer.pack(part); });
  const std::vector<std::byte> bytes = ranks::from_first_rank(link, packer.bytes());
  if (link.rank() == 0) return tree;
  ranks::Unpacker unpacker(bytes);
  each_part(tree, [&](auto& part) { unpacker.get(part); });
  return tree;
}

}  // namespace espalier::solver
