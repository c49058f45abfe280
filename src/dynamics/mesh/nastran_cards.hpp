/// \file
/// The bulk data of a Nastran file as cards: fields of 8, of 16 columns, or between commas, with continuation lines.
#pragma once

#include <cstdint>
#include <list>
#include <string>
#include <unordered_map>
#include <unordered_set>
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

/// Cards of a file, and of those that it includes, in their order: those between BEGIN BULK (or the first line, where
/// there is none) and ENDDATA (or the last line). Continuation lines follow the line that they continue, or have its
/// mark (field 10) and stand anywhere. A card "=" repeats the one before it: "=" in a field is the same, "==" all the
/// rest, "*2" adds 2; "=(3)" makes three more with the same steps.
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
    std::string lost;   // what stands between commas where no field of the line is
  };
  /// A line of the bulk data that is not blank and no comment.
  struct Place {
    std::string_view text;
    std::int64_t line;
    std::size_t file;  // in files_
  };
  /// What of a file is left.
  struct Rest {
    std::string_view text;
    std::int64_t line;  // the last one
  };
  void gather(std::size_t file, int depth);
  void include(Rest& rest, std::string_view text, std::size_t file, int depth);
  static bool next_line(Rest& rest, std::string_view& text);
  void link_marks();
  void append(NastranCard& card, std::size_t at);
  void repeat(NastranCard& card);
  [[nodiscard]] static Line split(std::string_view text);
  [[nodiscard]] Line split(const Place& place) const;
  [[noreturn]] void fail(const Place& place, const std::string& message) const;

  std::list<std::string> contents_;        // of the files: stay where they are
  std::vector<std::string> files_, open_;  // open: those that are being read
  bool ended_ = false, seen_begin_ = false;
  std::vector<Place> lines_;
  std::unordered_map<std::size_t, std::size_t> continued_by_;  // line -> a continuation that stands elsewhere
  std::unordered_set<std::size_t> elsewhere_;                  // these continuations
  std::size_t at_ = 0;
  NastranCard last_;                     // for cards that repeat it
  std::vector<std::string> increments_;  // of its fields; empty: stays
  std::int64_t repeats_ = 0, made_ = 0;
};

}  // namespace espalier::dynamics
