#include "espalier/modes.hpp"

#include <fmt/format.h>

#include "base/stopwatch.hpp"
#include "modes/search.hpp"

namespace espalier {

namespace {

void check_pair(const SparseMatrix& k, const SparseMatrix& m, const char* second) {
  if (k.rows != m.rows)
    throw Error(StatusCode::invalid_input, fmt::format("K is {} x {}, {} is {} x {}; they must be of one size", k.rows,
                                                       k.cols, second, m.rows, m.cols));
}

}  // namespace

ModesResult find_modes(const MatrixView& k, const MatrixView& m, const ModesOptions& options) {
  ModesResult result;
  const base::Stopwatch watch(result.seconds.total);
  modes::Workshop shop(options.solver);
  std::optional<modes::Search> search;
  result.status = modes::guarded(shop, [&] {
    modes::check_options(options);
    SparseMatrix k_lower = modes::symmetric_lower(k, "K", shop.pool),
                 m_lower = modes::symmetric_lower(m, "M", shop.pool);
    check_pair(k_lower, m_lower, "M");
    search.emplace(std::move(k_lower), std::move(m_lower), options, shop, result);
    search->run();
  });
  if (!search) return result;
  // What was found serves the caller, too, where some are missing.
  const Status end = modes::guarded(shop, [&] { search->deliver(); });
  if (result.status.ok()) result.status = end;
  return result;
}

}  // namespace espalier
