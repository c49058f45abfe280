/// \file
/// Factors behind interfaces without handles (MA57, MA27): the host's arrays, which are all that it gives us again,
/// hold everything that a factor is made of. What is kept here is a cache: what has left it is made again.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "common/inertia_solver.hpp"

namespace espalier::hosts {

/// A matrix without its values, and the factor that was last made of it, as they stand in an integer array of the host.
struct KeptMatrix {
  std::int64_t id = 0;  ///< in the cache; 0: none yet
  int generation = 0;   ///< of the factorizations of this id
  int n = 0;
  int entries = 0;
  PivotWish wish;
  const int* rows = nullptr;  ///< `entries` coordinates, 1-based, of either triangle
  const int* columns = nullptr;
};

/// Integers that keep() writes.
std::int64_t kept_length(int entries);
/// @pre there is room for kept_length(m.entries) integers. m.rows and m.columns may already lie there.
void keep(const KeptMatrix& m, int* to);
/// What keep() has written; nothing for any other content of an array of `length` integers.
std::optional<KeptMatrix> kept(const int* from, std::int64_t length);

/// The id of a factor of the same pattern that stands in this array of the host, and whose place another one will take;
/// 0: there is none.
std::int64_t cached_id(const KeptMatrix& m, const int* in, std::int64_t length);
/// Factorizes; m.id and m.generation are those of the new factor. @param values  m.entries
Inertia factorize_cached(const std::string& interface, KeptMatrix& m, const double* values);
/// Solves with the factor that factorize_cached() has made of m and `values`, in place.
/// @returns an espalier_status
int solve_cached(const std::string& interface, const KeptMatrix& m, const double* values, double* x, int columns,
                 int stride);
/// The analysis that m's factor stands on; null where it has left the cache.
std::shared_ptr<const espalier_analysis_info> cached_analysis(const KeptMatrix& m);

}  // namespace espalier::hosts
