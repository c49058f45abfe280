/// \file
/// Models as functional mock-up units (FMI 2.0 and 3.0, fmi-standard.org), for other simulators (docs/guide/fmi.md).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "espalier/types.hpp"

namespace espalier {

struct FmuOptions {
  int version = 3;                   ///< of the standard: 2 or 3
  std::vector<std::string> inputs;   ///< of the model's [inputs]; empty: all of them
  std::vector<std::string> outputs;  ///< quantities; empty: those of the model's [output]
  /// Numbers of the model by their paths ("parameters.length", "bodies.bob.mass"), or names of [parameters]; empty: all
  /// plain numbers of [parameters].
  std::vector<std::string> parameters;
  std::vector<std::string> set;  ///< values of the model text to be replaced, for good
  /// The library that the FMU gets, espalier_fmu.so; empty: it is looked for beside this program and in the library
  /// folder of the installation.
  std::string library;
};

/// A variable of an exported FMU.
struct FmuVariable {
  std::string name;
  std::string kind;  ///< "time", "input", "output", "parameter", "state" or "derivative"
  std::string unit;  ///< empty: unknown
  double start = 0;
};

struct FmuResult {
  Status status;
  std::string path;         ///< that was written
  std::uint64_t bytes = 0;  ///< its size
  std::vector<FmuVariable> variables;
  std::vector<std::string> files;  ///< of the model, which the FMU holds
  bool model_exchange = false;     ///< beside co-simulation
  std::string no_model_exchange;   ///< why not
};

/// Writes an FMU of a model that moves. @param path ".fmu" is added where it has no such end; a file that is there is
/// replaced when the new one is whole
[[nodiscard]] FmuResult export_fmu(const std::string& model, const std::string& path, const FmuOptions& options = {});
/// The same of a text; `name` stands for its file in messages, and files of the model are looked for beside it.
[[nodiscard]] FmuResult export_fmu_of_text(const std::string& text, const std::string& name, const std::string& path,
                                           const FmuOptions& options = {});

}  // namespace espalier
