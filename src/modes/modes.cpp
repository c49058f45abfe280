#include "espalier/modes.hpp"

#include <fmt/format.h>

#include <optional>

#include "base/stopwatch.hpp"
#include "modes/buckling.hpp"
#include "modes/search.hpp"

namespace espalier {

namespace {

// A search of either kind, from the matrices of the caller to the result.
template <class Search>
ModesResult found_by(const MatrixView& k, const MatrixView& m, const char* second, const ModesOptions& options) {
  ModesResult result;
  const base::Stopwatch watch(result.seconds.total);
  modes::Resources shop(options.solver);
  std::optional<Search> search;
  result.status = modes::guarded(shop, [&] {
    modes::check_options(options);
    SparseMatrix k_lower = modes::symmetric_lower(k, "K", shop.pool);
    SparseMatrix m_lower = modes::symmetric_lower(m, second, shop.pool);
    if (k.rows != m.rows)
      throw Error(StatusCode::invalid_input, fmt::format("K is {} x {}, {} is {} x {}; they must be of one size",
                                                         k.rows, k.cols, second, m.rows, m.cols));
    search.emplace(std::move(k_lower), std::move(m_lower), options, shop, result);
    search->run();
  });
  if (!search) return result;
  // What was found serves the caller, too, where some are missing.
  const Status end = modes::guarded(shop, [&] { search->deliver(); });
  if (!end.ok())  // modes without their vectors or residuals serve nobody
    for (auto* part : {&result.eigenvalues, &result.vectors, &result.residuals, &result.error_bounds}) part->clear();
  if (result.status.ok()) result.status = end;
  if (!result.status.ok()) result.complete = false;
  return result;
}

}  // namespace

ModesResult find_modes(const MatrixView& k, const MatrixView& m, const ModesOptions& options) {
  return found_by<modes::Search>(k, m, "M", options);
}

ModesResult find_buckling_modes(const MatrixView& k, const MatrixView& kg, const ModesOptions& options) {
  return found_by<modes::BucklingSearch>(k, kg, "Kg", options);
}

}  // namespace espalier
