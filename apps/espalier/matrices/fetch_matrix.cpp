/// \file
/// `espalier fetch-matrix`: matrices of the SuiteSparse collection into a cache folder.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <system_error>

#include "base/output_file.hpp"
#include "command.hpp"
#include "common/process.hpp"
#include "common/terminal.hpp"
#include "matrices/collection.hpp"
#include "matrix/file.hpp"

namespace espalier::cli {

namespace fs = std::filesystem;

namespace {

constexpr const char* kCollectionUrl = "https://sparse.tamu.edu";

struct FetchCommand {
  std::string name, url, sha256;
  bool list = false, force = false;

  int run() const;
};

[[noreturn]] void fail(const std::string& message) { throw Error(StatusCode::invalid_input, message); }

/// $ESPALIER_CACHE, $XDG_CACHE_HOME/espalier or ~/.cache/espalier.
fs::path cache_folder() {
  const auto variable = [](const char* name) -> std::string {
    const char* value = std::getenv(name);
    return value == nullptr ? "" : value;
  };
  if (!variable("ESPALIER_CACHE").empty()) return variable("ESPALIER_CACHE");
  if (!variable("XDG_CACHE_HOME").empty()) return fs::path(variable("XDG_CACHE_HOME")) / "espalier";
  if (!variable("HOME").empty()) return fs::path(variable("HOME")) / ".cache" / "espalier";
  fail("there is no HOME; name a folder in ESPALIER_CACHE");
}

std::string base_url(const std::string& given) {
  if (!given.empty()) return given;
  const char* chosen = std::getenv("ESPALIER_COLLECTION_URL");
  return chosen != nullptr ? chosen : kCollectionUrl;
}

/// A folder that is gone when the work is over, however it ends.
class WorkFolder {
 public:
  explicit WorkFolder(const fs::path& cache) : path_(cache / fmt::format("fetching-{}", getpid())) {
    std::error_code error;
    fs::create_directories(path_, error);
    if (error)
      fail(fmt::format("{}: cannot be made: {}; name another folder in ESPALIER_CACHE", path_.string(),
                       error.message()));
  }
  ~WorkFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// What curl's exit code means to the user (man curl, EXIT CODES).
std::string download_trouble(const ProcessResult& curl) {
  switch (curl.exit_code) {
    case 127:
      return "the program curl is not installed; install it (apt-get install curl)";
    case 5:
    case 6:
    case 7:
      return "the server cannot be reached; is there a network?";
    case 18:
      return "the download broke off; try again";
    case 22:
      return "the server does not have it";
    case 23:
      return "it cannot be written; is the disk full?";
    case 28:
      return "the server does not answer; try again later";
    default:
      return "the download failed";
  }
}

void download(const std::string& url, const fs::path& to) {
  print_hint("downloading " + url);
  const ProcessResult curl =
      run_program({"curl", "--silent", "--show-error", "--fail", "--location", "--connect-timeout", "20",
                   "--speed-limit", "1000", "--speed-time", "60", "--output", to.string(), url});
  if (curl.exit_code != 0) fail(fmt::format("{}: {} ({})", url, download_trouble(curl), curl.errors));
}

std::string checksum(const fs::path& file) {
  const ProcessResult sum = run_program({"sha256sum", "--binary", file.string()});
  if (sum.exit_code != 0 || sum.output.size() < 64) fail("sha256sum failed: " + sum.errors);
  return sum.output.substr(0, 64);
}

/// Rows as the size line of a Matrix Market file tells; -1 where it is none.
std::int64_t rows_in(const fs::path& file) {
  std::ifstream stream(file);
  std::string line;
  if (!std::getline(stream, line) || !line.starts_with("%%MatrixMarket")) return -1;
  while (std::getline(stream, line) && line.starts_with('%')) {
  }
  std::int64_t rows = -1;
  std::istringstream(line) >> rows;
  return rows;
}

std::string first_word(const fs::path& file) {
  std::error_code absent;
  if (!fs::exists(file, absent)) return {};
  std::istringstream stream{std::string(matrix::FileBytes(file.string()).bytes())};
  std::string word;
  stream >> word;
  return word;
}

/// The archive must be the one asked for, or the one that was fetched the first time.
void check_sum(const fs::path& archive, const fs::path& remembered, const std::string& wanted) {
  const std::string sum = checksum(archive);
  if (!wanted.empty() && sum != wanted)
    fail(fmt::format("the archive's SHA-256 is {}, not {}; nothing was kept", sum, wanted));
  const std::string before = first_word(remembered);
  if (wanted.empty() && !before.empty() && sum != before)
    fail(fmt::format("the archive's SHA-256 is {}, but the first download had {} ({}); nothing was kept", sum, before,
                     remembered.string()));
  base::OutputFile file(remembered.string());
  file.write(fmt::format("{}  {}\n", sum, archive.filename().string()));
  file.commit();
}

fs::path fetch(const CollectionMatrix& matrix, const FetchCommand& command) {
  const fs::path cache = cache_folder();
  fs::path target = cache / (std::string(matrix.name) + ".mtx");
  if (fs::is_regular_file(target) && !command.force) return target;
  const WorkFolder work(cache);
  const fs::path archive = work.path() / (std::string(matrix.name) + ".tar.gz");
  download(fmt::format("{}/MM/{}/{}.tar.gz", base_url(command.url), matrix.group, matrix.name), archive);
  // Unpacked first: a broken archive must not become the one that is remembered.
  const ProcessResult tar =
      run_program({"tar", "-xzf", archive.string(), "-C", work.path().string(), "--no-same-owner"});
  if (tar.exit_code != 0) fail(fmt::format("{}.tar.gz is damaged or cut off ({}); try again", matrix.name, tar.errors));
  const fs::path file = work.path() / matrix.name / (std::string(matrix.name) + ".mtx");
  if (!fs::is_regular_file(file)) fail(fmt::format("the archive has no {0}/{0}.mtx", matrix.name));
  if (const std::int64_t rows = rows_in(file); rows != matrix.rows)
    fail(fmt::format("{}.mtx has {} rows, the collection says {}; nothing was kept", matrix.name, rows, matrix.rows));
  check_sum(archive, cache / (std::string(matrix.name) + ".sha256"), command.sha256);
  fs::rename(file, target);
  return target;
}

int print_list() {
  Table table("<<>><");
  table.add({"name", "group", "rows", "entries", ""}, Tone::strong);
  for (const CollectionMatrix& matrix : collection())
    table.add({matrix.name, matrix.group, grouped(matrix.rows), grouped(matrix.nonzeros), matrix.kind});
  print_result("{}", table.text());
  return kSolved;
}

int FetchCommand::run() const {
  if (list) return print_list();
  if (name.empty()) fail("name a matrix (--list shows them)");
  for (const CollectionMatrix& matrix : collection()) {
    if (name != matrix.name) continue;
    print_result("{}\n", fetch(matrix, *this).string());
    return kSolved;
  }
  fail(fmt::format("there is no matrix '{}' in the list (espalier fetch-matrix --list)", name));
}

}  // namespace

void add_fetch_matrix(CLI::App& app, Action& action) {
  auto command = std::make_shared<FetchCommand>();
  CLI::App* sub = app.add_subcommand("fetch-matrix", "Fetch a matrix of the SuiteSparse collection; prints its path");
  sub->add_option("name", command->name, "its name, for instance Serena")->type_name("NAME");
  sub->add_flag("--list", command->list, "show the matrices");
  sub->add_flag("--force", command->force, "fetch it again");
  sub->add_option("--sha256", command->sha256, "refuse an archive with another checksum")
      ->check([](const std::string& text) {
        const bool good = text.size() == 64 && text.find_first_not_of("0123456789abcdef") == std::string::npos;
        return good ? std::string() : std::string("64 hexadecimal digits in lower case are needed");
      })
      ->type_name("HEX");
  sub->add_option("--url", command->url, "another server with the collection's folders")->type_name("URL");
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
