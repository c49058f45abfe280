/// \file
/// Elements of beams and cables as lines between nodes.
#pragma once

#include <array>
#include <vector>

#include "dynamics/model/mechanism.hpp"

namespace espalier::dynamics::model {

struct LineElement {
  std::array<Index, 2> nodes{};
  double length = 0;  ///< of the unstressed axis between them
};
/// The chains of beams and cables; of other bodies none.
[[nodiscard]] std::vector<LineChain> line_chains(const BuiltBody& body);
[[nodiscard]] BeamSpec::ChainSection section_of_chain(const BeamSpec& beam, const LineChain& chain);
[[nodiscard]] CableSection section_of_chain(const CableSpec& cable, const LineChain& chain);
/// The elements of beams and cables, in the order of their elements; of other bodies none.
[[nodiscard]] std::vector<LineElement> line_elements(const BuiltBody& body);

}  // namespace espalier::dynamics::model
