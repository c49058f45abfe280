#include "solver/ranks/whole_plan.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "plan/rank_parts.hpp"

namespace espalier::solver {

analysis::AssemblyTree whole_tree(const plan::Plan& plan, ranks::Communicator* link) {
  analysis::AssemblyTree tree = plan.tree;
  if (plan.row_begin.empty()) return tree;
  std::vector<Index> mine;
  for (Index f = 0; f < plan.fronts(); ++f)
    if (plan::first_keeper(plan, f) == link->rank())
      mine.insert(mine.end(), plan.rows_below(f), plan.rows_below(f) + plan.layout[at(f)].below());
  const auto parts = link->all_gather_of(std::span<const Index>(mine));
  tree.rows.resize(at(tree.row_ptr.back()));
  std::vector<std::vector<Index>::const_iterator> next;
  for (const std::vector<Index>& part : parts) next.push_back(part.begin());
  for (Index f = 0; f < plan.fronts(); ++f) {
    auto& from = next[at(plan::first_keeper(plan, f))];
    std::copy_n(from, tree.rows_below(f), tree.rows.begin() + tree.row_ptr[at(f)]);
    from += tree.rows_below(f);
  }
  return tree;
}

plan::Plan whole_plan(const Analysis& analysis, const Context& context) {
  plan::PlanOptions options = analysis.plan.options;
  options.devices = options.ranks = 1;
  options.rank = 0;
  const System& system = *analysis.system;
  const matrix::RowIndex* rows = system.real_form ? &system.real_form->rows : system.all_rows();
  return plan::make_plan(whole_tree(analysis.plan, context.link), system.factored_pattern(),
                         system.factored_row_of_col(), options, context.pool, rows);
}

}  // namespace espalier::solver
