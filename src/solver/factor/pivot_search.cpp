#include "solver/factor/pivot_search.hpp"

#include <complex>
#include <type_traits>
#include <vector>

#include "base/scalar.hpp"
#include "solver/ranks/whole_plan.hpp"

namespace espalier::solver {

namespace {

device::PivotRule rule_of(Vanishing vanishing, double largest, const Context& context) {
  return {context.options.pivot_threshold, vanishing.smallest * largest, vanishing.parts ? largest : 0};
}

// The pivot moves of a real form. @param plan  the whole
std::optional<std::vector<analysis::PivotMove>> place_real_pivots(const Analysis& analysis, const plan::Plan& plan,
                                                                  const Scales& scales, std::span<const double> values,
                                                                  Vanishing vanishing, std::span<const Index> failed,
                                                                  const Context& context) {
  const System& s = *analysis.system;
  base::Buffer<std::complex<double>> numbers(s.prepared.a.nonzeros(), &context.budget);
  base::Buffer<double> scaled(s.factored_pattern().nonzeros(), &context.budget);
  const double largest = scale_values(s.prepared, scales, values, numbers.data(), context.pool);
  real_values(*s.real_form, s.prepared.a, numbers.data(), scaled.data(), context.pool);
  return context.registry.host().place_pivots(
      device::PlacementJob{plan,
                           analysis.kind(),
                           false,
                           rule_of(vanishing, largest, context),
                           {scaled.data(), static_cast<std::size_t>(scaled.size())},
                           context.pool,
                           &context.budget,
                           failed});
}

}  // namespace

std::optional<std::vector<analysis::PivotMove>> place_pivots(const Analysis& analysis, const Scales& scales,
                                                             std::span<const double> values,
                                                             std::span<const double> border_values, Vanishing vanishing,
                                                             std::span<const Index> failed, const Context& context) {
  const PreparedMatrix& p = analysis.system->prepared;
  const bool part = !analysis.plan.row_begin.empty();
  const plan::Plan whole = part ? whole_plan(analysis, context) : plan::Plan();
  const plan::Plan& plan = part ? whole : analysis.plan;
  std::optional<std::vector<analysis::PivotMove>> found;
  const auto search = [&](const auto* first) {
    using Value = std::remove_cv_t<std::remove_pointer_t<decltype(first)>>;
    base::Buffer<Value> scaled(p.a.nonzeros() + static_cast<Offset>(border_values.size()), &context.budget);
    const double largest =
        scale_values(p, scales, values, scaled.data(), context.pool, positions_for(p, plan.tree.order));
    if constexpr (!base::ScalarTraits<Value>::is_complex) {
      if (plan.tree.border > 0)
        (void)scale_border(*analysis.system->border, scales, border_values, scaled.data() + p.a.nonzeros());
    }
    const device::PivotRule rule = rule_of(vanishing, largest, context);
    const bool hermitian = p.numbers == base::Numbers::hermitian;
    const std::span<const Value> numbers(scaled.data(), static_cast<std::size_t>(scaled.size()));
    found = context.registry.host().place_pivots(device::PlacementJobOf<Value>{
        plan, analysis.kind(), hermitian, rule, numbers, context.pool, &context.budget, failed});
  };
  const auto run = [&] {
    if (analysis.system->real_form)
      found = place_real_pivots(analysis, plan, scales, values, vanishing, failed, context);
    else
      base::with_numbers(p.numbers, values.data(), search);
  };
  // What one rank has no memory for, none finds.
  if (context.link != nullptr)
    context.link->expect_all(run);
  else
    run();
  return found;
}

}  // namespace espalier::solver
