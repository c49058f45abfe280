/// \file
/// Options as text: one table for the command line and the C interface.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/named.hpp"
#include "espalier/solver.hpp"

namespace espalier::solver {

/// Bytes from text: a number, a decimal point allowed, and a unit: none or B, K M G T (powers of 1024, with or without
/// "iB" or "B"), upper or lower case: "2GiB", "512M", "1.5g", "4096".
/// @throws Error(invalid_input) that says what is wrong and shows examples
Offset parse_bytes(std::string_view text);

/// Sets one option by name; '-' and '_' are the same in `key`. option_keys() lists the names.
/// @throws Error(invalid_input) for an unknown key (lists the known ones) or a value that does not parse (lists what
/// does)
void set_option(Options& options, std::string_view key, std::string_view value);

/// The keys that set_option() knows.
std::vector<std::string_view> option_keys();

/// The names used in texts and reports.
inline constexpr base::Named<Kind> kKinds[] = {
    {"auto", Kind::automatic}, {"llt", Kind::llt}, {"ldlt", Kind::ldlt}, {"lu", Kind::lu}};
std::string_view name_of(Kind kind);
std::string_view name_of(Precision precision);
std::string_view name_of(StatusCode code);

}  // namespace espalier::solver
