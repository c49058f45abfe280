/// \file
/// Options whose values are checked while the command line is read, and files that are checked before the work.
#pragma once

#include <initializer_list>
#include <string>

namespace CLI {
class App;
class Option;
class Validator;
}  // namespace CLI

namespace espalier::cli {

/// An option (or, without dashes, an argument) that names a file or folder. An empty name is wrong usage: a variable
/// that a script forgot to set must not mean "none".
CLI::Option* add_file(CLI::App& command, const std::string& option, std::string& name, const std::string& text,
                      const char* type = "FILE");

/// A finite number above zero; one of at least zero; any finite one; a whole number from 0 to 2^64 - 1.
CLI::Validator positive();
CLI::Validator not_negative();
CLI::Validator finite();
/// Any number; what it may be depends on the model.
CLI::Validator number();
CLI::Validator whole_number();

/// A file of a command, as the user knows it; an empty path is passed over.
struct NamedFile {
  const char* option;
  const std::string& path;
};

/// Refuses what would be noticed after hours otherwise: an output that cannot be written, that is an input of the
/// command, or that another output would replace. Leaves all files as they are.
/// @throws Error(invalid_input) naming option, path and reason
void check_outputs(std::initializer_list<NamedFile> inputs, std::initializer_list<NamedFile> outputs);

}  // namespace espalier::cli
