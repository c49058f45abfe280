#include "experiments/fit.hpp"

#include <cmath>
#include <set>

namespace espalier::bench {

PowerLaw fit_power_law(const std::vector<double>& x, const std::vector<double>& y) {
  PowerLaw law;
  law.points = static_cast<int>(std::set<double>(x.begin(), x.end()).size());
  if (law.points < 2) return law;
  const auto count = static_cast<double>(x.size());
  double mean_x = 0, mean_y = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    mean_x += std::log(x[k]) / count;
    mean_y += std::log(y[k]) / count;
  }
  double xx = 0, xy = 0, yy = 0;
  for (std::size_t k = 0; k < x.size(); ++k) {
    const double u = std::log(x[k]) - mean_x, v = std::log(y[k]) - mean_y;
    xx += u * u;
    xy += u * v;
    yy += v * v;
  }
  law.exponent = xy / xx;
  law.factor = std::exp(mean_y - law.exponent * mean_x);
  law.r_squared = yy > 0 ? xy * xy / (xx * yy) : 1;
  return law;
}

}  // namespace espalier::bench
