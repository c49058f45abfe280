/// \file
/// What this build is: for `espalier info`, the C interface and bug reports.
#pragma once

#include <string>
#include <vector>

namespace espalier::solver {

/// A library that the build links, with the version of the headers that it was compiled against.
struct LinkedLibrary {
  std::string name;
  std::string version;
};

/// Fixed when the library was compiled.
struct BuildInfo {
  std::string version;                ///< of espalier, "major.minor.patch"
  std::string build_type;             ///< "Release", "Debug", ...
  std::string compiler;               ///< name and version
  std::string flags;                  ///< the compiler's flags beyond those of the project
  std::string processor;              ///< "x86_64", ...
  std::string sanitizers;             ///< empty: none
  std::vector<std::string> backends;  ///< that are compiled in, as Options::device calls them
  std::vector<LinkedLibrary> libraries;
};

BuildInfo build_info();

/// The version alone, a string literal.
const char* version();

}  // namespace espalier::solver
