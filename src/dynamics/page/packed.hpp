/// \file
/// Numbers as the page holds them: 16 bits each over their range, compressed, as letters.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace espalier::dynamics::page {

/// Numbers of 16 bits and, for each row of them, the range that they stand for.
struct Quantized {
  std::vector<std::uint16_t> steps;  ///< low + step (high - low) / 65534; 65535: not finite
  std::vector<double> ranges;        ///< low and high of each row
  /// Adds a row: every `stride`-th number of `values`, from the one with the number `first` on.
  void add(std::span<const double> values, std::size_t first = 0, std::size_t stride = 1);
};

/// The low bytes of all, then the high bytes, which have much in common and compress.
[[nodiscard]] std::string split_bytes(std::span<const std::uint16_t> numbers);
/// As gzip. @param level of zlib, 1 is the quickest
[[nodiscard]] std::string compressed(std::string_view bytes, int level = 1);
[[nodiscard]] std::string base64(std::string_view bytes);

template <class T>
[[nodiscard]] std::string_view bytes_of(const std::vector<T>& numbers) {
  return {reinterpret_cast<const char*>(numbers.data()), sizeof(T) * numbers.size()};
}

}  // namespace espalier::dynamics::page
