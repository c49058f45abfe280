/// \file
/// Mechanisms built from texts, and states anywhere, for tests below the runner.
#pragma once

#include <random>

#include "dynamics/dae/check.hpp"
#include "dynamics/model/mechanism.hpp"
#include "dynamics/model/model_common.hpp"
#include "dynamics/model/read/expand.hpp"

namespace espalier::dynamics {

inline std::unique_ptr<model::Mechanism> built(const std::string& text) {
  model::Value root = model::parse_toml(text, "model.toml");
  model::expand(root, {});
  return model::build(model::read_description(root, "model.toml"), 1);
}

/// The initial state, moved by up to `size` in every coordinate, with velocities, accelerations and multipliers in
/// [-1, 1].
inline State anywhere(model::Mechanism& mechanism, unsigned seed, double size) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  State s(mechanism.system.sizes());
  mechanism.system.initial(s.q, s.v);
  std::vector<double> step(s.v.size());
  for (double& x : step) x = size * uniform(engine);
  mechanism.system.retract(s.q, step, s.q);
  for (auto* part : {&s.v, &s.a, &s.lambda})
    for (double& x : *part) x = uniform(engine);
  s.t = 0.37;
  return s;
}

/// use(mechanism, what it is) for every model of the pages and of the examples with at most so many velocities.
template <class Use>
void for_each_small_model(Index most, const Use& use) {
  for (const auto& [file, text] : all_models()) {
    std::unique_ptr<model::Mechanism> mechanism;
    try {
      mechanism = built(text);
    } catch (const std::exception&) {
      continue;  // pieces of models, and those with files
    }
    if (mechanism->system.sizes().velocity <= most) use(*mechanism, file + ": " + text.substr(0, 80));
  }
}

}  // namespace espalier::dynamics
