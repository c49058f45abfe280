/// \file
/// What people see: colour, errors, numbers in words, tables.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace espalier::cli {

enum class Tone { plain, strong, quiet, good, bad };

/// `text` in a tone when stdout is a terminal, NO_COLOR is not set and TERM is not dumb; else unchanged.
std::string toned(Tone tone, std::string_view text);

/// Writes to a standard stream and flushes nothing. A stream that cannot be written (a full disk, a pipe whose reader
/// is gone) never ends the work: see output_error().
void write_to(std::FILE* stream, std::string_view text);

/// A result, on stdout.
template <class... Values>
void print_result(fmt::format_string<Values...> text, Values&&... values) {
  write_to(stdout, fmt::format(text, std::forward<Values>(values)...));
}
/// Progress or a remark, on stderr.
template <class... Values>
void print_note(fmt::format_string<Values...> text, Values&&... values) {
  write_to(stderr, fmt::format(text, std::forward<Values>(values)...));
}
/// Whether stderr is a terminal on which a line can be written anew.
[[nodiscard]] bool has_live_line();
/// Flushes stdout. @return the system's number of the first error since the start of writing there, 0 without one
int output_error();

/// "espalier: error: ..." on stderr.
void print_error(std::string_view message);
/// The message of the last one; empty where there was none.
[[nodiscard]] const std::string& last_error();
/// An indented second line on stderr that says what to do.
void print_hint(std::string_view message);

/// 1234567 -> "1,234,567".
std::string grouped(std::int64_t number);
/// "1 body", "1,234 bodies".
std::string counted(std::int64_t number, std::string_view one, std::string_view many);
/// "12.3 ms", "1.24 s", "3 min 20 s"; "-" for a negative number.
std::string duration(double seconds);
/// "98.4 GFLOP/s"; "-" where there is nothing to say.
std::string rate(double flops_per_second);
/// "1.26e+10 flop" in words: "12.6 GFLOP".
std::string operations(double flops);
/// "1.2e-16".
std::string small(double number);

/// Rows of cells in aligned columns; the first column is left-aligned, the others by `align` ('<' or '>').
class Table {
 public:
  explicit Table(std::string align) : align_(std::move(align)) {}
  void add(std::vector<std::string> cells, Tone tone = Tone::plain);
  /// All rows, each indented by two blanks, with a newline after each.
  [[nodiscard]] std::string text() const;

 private:
  struct Row {
    std::vector<std::string> cells;
    Tone tone;
  };
  std::string align_;
  std::vector<Row> rows_;
};

}  // namespace espalier::cli
