/// \file
/// The file of a factor: a head, then parts that have a name, a size and a checksum each.
///
///   head: "ESPFACT\0", version, byte order (0x01020304), bytes of the file; checksum of these
///   part: name (8 characters), bytes; the bytes; checksum of name, size and bytes
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/checksum.hpp"
#include "base/output_file.hpp"
#include "espalier/types.hpp"

namespace espalier::solver {

inline constexpr std::uint32_t kFactorVersion = 1;

class FactorWriter {
 public:
  /// @param bytes  of all parts
  FactorWriter(const std::string& path, const std::vector<std::uint64_t>& bytes);
  /// @param name  at most eight characters
  void begin_part(const char* name, std::uint64_t bytes);
  void bytes(std::span<const std::byte> bytes);
  void end_part();
  void commit() { out_.commit(); }

  template <class List>
  void list(const List& v) {
    value(static_cast<std::uint64_t>(v.size()));
    bytes(std::as_bytes(std::span(v)));
  }
  template <class T>
  void value(const T& v) {
    bytes(std::as_bytes(std::span<const T>(&v, 1)));
  }
  template <class List>
  static std::uint64_t list_bytes(const List& v) {
    return sizeof(std::uint64_t) + v.size() * sizeof(typename List::value_type);
  }

 private:
  void raw(const void* data, std::size_t bytes);

  base::OutputFile out_;
  base::Checksum sum_;
  std::vector<std::byte> odd_;  // of a word of the checksum
};

/// @throws Error(invalid_input) that names the file, for all that does not fit
class FactorReader {
 public:
  explicit FactorReader(const std::string& path);
  /// The next part must have this name.
  void begin_part(const char* name);
  void bytes(std::span<std::byte> to);
  /// All of it must have been read, and be what was written.
  void end_part();
  [[nodiscard]] std::uint64_t left() const { return left_; }
  [[noreturn]] void fail(const std::string& why) const;

  template <class List>
  void list(List& v) {
    const auto size = value<std::uint64_t>();
    if (size > left_ / sizeof(typename List::value_type)) fail("a list is longer than its part of the file");
    v.resize(static_cast<std::size_t>(size));
    bytes(std::as_writable_bytes(std::span(v)));
  }
  template <class T>
  T value() {
    T v{};
    bytes(std::as_writable_bytes(std::span<T>(&v, 1)));
    return v;
  }

 private:
  struct Close {
    void operator()(std::FILE* f) const { (void)std::fclose(f); }
  };
  void raw(void* to, std::size_t bytes);

  std::string path_;
  std::unique_ptr<std::FILE, Close> file_;
  std::uint64_t left_of_file_ = 0, left_ = 0;
  base::Checksum sum_;
  std::vector<std::byte> odd_;
};

}  // namespace espalier::solver
