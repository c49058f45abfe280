#include "common/checked_options.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>

#include "base/output_file.hpp"

namespace espalier::cli {

namespace {

CLI::Validator number_from(double least, bool itself, const char* wanted) {
  return {[=](std::string& text) {
            double number = 0;
            const bool good = CLI::detail::lexical_cast(text, number) && std::isfinite(number) &&
                              (number > least || (itself && number == least));
            return good ? std::string() : fmt::format("'{}' is not {}", text, wanted);
          },
          ""};
}

}  // namespace

CLI::Option* add_file(CLI::App& command, const std::string& option, std::string& name, const std::string& text,
                      const char* type) {
  return command.add_option(option, name, text)->type_name(type)->check([](const std::string& given) {
    return given.empty() ? std::string("the name is empty; leave the option out, or give a name") : std::string();
  });
}

CLI::Validator positive() { return number_from(0, false, "a number above 0"); }
CLI::Validator not_negative() { return number_from(0, true, "a number of at least 0"); }

CLI::Validator finite() { return number_from(std::numeric_limits<double>::lowest(), true, "a finite number"); }

CLI::Validator number() {
  return {[](std::string& text) {
            double value = 0;
            return CLI::detail::lexical_cast(text, value) ? std::string() : fmt::format("'{}' is not a number", text);
          },
          ""};
}

CLI::Validator whole_number() {
  return {[](std::string& text) {
            std::uint64_t number = 0;
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
            const bool good = error == std::errc() && end == text.data() + text.size();
            return good ? std::string() : fmt::format("'{}' is not a whole number from 0 to 2^64 - 1", text);
          },
          ""};
}

void check_outputs(std::initializer_list<NamedFile> inputs, std::initializer_list<NamedFile> outputs) {
  for (const NamedFile* out = outputs.begin(); out != outputs.end(); ++out) {
    if (out->path.empty()) continue;
    const auto refuse_same = [&](const NamedFile& other, const char* why) {
      if (!other.path.empty() && base::same_file(out->path, other.path))
        throw Error(StatusCode::invalid_input,
                    fmt::format("{} {}: {} {}; give another name", out->option, out->path, why, other.option));
    };
    for (const NamedFile& in : inputs) refuse_same(in, "would replace the file of");
    for (const NamedFile* before = outputs.begin(); before != out; ++before)
      refuse_same(*before, "is also the file of");
    try {
      base::check_writable(out->path);
    } catch (const Error& error) {
      throw Error(error.status().code, fmt::format("{} {}", out->option, error.what()));
    }
  }
}

}  // namespace espalier::cli
