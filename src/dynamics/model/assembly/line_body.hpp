/// \file
/// Beams and bars of mesh files.
#pragma once

#include <memory>

#include "dynamics/model/build/builders.hpp"

namespace espalier::dynamics::model {

/// The file of a beam or cable; null: it is given by its dimensions.
[[nodiscard]] const LineFile* line_file(const BuiltBody& body);

/// Makes the body and fills in what its spec leaves to the file: nodes, sets, chains, sections.
/// @param statics  without a density, too
/// @throws Error(invalid_input), std::invalid_argument
[[nodiscard]] std::unique_ptr<FlexibleBody> make_lines(const BodySpec& spec, bool statics, BuiltBody& out);

/// Joins the chains, once the body is in the system: beams are welded to each other, bars hold each other's places.
void join_lines(const BuiltBody& body, Mechanism& out);

}  // namespace espalier::dynamics::model
