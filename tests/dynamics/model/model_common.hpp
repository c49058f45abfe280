/// \file
/// Small models as text, for the tests of the model layer.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "espalier/dynamics.hpp"
#include "places.hpp"

namespace espalier::dynamics {

inline std::string content_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream out;
  out << in.rdbuf();
  return out.str();
}

/// The fenced blocks of a page in one language.
inline std::vector<std::string> blocks(const std::string& page, const std::string& language) {
  std::vector<std::string> result;
  const std::string fence = "```" + language + "\n";
  for (std::size_t at = page.find(fence); at != std::string::npos; at = page.find(fence, at)) {
    at += fence.size();
    result.push_back(page.substr(at, page.find("```", at) - at));
  }
  return result;
}

/// The pendulum of the examples: released at rest from the horizontal at distance 1 from its hinge, gravity 10, mass 2.
inline const std::string kPendulum = content_of((espalier::test::source_folder() / "examples/pendulum.toml").string());

/// Loads and runs; fails the test with the message of the status.
inline Simulation simulated(const std::string& text, SimulationOptions options = {}) {
  Simulation simulation(std::move(options));
  Status status = simulation.load_text(text, "model.toml");
  if (status.ok()) status = simulation.run();
  EXPECT_TRUE(status.ok()) << status.message;
  return simulation;
}

/// A body "bob" of mass 2 on a hinge about z at the origin; keys of the hinge may follow.
inline std::string hinged_bob(const std::string& inertia, const std::string& position) {
  return "[bodies.bob]\ntype = \"rigid\"\nmass = 2\ninertia = [" + inertia + ", " + inertia + ", " + inertia +
         "]\nposition = " + position +
         "\n[joints.hinge]\ntype = \"revolute\"\nbodies = [\"ground\", \"bob\"]\nat = [0, 0, 0]\naxis = [0, 0, 1]\n";
}

/// A text with `what`, which it must have, replaced by `by`.
inline std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const std::size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), by);
}

/// A wrong model, and what its error must say.
struct Mistake {
  const char* name;
  std::string text;
  std::vector<std::string> says;
};

/// A fresh folder that is removed with the object.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "espalier-model-XXXXXX").string();
    path_ = mkdtemp(name.data());
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
};

/// All models of the pages and of the examples, by file.
inline std::vector<std::pair<std::string, std::string>> all_models() {
  std::vector<std::pair<std::string, std::string>> models;
  for (const char* folder : {"docs", "examples", "models"})
    for (const auto& entry : std::filesystem::recursive_directory_iterator(espalier::test::source_folder() / folder)) {
      const std::string path = entry.path().string(), text = content_of(path);
      if (entry.path().extension() == ".toml") models.emplace_back(path, text);
      if (entry.path().extension() != ".md") continue;
      for (const std::string& block : blocks(text, "toml")) models.emplace_back(path, block);
    }
  std::sort(models.begin(), models.end());
  return models;
}

}  // namespace espalier::dynamics
