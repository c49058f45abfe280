/// \file
/// Values and their names in one table, which readers, messages and printers share.
#pragma once

#include <cstddef>
#include <type_traits>

namespace espalier::base {

template <class T>
struct Named {
  const char* name;
  T value;
};

/// "" for a value without a row.
template <class T, std::size_t n>
[[nodiscard]] constexpr const char* name_of(const Named<T> (&rows)[n], const std::type_identity_t<T>& value) {
  for (const Named<T>& row : rows)
    if (row.value == value) return row.name;
  return "";
}

}  // namespace espalier::base
