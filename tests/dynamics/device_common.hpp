/// \file
/// What tests of bodies on a GPU share.
#pragma once

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "dynamics/model/expand.hpp"
#include "dynamics/model/mechanism.hpp"
#include "places.hpp"

namespace espalier::dynamics::test {

/// A model of models/ with other numbers.
inline std::unique_ptr<model::Mechanism> built_from(const std::string& name, const std::vector<std::string>& overrides,
                                                    int threads) {
  std::ifstream file(espalier::test::source_folder() / "models" / name);
  std::stringstream text;
  text << file.rdbuf();
  model::Value root = model::parse_toml(text.str(), name);
  model::expand(root, overrides);
  return model::build(model::read_description(root, name), threads);
}

/// The largest |a_i - b_i| over the largest |b_i|; a NaN gets through.
inline double difference(ConstSpan a, ConstSpan b) {
  double worst = 0, largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = std::abs(a[i] - b[i]);
    if (!(d <= worst)) worst = d;
    largest = std::max(largest, std::abs(b[i]));
  }
  return worst / std::max(largest, 1e-300);
}

}  // namespace espalier::dynamics::test
