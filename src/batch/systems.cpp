// Many systems of any patterns.
#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "base/at.hpp"
#include "base/stopwatch.hpp"
#include "batch/alone.hpp"
#include "batch/groups.hpp"
#include "solver/session/session.hpp"

namespace espalier {

namespace {

void check_sizes(std::span<const System> systems) {
  for (std::size_t k = 0; k < systems.size(); ++k) {
    const System& s = systems[k];
    const std::size_t size = at(std::max<Index>(0, s.a.cols)) * at(std::max<Index>(0, s.columns));
    if (s.columns < 1 || s.b.size() != size || s.x.size() != size)
      throw std::invalid_argument(fmt::format(
          "solve_systems: system {} has {} columns and {} right-hand sides: b and x need {} numbers, they have "
          "{} and {}",
          k, s.a.cols, s.columns, size, s.b.size(), s.x.size()));
  }
}

}  // namespace

BatchResult solve_systems(std::span<const System> systems, const Options& options) {
  check_sizes(systems);
  const double start = base::now_seconds();
  solver::Session session(options);  // threads, and the caller's wish to stop
  return batch::carry_out(session, start, [&](BatchResult& result) {
    const bool groups = systems.size() > 1 && batch::Groups::serve(options, session.context.registry);
    result.systems.resize(systems.size());
    std::vector<Index> all(systems.size());
    std::iota(all.begin(), all.end(), 0);
    result.workers = groups ? batch::Groups(session).solve(systems, result.systems)
                            : batch::solve_on_threads(session, systems, all, session.pool.size(), result.systems);
  });
}

}  // namespace espalier
