/// \file
/// Numbers of texts. Programs that use the library may have set a language whose numbers have commas.
#pragma once

#include <clocale>
#include <cstdlib>

namespace espalier::base {

/// std::strtod() of the language C, whatever the process has set.
inline double strtod(const char* text, char** end = nullptr) {
  static const locale_t c = ::newlocale(LC_ALL_MASK, "C", nullptr);
  return ::strtod_l(text, end, c);
}

}  // namespace espalier::base
