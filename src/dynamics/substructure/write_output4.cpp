// OUTPUT4, dense columns; the layout is that of read_output4.cpp.
#include <fmt/format.h>

#include <cmath>

#include "dynamics/substructure/write_matrices.hpp"

namespace espalier::dynamics {
namespace {

constexpr std::int32_t kDouble = 2;  // type of the numbers: real, double precision

int form_of(const NamedMatrix& m) { return m.symmetric ? 6 : m.rows == m.columns ? 1 : 2; }

/// Rows of a column between its first and last number that is not 0; {0, 0}: all are.
struct FilledRows {
  Index first = 0, count = 0;
};
FilledRows filled(const double* column, Index rows) {
  Index first = 0, end = rows;
  while (first < end && column[first] == 0) ++first;
  while (end > first && column[end - 1] == 0) --end;
  return {first, end - first};
}

class Records {
 public:
  template <class T>
  Records& add(const T* values, std::size_t count) {
    content_.append(reinterpret_cast<const char*>(values), count * sizeof(T));
    return *this;
  }
  void end(std::string& out) {
    const auto length = static_cast<std::int32_t>(content_.size());
    const auto mark = [&] { out.append(reinterpret_cast<const char*>(&length), sizeof length); };
    mark();
    out += content_;
    mark();
    content_.clear();
  }

 private:
  std::string content_;
};

void append_number(std::string& line, double x) {
  constexpr double kLeast = 1e-99, kMost = 9.9e99;  // exponents have two digits
  if (!(std::abs(x) < kMost))
    throw Error(StatusCode::invalid_input, fmt::format("{} does not fit the columns of OUTPUT4 as text", x));
  line += fmt::format("{:23.16E}", std::abs(x) < kLeast ? 0.0 : x);
}

}  // namespace

std::string output4_binary(std::span<const NamedMatrix> matrices) {
  std::string out;
  Records record;
  for (const NamedMatrix& m : matrices) {
    const std::int32_t head[4] = {m.columns, m.rows, form_of(m), kDouble};
    const std::string name = fmt::format("{:<8}", m.name);
    record.add(head, 4).add(name.data(), name.size()).end(out);
    for (Index c = 0; c < m.columns; ++c) {
      const double* column = m.values + static_cast<std::size_t>(c) * static_cast<std::size_t>(m.rows);
      const FilledRows part = filled(column, m.rows);
      if (part.count == 0) continue;
      const std::int32_t at[3] = {c + 1, part.first + 1, 2 * part.count};
      record.add(at, 3).add(column + part.first, static_cast<std::size_t>(part.count)).end(out);
    }
    const std::int32_t at[3] = {m.columns + 1, 1, 2};
    const double one = 1;
    record.add(at, 3).add(&one, 1).end(out);
  }
  return out;
}

std::string output4_text(std::span<const NamedMatrix> matrices) {
  constexpr Index kPerLine = 3;
  std::string out;
  for (const NamedMatrix& m : matrices) {
    out += fmt::format("{:8}{:8}{:8}{:8}{:<8}1P,{}E23.16\n", m.columns, m.rows, form_of(m), kDouble, m.name, kPerLine);
    for (Index c = 0; c < m.columns; ++c) {
      const double* column = m.values + static_cast<std::size_t>(c) * static_cast<std::size_t>(m.rows);
      const FilledRows part = filled(column, m.rows);
      if (part.count == 0) continue;
      out += fmt::format("{:8}{:8}{:8}\n", c + 1, part.first + 1, part.count);  // of text: numbers, not words
      for (Index k = 0; k < part.count; ++k) {
        append_number(out, column[part.first + k]);
        if (k % kPerLine == kPerLine - 1 || k + 1 == part.count) out += '\n';
      }
    }
    out += fmt::format("{:8}{:8}{:8}\n", m.columns + 1, 1, 1);
    append_number(out, 1);
    out += '\n';
  }
  return out;
}

}  // namespace espalier::dynamics
