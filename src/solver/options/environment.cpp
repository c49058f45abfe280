#include "solver/options/environment.hpp"

#include <cstdlib>
#include <string_view>

#include "solver/options/option_text.hpp"

namespace espalier::solver {

namespace {

void read_item(Environment& to, std::string_view item) {
  const std::size_t equals = item.find('=');
  const std::string_view key = item.substr(0, equals);
  const std::string_view value = equals == std::string_view::npos ? std::string_view() : item.substr(equals + 1);
  if (key != "log") return set_option(to.options, key, value);
  if (value != "stderr" && value != "none") throw Error(StatusCode::invalid_input, "log: give stderr or none");
  to.log_to_stderr = value == "stderr";
}

}  // namespace

Environment read_environment(const Options& defaults) {
  Environment result;
  result.options = defaults;
  const char* text = std::getenv("ESPALIER_OPTIONS");
  if (text == nullptr) return result;
  try {
    for (std::string_view rest = text; !rest.empty();) {
      const std::size_t end = rest.find(';');
      if (const std::string_view item = rest.substr(0, end); !item.empty()) read_item(result, item);
      rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);
    }
  } catch (const Error& e) {
    result = {defaults, false, {StatusCode::invalid_input, std::string("ESPALIER_OPTIONS: ") + e.what(), -1}};
  }
  return result;
}

}  // namespace espalier::solver
