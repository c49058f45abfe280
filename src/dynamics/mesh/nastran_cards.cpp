#include "dynamics/mesh/nastran_cards.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace espalier::dynamics {
namespace {

constexpr std::size_t kColumns = 72;  // what stands behind is a mark for continuation lines

bool is_begin_bulk(std::string_view line) {
  const std::string text = upper(trim(line));
  return text.starts_with("BEGIN") && text.find("BULK") != std::string::npos;
}

/// Lines up to and with BEGIN BULK; 0 where there is none.
std::int64_t header_lines(std::string_view content) {
  std::int64_t line = 0;
  while (!content.empty()) {
    const std::size_t end = std::min(content.find('\n'), content.size() - 1);
    ++line;
    if (is_begin_bulk(content.substr(0, end + 1))) return line;
    content.remove_prefix(end + 1);
  }
  return 0;
}

/// Tabs go to the next multiple of 8 columns.
std::string without_tabs(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c == '\t')
      result.append(8 - result.size() % 8, ' ');
    else
      result += c;
  }
  return result;
}

}  // namespace

const std::string& NastranCard::field(std::size_t k) const {
  static const std::string empty;
  return k < fields.size() ? fields[k] : empty;
}

void NastranCard::fail(const std::string& message) const {
  throw Error(StatusCode::invalid_input, fmt::format("{}:{}: {}: {}", path, line, name, message));
}

double NastranCard::real(std::size_t k, const char* what) const {
  const std::string& given = field(k);
  if (given.empty()) fail(fmt::format("field {} ({}) is empty", k + 2, what));
  std::string text;
  for (std::size_t i = given.front() == '+' ? 1 : 0; i < given.size(); ++i) {
    const char c = given[i], before = text.empty() ? 'e' : text.back();
    if (c == 'd' || c == 'D' || c == 'E') {
      text += 'e';
    } else {
      if ((c == '-' || c == '+') && before != 'e' && !text.empty()) text += 'e';
      if (c != '+') text += c;
    }
  }
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
    fail(fmt::format("field {} ({}): '{}' is not a number", k + 2, what, given));
  return value;
}

double NastranCard::real(std::size_t k, const char* what, double empty) const {
  return field(k).empty() ? empty : real(k, what);
}

std::int64_t NastranCard::integer(std::size_t k, const char* what) const {
  const std::string& given = field(k);
  if (given.empty()) fail(fmt::format("field {} ({}) is empty", k + 2, what));
  const char* begin = given.data() + (given.front() == '+' ? 1 : 0);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(begin, given.data() + given.size(), value);
  if (error != std::errc() || end != given.data() + given.size())
    fail(fmt::format("field {} ({}): '{}' is not a whole number", k + 2, what, given));
  return value;
}

std::int64_t NastranCard::integer(std::size_t k, const char* what, std::int64_t empty) const {
  return field(k).empty() ? empty : integer(k, what);
}

NastranCards::NastranCards(std::string content, const std::string& path) : reader_(path, std::move(content)) {
  std::string_view skipped;
  for (std::int64_t k = header_lines(reader_.rest()); k > 0; --k) reader_.next(skipped);
}

bool NastranCards::next_line(std::string_view& text) {
  while (reader_.next(text)) {
    text = text.substr(0, text.find('$'));
    if (!trim(text).empty()) return true;
  }
  return false;
}

NastranCards::Line NastranCards::split(std::string_view text) const {
  Line line;
  if (const std::size_t comma = text.find(','); comma != std::string_view::npos) {
    line.head = upper(trim(text.substr(0, comma)));
    line.wide = line.head.ends_with('*') || line.head.starts_with('*');
    const std::size_t most = line.wide ? 4 : 8;
    Fields fields(reader_, text.substr(comma + 1), ',');
    for (std::string_view field; line.fields.size() < most && fields.next(field);) line.fields.emplace_back(field);
    line.fields.resize(most);
    return line;
  }
  const std::string columns = without_tabs(text);
  const auto piece = [&](std::size_t from, std::size_t width) {
    const std::size_t end = std::min({from + width, kColumns, columns.size()});
    return from < end ? std::string(trim(std::string_view(columns).substr(from, end - from))) : std::string();
  };
  line.head = upper(piece(0, 8));
  line.wide = line.head.ends_with('*') || line.head.starts_with('*');
  const std::size_t width = line.wide ? 16 : 8;
  for (std::size_t from = 8; from < kColumns; from += width) line.fields.push_back(piece(from, width));
  return line;
}

bool NastranCards::next(NastranCard& card) {
  std::string_view text;
  if (!next_line(text)) return false;
  Line line = split(text);
  const auto continues = [](const Line& l) { return l.head.empty() || l.head.front() == '+' || l.head.front() == '*'; };
  if (continues(line)) reader_.fail("a continuation line without a card before it");
  if (line.head.starts_with("ENDDATA")) return false;
  if (line.head.starts_with("INCLUDE")) reader_.fail("INCLUDE is not read; put all cards into one file");
  card.name = std::move(line.head);
  while (!card.name.empty() && card.name.back() == '*') card.name.pop_back();
  card.fields = std::move(line.fields);
  card.line = reader_.line();
  card.path = reader_.path();
  while (next_line(text)) {
    Line more = split(text);
    if (!continues(more)) {
      reader_.back();
      break;
    }
    card.fields.insert(card.fields.end(), more.fields.begin(), more.fields.end());
  }
  return true;
}

}  // namespace espalier::dynamics
