#include "dynamics/mesh/nastran_cards.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <system_error>

#include "dynamics/mesh/file_source.hpp"

namespace espalier::dynamics {
namespace {

constexpr std::size_t kColumns = 72;  // what stands behind is a mark for continuation lines

constexpr int kDeepest = 16;
constexpr std::size_t kMostFiles = 1000;
constexpr std::int64_t kMostMade = 5000000;

bool is_begin_bulk(std::string_view line) {
  const std::string text = upper(trim(line));
  return text.starts_with("BEGIN") && text.find("BULK") != std::string::npos;
}

bool is_continuation(const std::string& head) { return head.empty() || head.front() == '+' || head.front() == '*'; }

/// A mark without the + or * in front of it.
std::string mark_of(std::string_view field) {
  field = trim(field);
  while (!field.empty() && (field.front() == '+' || field.front() == '*')) field.remove_prefix(1);
  return upper(trim(field));
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

/// The mark of a line's field 10, or of the field behind the last of a comma line.
std::string tail_mark(std::string_view text) {
  if (text.find(',') == std::string_view::npos) {
    const std::string columns = without_tabs(text);
    return columns.size() <= kColumns ? "" : mark_of(std::string_view(columns).substr(kColumns, 8));
  }
  for (int k = 0; k < 9; ++k) {
    const std::size_t comma = text.find(',');
    if (comma == std::string_view::npos) return "";
    text.remove_prefix(comma + 1);
  }
  return mark_of(text.substr(0, text.find(',')));
}

std::string head_of(std::string_view text) {
  return upper(trim(text.substr(0, std::min(text.find_first_of(",\t"), std::size_t{8}))));
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

NastranCards::NastranCards(std::string content, const std::string& path) {
  contents_.push_back(std::move(content));
  files_.push_back(path);
  open_.push_back(path);
  // Where BEGIN BULK stands, in this file or one that it includes, all before it is none of the data.
  gather(0, 0);
  link_marks();
}

void NastranCards::fail(const Place& place, const std::string& message) const {
  throw Error(StatusCode::invalid_input, fmt::format("{}:{}: {}", files_[place.file], place.line, message));
}

void NastranCards::gather(std::size_t file, int depth) {
  Rest rest{contents_.back(), 0};
  std::string_view text;
  while (!ended_ && next_line(rest, text)) {
    text = text.substr(0, text.find('$'));
    if (trim(text).empty()) continue;
    if (is_begin_bulk(text)) {
      if (!seen_begin_) lines_.clear();
      seen_begin_ = true;
      continue;
    }
    const std::string head = head_of(text);
    if (head.starts_with("ENDDATA"))
      ended_ = true;
    else if (head.starts_with("INCLUDE"))
      include(rest, text, file, depth);
    else
      lines_.push_back({text, rest.line, file});
  }
}

bool NastranCards::next_line(Rest& rest, std::string_view& text) {
  if (rest.text.empty()) return false;
  const std::size_t end = rest.text.find('\n');
  text = rest.text.substr(0, end);
  if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
  rest.text = end == std::string_view::npos ? std::string_view() : rest.text.substr(end + 1);
  ++rest.line;
  return true;
}

void NastranCards::include(Rest& rest, std::string_view text, std::size_t file, int depth) {
  const Place place{text, rest.line, file};
  std::string name(trim(trim(text).substr(7)));
  if (const char quote = name.empty() ? ' ' : name.front(); quote == '\'' || quote == '"') {
    name.erase(0, 1);
    std::string_view more;
    while (name.find(quote) == std::string::npos && next_line(rest, more)) name += trim(more);  // over line ends
    name.resize(std::min(name.find(quote), name.size()));
  }
  if (name.empty()) fail(place, "INCLUDE needs the name of a file");
  if (depth >= kDeepest) fail(place, fmt::format("files include one another more than {} deep", kDeepest));
  if (files_.size() > kMostFiles) fail(place, fmt::format("more than {} files are included", kMostFiles));
  std::filesystem::path path;
  for (const std::string& from : {files_[file], files_.front()}) {
    path = std::filesystem::path(from).parent_path() / name;
    std::error_code ignored;
    if (file_exists(path.string()) && !std::filesystem::is_directory(path, ignored)) break;
    path.clear();
  }
  if (path.empty()) fail(place, fmt::format("INCLUDE: there is no file '{}' beside '{}'", name, files_[file]));
  const auto same = [&](const std::string& other) {
    std::error_code ignored;
    return std::filesystem::equivalent(path, other, ignored);
  };
  if (std::find_if(open_.begin(), open_.end(), same) != open_.end())
    fail(place, fmt::format("INCLUDE: '{}' includes itself, perhaps through others", name));
  files_.push_back(path.string());
  contents_.push_back(read_whole_file(path.string()));
  open_.push_back(path.string());
  gather(files_.size() - 1, depth + 1);
  open_.pop_back();
}

void NastranCards::link_marks() {
  std::unordered_map<std::string, std::size_t> waiting;     // marks that the next line does not have
  std::vector<std::pair<std::size_t, std::string>> strays;  // continuations whose marks the line before has not
  std::string mark;                                         // of the line before
  for (std::size_t k = 0; k <= lines_.size(); ++k) {
    const std::string head = k < lines_.size() ? head_of(lines_[k].text) : "END";
    const bool continues = is_continuation(head);
    const std::string own = continues ? mark_of(head) : "";
    const bool follows = continues && (own.empty() || own == mark);
    if (k > 0 && !mark.empty() && !follows) waiting.emplace(mark, k - 1);
    if (continues && !follows) strays.emplace_back(k, own);
    if (k < lines_.size()) mark = tail_mark(lines_[k].text);
  }
  for (const auto& [k, own] : strays)
    if (const auto parent = waiting.find(own); parent != waiting.end() && parent->second != k) {
      continued_by_[parent->second] = k;
      elsewhere_.insert(k);
      waiting.erase(parent);
    }
}

NastranCards::Line NastranCards::split(std::string_view text) {
  Line line;
  if (const std::size_t comma = text.find(','); comma != std::string_view::npos) {
    line.head = upper(trim(text.substr(0, comma)));
    line.wide = line.head.ends_with('*') || line.head.starts_with('*');
    const std::size_t most = line.wide ? 4 : 8;
    std::string_view rest = text.substr(comma + 1);
    bool more = true;
    while (more && line.fields.size() < most) {
      const std::size_t end = rest.find(',');
      line.fields.emplace_back(trim(rest.substr(0, end)));
      more = end != std::string_view::npos;
      if (more) rest.remove_prefix(end + 1);
    }
    if (more) {  // then a mark; a number is none
      const std::string mark(trim(rest.substr(0, rest.find(','))));
      const bool number = !mark.empty() && mark.find_first_of("0123456789.-") == 0;
      const std::string_view behind = rest.substr(std::min(rest.find(','), rest.size()));
      if (number || behind.find_first_not_of(", \t") != std::string_view::npos) line.lost = std::string(trim(rest));
    }
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

NastranCards::Line NastranCards::split(const Place& place) const {
  Line line = split(place.text);
  if (!line.lost.empty())
    fail(place, fmt::format("'{}' stands behind the {} fields that a line between commas has; go on in a next line, "
                            "that starts with +,",
                            line.lost, line.fields.size()));
  return line;
}

void NastranCards::append(NastranCard& card, std::size_t at) {
  Line more = split(lines_[at]);
  card.fields.insert(card.fields.end(), more.fields.begin(), more.fields.end());
}

bool NastranCards::next(NastranCard& card) {
  if (repeats_ > 0) {
    --repeats_;
    repeat(card);
    return true;
  }
  while (at_ < lines_.size() && elsewhere_.contains(at_)) ++at_;
  if (at_ == lines_.size()) return false;
  const Place& place = lines_[at_];
  Line line = split(place);
  if (is_continuation(line.head)) fail(place, "a continuation line without a card before it");
  card.name = std::move(line.head);
  while (!card.name.empty() && card.name.back() == '*') card.name.pop_back();
  card.fields = std::move(line.fields);
  card.line = place.line;
  card.path = files_[place.file];
  for (std::size_t from = at_++, steps = 0;;) {
    if (++steps > lines_.size()) fail(place, "its continuation lines continue one another in a circle");
    std::size_t follower = lines_.size();
    if (const auto found = continued_by_.find(from); found != continued_by_.end())
      follower = found->second;
    else if (from + 1 < lines_.size() && !elsewhere_.contains(from + 1) &&
             is_continuation(head_of(lines_[from + 1].text)))
      follower = from + 1;
    if (follower == lines_.size()) break;
    append(card, follower);
    if (follower == at_) ++at_;
    from = follower;
  }
  if (card.name.starts_with('='))
    repeat(card);
  else
    increments_.clear();
  last_ = card;
  return true;
}

void NastranCards::repeat(NastranCard& card) {
  if (last_.name.empty() || (last_.name.front() == '=')) card.fail("there is no card before it that it could repeat");
  const std::string first = card.name;
  if (first != "=" && first.starts_with('=')) {  // =(n): so many more
    std::string digits = first.substr(1);
    std::erase_if(digits, [](char c) { return c == '(' || c == ')' || c == ' '; });
    std::int64_t count = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), count);
    if (error != std::errc() || end != digits.data() + digits.size() || count < 1 || (made_ += count) > kMostMade)
      card.fail(fmt::format("'{}' is no number of repetitions from 1 to {}", first, kMostMade));
    repeats_ = count - 1;
  } else if (first == "=") {
    std::vector<std::string> fields;
    increments_.assign(last_.fields.size(), "");
    for (std::size_t k = 0; k < last_.fields.size(); ++k) {
      const std::string given = k < card.fields.size() ? card.field(k) : "";
      if (given == "==") {
        fields.insert(fields.end(), last_.fields.begin() + static_cast<std::ptrdiff_t>(k), last_.fields.end());
        break;
      }
      if (given.starts_with('*')) increments_[k] = given.substr(1);
      std::erase_if(increments_[k], [](char c) { return c == '(' || c == ')'; });
      fields.push_back(given == "=" || given.starts_with('*') ? last_.fields[k] : given);
    }
    last_.fields = std::move(fields);
  }
  // One step of what counts.
  NastranCard made = last_;
  made.line = card.line;
  for (std::size_t k = 0; k < std::min(increments_.size(), made.fields.size()); ++k) {
    if (increments_[k].empty()) continue;
    NastranCard step = made;
    step.fields[k] = increments_[k];
    const bool whole = (made.fields[k] + increments_[k]).find_first_of(".eEdD") == std::string::npos;
    if (whole) {
      const std::int64_t value = made.integer(k, "number"), by = step.integer(k, "step");
      if (std::abs(value) > 1000000000000 || std::abs(by) > 1000000000000)
        made.fail("numbers are too large to be repeated");
      made.fields[k] = std::to_string(value + by);
    } else {
      made.fields[k] = fmt::format("{}", made.real(k, "number") + step.real(k, "step"));
    }
  }
  last_ = made;
  card = std::move(made);
}

}  // namespace espalier::dynamics
