/// \file
/// `espalier mpi-adapter`: compiles the door to an MPI.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "base/output_file.hpp"
#include "command.hpp"
#include "common/process.hpp"
#include "common/terminal.hpp"
#include "mpi/launched_ranks.hpp"
#include "mpi/texts.hpp"

namespace espalier::cli {

namespace {

namespace fs = std::filesystem;

struct AdapterCommand {
  std::string compiler = "mpicc", out;

  int run() const;
};

// A folder that goes with its content.
class Scratch {
 public:
  Scratch() {
    std::string name = (fs::temp_directory_path() / "espalier_adapter_XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr)
      throw Error(StatusCode::invalid_input,
                  "no temporary folder can be made in " + fs::temp_directory_path().string());
    path_ = name;
  }
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

// The name of an MPI: Open MPI or others, by what the compiler says that it links.
std::string name_of_mpi(const std::string& compiler) {
  for (const char* question : {"-showme:version", "-show"}) {
    const ProcessResult said = run_program({compiler, question});
    if (said.exit_code != 0) continue;
    if ((said.output + said.errors).find("Open MPI") != std::string::npos) return "openmpi";
    if (said.output.find("mpi_abi") != std::string::npos) return "abi";
  }
  return "mpich";
}

int AdapterCommand::run() const {
  const Scratch scratch;
  fs::create_directories(scratch.path() / "espalier");
  for (const AdapterText& text : kAdapterTexts) {
    base::OutputFile file((scratch.path() / text.name).string());
    file.write(text.text);
    file.commit();
  }
  const fs::path to = out.empty()
                          ? fs::path(adapter_folder()) / fmt::format("espalier_mpi_{}.so", name_of_mpi(compiler))
                          : fs::path(out);
  std::error_code error;
  if (to.has_parent_path()) fs::create_directories(to.parent_path(), error);
  const ProcessResult made = run_program({compiler, "-O2", "-shared", "-fPIC", "-I" + scratch.path().string(),
                                          (scratch.path() / "adapter.c").string(), "-o", to.string()});
  if (made.exit_code == 127)
    throw Error(StatusCode::invalid_input,
                fmt::format("'{}' was not found; name the C compiler of your MPI with --cc", compiler));
  if (made.exit_code != 0)
    throw Error(StatusCode::invalid_input, fmt::format("'{}' cannot compile the adapter: {}", compiler, made.errors));
  print_result("{}\n", to.string());
  return kSolved;
}

}  // namespace

void add_mpi_adapter(CLI::App& app, Action& action) {
  auto command = std::make_shared<AdapterCommand>();
  CLI::App* sub = app.add_subcommand("mpi-adapter", "Compile the adapter to your MPI, for mpirun -n 4 espalier solve");
  sub->add_option("--cc", command->compiler, "C compiler of the MPI (default: mpicc)")->type_name("PROGRAM");
  sub->add_option("--out", command->out, "file (default: ~/.cache/espalier/espalier_mpi_NAME.so, where it is found)")
      ->type_name("FILE");
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
