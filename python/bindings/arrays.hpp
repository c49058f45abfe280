/// \file
/// C++ values as Python sees them.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <initializer_list>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "espalier/types.hpp"

namespace espalier::python {

namespace nb = nanobind;

/// Code, message, row.
inline nb::tuple status_of(const Status& s) {
  return nb::make_tuple(static_cast<int>(s.code), python_words(s.message), s.row);
}

/// An array of NumPy that owns the numbers.
template <class T>
nb::object array_of(std::vector<T> numbers, std::initializer_list<std::size_t> shape) {
  auto* kept = new std::vector<T>(std::move(numbers));
  nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, T>(kept->data(), shape, owner));
}

}  // namespace espalier::python
