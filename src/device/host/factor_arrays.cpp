#include "device/host/factor_arrays.hpp"

#include <fmt/format.h>

#include <type_traits>
#include <utility>
#include <vector>

#include "base/checksum.hpp"

namespace espalier::device::host {

namespace {

template <class List>
void visit_list(List&& list, Offset size, const ArrayVisit& visit) {
  if (size > 0) visit({reinterpret_cast<std::byte*>(list), static_cast<std::size_t>(size) * sizeof(*list)});
}

[[noreturn]] void refuse_arrays(const char* what) {
  throw Error(StatusCode::invalid_input,
              fmt::format("what was read is no factor: {}; factorize the matrix and save it again", what));
}

}  // namespace

template <class T>
std::uint64_t layout_of_arrays(const NumericState<T>& state) {
  const plan::Plan& plan = state.plan;
  std::vector<std::int64_t> words{plan.tree.n, static_cast<std::int64_t>(state.kind), state.hermitian ? 1 : 0,
                                  static_cast<std::int64_t>(plan.options.tiles.panel)};
  for (Index f = 0; f < plan.fronts(); ++f) {
    const plan::FrontLayout& l = plan.layout[f];
    for (const Index x : {plan.tree.first[f], l.tiles, l.pivot_tiles, l.pivots, l.rows}) words.push_back(x);
    words.push_back(l.factor_size());
    for (Index j = 0; j < l.tiles; ++j) words.push_back(l.width(j));
  }
  base::Checksum sum;
  sum.add_list(std::span<const std::int64_t>(words));
  // Fronts of the same sizes may have other unknowns: those of pivots that were moved.
  sum.add_list(std::span(plan.tree.order));
  sum.add_list(std::span(plan.tree.parent));
  sum.add_list(std::span(plan.tree.rows));
  return sum.value() | 1;
}

template <class T>
void visit_arrays(NumericState<T>& state, const ArrayVisit& visit) {
  static_assert(std::is_trivially_copyable_v<FrontOutcome>);
  for (Index f = 0; f < state.plan.fronts(); ++f) {
    const Offset size = state.plan.layout[f].factor_size();
    visit_list(state.factor(f), size, visit);
    if (state.kind == Kind::lu) visit_list(state.factor2(f), size, visit);
  }
  visit_list(state.pivot_order.data(), state.pivot_order.size(), visit);
  visit_list(state.d_inverse.data(), state.d_inverse.size(), visit);
  visit_list(state.e_inverse.data(), state.e_inverse.size(), visit);
  visit_list(state.column_state.data(), static_cast<Offset>(state.column_state.size()), visit);
  visit_list(state.fronts.data(), static_cast<Offset>(state.fronts.size()), visit);
}

template <class T>
void expect_factor(const NumericState<T>& state) {
  const plan::Plan& plan = state.plan;
  std::vector<char> seen;
  for (Index f = 0; f < plan.fronts(); ++f) {
    const plan::FrontLayout& l = plan.layout[f];
    for (Index j = 0; j < l.pivot_tiles; ++j) {
      const Offset at = plan.tree.first[f] + l.begin(j);
      const Index n = l.width(j);
      if (state.kind != Kind::llt) {
        seen.assign(static_cast<std::size_t>(n), 0);
        for (Index k = 0; k < n; ++k) {
          const std::int32_t row = state.pivot_order[at + k];
          if (row < 0 || row >= n || std::exchange(seen[static_cast<std::size_t>(row)], 1) != 0)
            refuse_arrays("the order of pivots in a tile is no permutation");
        }
      }
      if (state.kind == Kind::ldlt && n > 0 && state.e_inverse[at + n - 1] != T(0))
        refuse_arrays("a 2 x 2 pivot leaves its tile");
    }
    const Index position = state.fronts[static_cast<std::size_t>(f)].not_positive;
    if (position < -1 || position >= plan.tree.n) refuse_arrays("a pivot stands outside of the matrix");
  }
}

#define ESPALIER_INSTANTIATE(T)                                    \
  template std::uint64_t layout_of_arrays(const NumericState<T>&); \
  template void visit_arrays(NumericState<T>&, const ArrayVisit&); \
  template void expect_factor(const NumericState<T>&);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host
