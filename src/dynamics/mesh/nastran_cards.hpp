/// \file
/// The bulk data of a Nastran file as cards: fields of 8, of 16 columns, or between commas, with continuation lines.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {

/// One card. Fields are trimmed; those left out at the end are empty.
class NastranCard {
 public:
  std::string name;                 ///< upper case, without '*'
  std::vector<std::string> fields;  ///< fields 2, 3, ... of the card (the first one after the name is number 0)
  std::int64_t line = 0;            ///< of its first line
  std::string path;

  [[nodiscard]] const std::string& field(std::size_t k) const;
  /// The field as a number; 1.5-3 and 1.5D-3 are 1.5E-3. @throws Error naming line, card and field, also for an empty
  /// one
  [[nodiscard]] double real(std::size_t k, const char* what) const;
  [[nodiscard]] double real(std::size_t k, const char* what, double empty) const;
  [[nodiscard]] std::int64_t integer(std::size_t k, const char* what) const;
  [[nodiscard]] std::int64_t integer(std::size_t k, const char* what, std::int64_t empty) const;
  [[noreturn]] void fail(const std::string& message) const;
};

/// Cards of a file in their order: those between BEGIN BULK (or the first line, where there is none) and ENDDATA (or
/// the last line). Continuation lines follow the line that they continue.
class NastranCards {
 public:
  NastranCards(std::string content, const std::string& path);
  /// @return false at the end
  bool next(NastranCard& card);

 private:
  struct Line {
    std::string head;  // first field, upper case
    std::vector<std::string> fields;
    bool wide = false;  // fields of 16 columns: 4 a line
  };
  bool next_line(std::string_view& text);
  [[nodiscard]] Line split(std::string_view text) const;

  LineReader reader_;
};

}  // namespace espalier::dynamics
