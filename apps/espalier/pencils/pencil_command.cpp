#include "pencils/pencil_command.hpp"

#include <fmt/format.h>

#include <optional>

#include "command.hpp"
#include "common/terminal.hpp"
#include "solve/report.hpp"

namespace espalier::cli {

void refuse_chosen_flags(const SolverFlags& flags, const std::string& who) {
  for (const char* key : {"kind", "precision", "singular"})
    if (flags.values().contains(key))
      throw Error(StatusCode::invalid_input, fmt::format("--{} has no meaning here: {} it", key, who));
}

matrix::ReadOptions reading(base::ThreadPool& pool, bool silent) {
  if (silent) return {&pool, false};
  return {&pool, false, [](const std::string& notice) { print_note("espalier: {}\n", notice); }};
}

int conclude(const PencilOutput& output, const Status& status,
             const std::function<nlohmann::ordered_json(int code)>& report, const std::function<void()>& files,
             const std::function<Sheet(const Sheet::Json& report)>& sheet, const std::string& text) {
  const bool stopped = status.code == StatusCode::cancelled;
  const int code = stopped ? static_cast<int>(kInterrupted) : exit_code(status.code);
  const nlohmann::ordered_json made = report(code);
  const std::optional<Error> unwritten = write_report(output.report_file, made);
  files();
  if (!output.page_file.empty()) write_page(output.page_file, sheet(made), output.quiet || output.json);
  if (output.json)
    print_result("{}\n", to_text(made));
  else if (!output.quiet && !stopped && !text.empty())
    print_result("{}", text);
  if (stopped)
    print_note("espalier: stopped\n");
  else if (!status.ok())
    print_error(status.message);
  if (unwritten) throw Error(*unwritten);
  return code;
}

}  // namespace espalier::cli
