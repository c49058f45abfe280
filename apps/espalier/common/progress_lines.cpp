#include "common/progress_lines.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "command.hpp"
#include "common/checked_options.hpp"
#include "espalier/types.hpp"

namespace espalier::cli {

namespace {

using Json = nlohmann::ordered_json;

Json number(double x) { return std::isfinite(x) ? Json(x) : Json(nullptr); }

Json counted_json(const std::string& phase, double done, double total, const std::string& unit) {
  return {{"phase", phase},
          {"done", unit.empty() ? Json(nullptr) : number(done)},
          {"total", total > 0 && !unit.empty() ? number(total) : Json(nullptr)},
          {"unit", unit.empty() ? Json(nullptr) : Json(unit)}};
}

const char* state_of(int exit_code) {
  return exit_code == kSolved ? "done" : exit_code == kInterrupted ? "stopped" : "failed";
}

}  // namespace

void ProgressLines::Options::add_to(CLI::App& command) {
  command
      .add_flag("--json-progress{-}", file,
                "write how far it is as a line of JSON, at most five times a second: to stderr, or to =FILE")
      ->type_name("[=FILE]");
  command.add_option("--json-progress-fd", descriptor, "the same, into this open file descriptor")
      ->type_name("N")
      ->check(CLI::Range(0, 1'000'000));
}

ProgressLines& ProgressLines::of_program() {
  static ProgressLines lines;
  return lines;
}

void ProgressLines::open(std::string_view command, const Options& options) {
  if (!options.wanted()) return;
  if (!options.file.empty() && options.descriptor >= 0)
    throw Error(StatusCode::invalid_input, "--json-progress=FILE and --json-progress-fd: give one of them");
  command_ = command;
  start_ = due_ = Clock::now();
  last_ = {};
  step_.reset();
  if (options.file.empty() || options.file == "-") {
    const int given = options.descriptor >= 0 ? options.descriptor : STDERR_FILENO;
    if (::fcntl(given, F_GETFL) < 0 || (::fcntl(given, F_GETFL) & O_ACCMODE) == O_RDONLY)
      throw Error(StatusCode::invalid_input,
                  fmt::format("--json-progress-fd {}: it is not open for writing; open it in the shell: {}>FILE", given,
                              given));
    descriptor_ = given;
    owned_ = false;
    return;
  }
  constexpr mode_t kReadableByAll = 0666;
  descriptor_ = ::open(options.file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, kReadableByAll);
  owned_ = true;
  if (descriptor_ < 0)
    throw Error(StatusCode::invalid_input,
                fmt::format("--json-progress: cannot write '{}': {}", options.file, std::strerror(errno)));
}

bool ProgressLines::on_stderr() const { return descriptor_ == STDERR_FILENO; }

std::string ProgressLines::members(const ProgressReport& r, double since) const {
  Json line = counted_json(r.phase, r.done, r.total, r.unit);
  line["seconds"] = r.seconds + since;
  line["seconds_left"] = number(std::isfinite(r.seconds_left) ? std::max(0.0, r.seconds_left - since) : r.seconds_left);
  line["inside"] =
      r.inside.empty() ? Json(nullptr) : counted_json(r.inside, r.inside_done, r.inside_total, r.inside_unit);
  if (step_) {
    line["time"] = number(step_->time);
    line["steps"] = step_->steps;
    line["newton"] = step_->newton;
  }
  line["elapsed"] = std::chrono::duration<double>(Clock::now() - start_).count();
  const std::string text = line.dump(-1, ' ', false, Json::error_handler_t::replace);
  return text.substr(1, text.size() - 2);
}

void ProgressLines::write(const ProgressReport& report, double since) {
  constexpr std::chrono::milliseconds kApart{200};
  if (descriptor_ < 0) return;
  // How far a phase came is not forgotten when what has counted in it has ended.
  if (report.phase != last_.phase || !report.unit.empty()) last_ = report;
  const auto now = Clock::now();
  if (now < due_) return;
  due_ = now + kApart;
  write_line(fmt::format(R"({{"what":"{}","state":"running",{}}})", command_, members(report, since)));
}

void ProgressLines::finish(int exit_code, const std::string& message) {
  if (descriptor_ < 0) return;
  const Json text = exit_code == kSolved ? "" : message;
  write_line(fmt::format(R"({{"what":"{}","state":"{}","exit_code":{},"message":{},{}}})", command_,
                         state_of(exit_code), exit_code, text.dump(-1, ' ', false, Json::error_handler_t::replace),
                         members(last_, 0)));
  if (descriptor_ >= 0 && owned_) ::close(descriptor_);
  descriptor_ = -1;
}

void ProgressLines::write_line(const std::string& text) {
  const std::string line = text + '\n';
  for (std::size_t done = 0; done < line.size();) {
    const ssize_t now = ::write(descriptor_, line.data() + done, line.size() - done);
    if (now < 0 && errno == EINTR) continue;
    if (now <= 0) {  // half a line is none
      if (owned_ && ::ftruncate(descriptor_, ::lseek(descriptor_, 0, SEEK_CUR) - static_cast<off_t>(done)) == 0)
        ::close(descriptor_);
      descriptor_ = -1;
      return;
    }
    done += static_cast<std::size_t>(now);
  }
}

}  // namespace espalier::cli
