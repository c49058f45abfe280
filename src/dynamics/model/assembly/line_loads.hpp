/// \file
/// The lines that loads per length act on: edges of shells, beams, cables.
#pragma once

#include <vector>

#include "dynamics/forces/line_load.hpp"
#include "dynamics/model/build/builders.hpp"

namespace espalier::dynamics::model {

/// Points for integration, exact for even loads on straight elements. @param where  nodes of the line; of beams and
/// cables none: all of it @param element_set  of beams and cables of files: these elements alone; empty: all
/// @throws std::invalid_argument where there is no line
[[nodiscard]] std::vector<LoadedPoint> points_of_line(const MarkerSpec& where, const std::string& element_set,
                                                      const BuiltBody& body, const FrameBuilder& frames);

}  // namespace espalier::dynamics::model
