/// \file
/// Values and lists as bytes: what one rank tells others at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::ranks {

/// What holds values one after another and is given a size: vectors, texts.
template <class L>
concept List = requires(L& l) {
  l.resize(std::size_t{});
};

/// Puts values one after another.
class Packer {
 public:
  template <class T>
  void pack(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    add(&value, sizeof value);
  }
  template <List L>
  void pack(const L& list) {
    pack(static_cast<std::uint64_t>(list.size()));
    add(list.data(), list.size() * sizeof(typename L::value_type));
  }
  [[nodiscard]] std::span<const std::byte> bytes() const { return bytes_; }

 private:
  void add(const void* from, std::size_t count) {
    const auto* begin = static_cast<const std::byte*>(from);
    bytes_.insert(bytes_.end(), begin, begin + count);
  }

  std::vector<std::byte> bytes_;
};

/// Gets them in the same order. @throws Error(device_error) where they end too early
class Unpacker {
 public:
  explicit Unpacker(std::span<const std::byte> bytes) : left_(bytes) {}
  template <class T>
  void get(T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    take(&value, 1, sizeof value);
  }
  template <List L>
  void get(L& list) {
    constexpr std::size_t kEach = sizeof(typename L::value_type);
    list.resize(size_of(kEach));
    take(list.data(), list.size(), kEach);
  }

 private:
  [[noreturn]] static void fail() { throw Error(StatusCode::device_error, "what another rank has told is not whole"); }
  std::size_t size_of(std::size_t each) {
    std::uint64_t size = 0;
    get(size);
    if (size > left_.size() / each) fail();
    return static_cast<std::size_t>(size);
  }
  void take(void* to, std::size_t count, std::size_t each) {
    if (count > left_.size() / each) fail();
    if (count > 0) std::memcpy(to, left_.data(), count * each);
    left_ = left_.subspan(count * each);
  }

  std::span<const std::byte> left_;
};

}  // namespace espalier::ranks
