/// \file
/// A checksum of bytes, for files and for telling contents apart. It guards against damage, not against intent.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string_view>

namespace espalier::base {

/// h = 0xcbf29ce484222325; for every 8 bytes as uint64 x (the last padded with zeros): h = rotl(h ^ x, 29) *
/// 0x9e3779b97f4a7c15; the value is h ^ number of bytes. Each step is one-to-one in h and in x, so that a change within
/// one word is always seen.
class Checksum {
 public:
  /// @pre bytes is a multiple of 8, except in the last call
  void add(const void* data, std::size_t bytes) {
    const char* p = static_cast<const char*>(data);
    for (std::size_t i = 0; i < bytes; i += 8) {
      std::uint64_t x = 0;
      std::memcpy(&x, p + i, std::min<std::size_t>(8, bytes - i));
      hash_ = std::rotl(hash_ ^ x, 29) * 0x9e3779b97f4a7c15U;
    }
    bytes_ += bytes;
  }
  /// A list of numbers, with its length, as whole words.
  template <class T>
  void add_list(std::span<const T> list) {
    const std::uint64_t size = list.size();
    add(&size, sizeof size);
    for (const T& value : list) {
      std::uint64_t x = 0;
      std::memcpy(&x, &value, sizeof value);
      add(&x, sizeof x);
    }
  }
  [[nodiscard]] std::uint64_t value() const { return hash_ ^ bytes_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325U;
  std::uint64_t bytes_ = 0;
};

/// The checksum of one block of bytes.
inline std::uint64_t checksum(const void* data, std::size_t bytes) {
  Checksum sum;
  sum.add(data, bytes);
  return sum.value();
}

}  // namespace espalier::base
