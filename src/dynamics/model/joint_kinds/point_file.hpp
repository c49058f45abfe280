/// \file
/// Points in space from a text file.
#pragma once

#include <string>
#include <vector>

#include "dynamics/dae/frame.hpp"

namespace espalier::dynamics::model {

/// One point a line, three numbers apart by commas, semicolons, tabs or blanks; a first line of names, empty lines and
/// those that begin with # are passed over. @throws Error(invalid_input) "file:line: what is wrong"
[[nodiscard]] std::vector<Vec3> read_point_file(const std::string& path);
/// For the restart file: what a file held counts, not how it is called.
[[nodiscard]] std::string points_digest(const std::vector<Vec3>& points);

}  // namespace espalier::dynamics::model
