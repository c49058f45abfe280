/// \file
/// What is made of the numbers at a site: components, von Mises stress, principal values, fibres of beams.
#pragma once

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "dynamics/model/fields/sites.hpp"

namespace espalier::dynamics::model {

enum class Statistic { none, max, min, maxabs, mean };

/// At a site. Stress and strain: xx yy zz xy yz xz (strain.xy: half the shear angle). Sections of beams: N Qy Qz T My
/// Mz; of cables: N and the moment in global axes; of shells: nxx nyy nxy mxx myy mxy qx qy.
using SiteNumbers = std::array<double, 8>;

/// A function of them.
struct Measure {
  std::string name;
  std::function<double(const SiteNumbers&, const Site&)> value;
  bool linear = true;      ///< else it is a number without sign or direction, whose amplitude is its largest value
  bool quadratic = false;  ///< its square is a quadratic form
};

/// The measures of a tensor: xx ... xz, principal_1 (largest) to principal_3; of stress also von_mises, tresca,
/// pressure. Directions of principal values: direction_1.x to direction_3.z.
[[nodiscard]] std::vector<Measure> tensor_measures(bool stress);
/// The measures of sections.
[[nodiscard]] std::vector<Measure> section_measures(FieldBody kind);
/// The measures of stresses in beams and cables. @param statistic  without a fibre, of the outline of the section: its
/// largest, least or largest absolute value @throws std::invalid_argument where the model does not say what the section
/// is
[[nodiscard]] std::vector<Measure> fibre_measures(const SampledBody& body, Statistic statistic);

}  // namespace espalier::dynamics::model
