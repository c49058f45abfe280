#include "plan/reached_fronts.hpp"

#include "plan/front_cost.hpp"

namespace espalier::plan {

double share_of_work(const Plan& plan, std::span<const char> fronts) {
  double some = 0, all = 0;
  for (Index f = 0; f < plan.fronts(); ++f) {
    const FrontLayout& l = plan.layout[at(f)];
    const double flops = front_flops(l.pivots, l.rows, plan.options.unsymmetric);
    all += flops;
    if (fronts[at(f)] != 0) some += flops;
  }
  return all > 0 ? some / all : 1;
}

}  // namespace espalier::plan
