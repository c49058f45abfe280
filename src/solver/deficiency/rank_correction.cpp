#include "solver/deficiency/rank_correction.hpp"

#include "base/at.hpp"

namespace espalier::solver {

void RankCorrection::add(const solve::ResidualSpace& a, const double* b, double* x, Index columns,
                         bool transpose) const {
  const Offset n = to.rows;
  std::vector<double> rest(at(n));
  for (Index c = 0; c < columns; ++c, b += n, x += n) {
    solve::ResidualColumn column{b, x, rest.data(), {}};
    a.compute(std::span(&column, 1), transpose);
    for (Index d = 0; d < to.columns; ++d) {
      double part = 0;
      for (std::size_t k = 0; k < places.size(); ++k) part += from.column(d)[k] * rest[at(places[k])];
      const double* direction = to.column(d);
      for (Offset i = 0; i < n; ++i) x[i] += part * direction[i];
    }
  }
}

}  // namespace espalier::solver
