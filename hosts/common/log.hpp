/// \file
/// What the host libraries tell their user: one line per factorization, where he asks for it, and mistakes in any case.
#pragma once

#include <string>

namespace espalier::hosts {

/// True where ESPALIER_LOG asks for lines: "1" writes them to stderr, anything else but "0" is the name of a file to
/// which they are appended.
bool logs();
/// Writes "espalier INTERFACE: TEXT" as one line, if logs().
void log(const std::string& interface, const std::string& text);
/// The same to stderr and whatever ESPALIER_LOG says, but never twice in turn: for what the user must put right.
void complain(const std::string& interface, const std::string& text);

}  // namespace espalier::hosts
