#include "dynamics/mesh/deck/nastran_control.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {
namespace {

std::int64_t set_number(const DeckPlace& place, const std::string& word, std::string_view text) {
  text = trim(text);
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    fail(place, fmt::format("{} = '{}' is not the number of a set", word, text));
  return value;
}

}  // namespace

NastranControl read_nastran_control(std::string_view content, const std::string& name) {
  NastranControl control;
  NastranCase all;  // what holds for every subcase
  std::vector<NastranCase> cases;
  DeckPlace place{name, 0};
  while (!content.empty()) {
    const std::size_t end = content.find('\n');
    std::string line = upper(trim(content.substr(0, end).substr(0, content.substr(0, end).find('$'))));
    content.remove_prefix(end == std::string_view::npos ? content.size() : end + 1);
    ++place.line;
    if (line.starts_with("BEGIN")) {
      control.stated = true;
      break;
    }
    std::replace(line.begin(), line.end(), '\t', ' ');
    const std::string word = line.substr(0, line.find_first_of(" =(,"));
    const std::size_t equal = line.find('=');
    const std::string_view rest =
        std::string_view(line).substr(equal == std::string::npos ? std::min(word.size(), line.size()) : equal + 1);
    NastranCase& now = cases.empty() ? all : cases.back();
    if (word == "SOL") {
      control.solution = std::string(trim(rest.substr(0, rest.find(','))));
      control.place = place;
    } else if (word == "SUBCASE" || word == "SUBCOM" || word == "SYM" || word == "SYMCOM" || word == "REPCASE") {
      cases.push_back(all);
      cases.back().place = place;
      if (word != "SUBCASE") cases.back().left.push_back(word);
    } else if (word == "INCLUDE") {
      now.left.emplace_back("INCLUDE before BEGIN BULK (put its lines here)");
    } else if (equal != std::string::npos) {
      if (word == "LOAD") now.load = set_number(place, word, rest);
      if (word == "SPC") now.spc = set_number(place, word, rest);
      if (word == "MPC") now.mpc = set_number(place, word, rest);
      if (word == "METHOD") now.method = set_number(place, word, rest);
      for (const char* other :
           {"TEMPERATURE", "TEMP", "DLOAD", "DEFORM", "NLPARM", "BCSET", "BCONTACT", "TRIM", "SUPORT1", "CMETHOD",
            "TSTEP", "FREQUENCY", "K2GG", "M2GG", "K2PP", "M2PP", "STATSUB", "P2G", "LOADSET"})
        if (word == other) now.left.emplace_back(word);
    }
  }
  if (!control.stated) {  // no case control at all
    control = {};
    all = {};
    all.place = {name, 1};
    cases.clear();
  }
  if (cases.empty()) cases.push_back(all);
  const auto stressed = [](const NastranCase& c) {
    return std::find(c.left.begin(), c.left.end(), "STATSUB") != c.left.end();
  };
  if (std::any_of(cases.begin(), cases.end(), stressed))  // another subcase is what stresses this one
    for (NastranCase& c : cases)
      if (!stressed(c)) c.left.emplace_back("STATSUB");
  if (cases.front().place.line == 0) cases.front().place = {name, std::max<std::int64_t>(1, control.place.line)};
  control.cases = std::move(cases);
  return control;
}

}  // namespace espalier::dynamics
