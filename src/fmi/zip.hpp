/// \file
/// ZIP archives in memory, as FMUs are: members that are stored or deflated. No encryption, no parts, no ZIP64.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace espalier::fmi {

/// A file of an archive.
struct ZipMember {
  std::string name;  ///< with '/' between folders
  std::string bytes;
};

/// The archive of these files, the same bytes for the same files. @throws Error(invalid_input) above 4 GB
[[nodiscard]] std::string make_zip(const std::vector<ZipMember>& members);

/// What an archive holds.
class ZipArchive {
 public:
  /// @param name for messages @throws Error(invalid_input) for what is no archive, is damaged, names files outside
  /// itself (.., absolute names), or unpacks to more than `most` bytes
  ZipArchive(std::string name, std::string bytes, std::uint64_t most = kMost);
  static constexpr std::uint64_t kMost = std::uint64_t{2} << 30;

  [[nodiscard]] std::vector<std::string> names() const;
  [[nodiscard]] bool has(std::string_view member) const { return find(member) != nullptr; }
  /// @throws Error(invalid_input) where it is not there, or is damaged
  [[nodiscard]] std::string read(std::string_view member) const;

 private:
  struct Entry {
    std::string name;
    std::uint32_t method = 0, checksum = 0, packed = 0, size = 0, offset = 0;
  };
  [[nodiscard]] const Entry* find(std::string_view member) const;
  [[noreturn]] void refuse(const std::string& what) const;
  void read_directory(std::uint64_t most);
  [[nodiscard]] std::uint32_t number(std::size_t at, int bytes) const;

  std::string name_, bytes_;
  std::vector<Entry> entries_;
};

}  // namespace espalier::fmi
