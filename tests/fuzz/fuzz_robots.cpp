// Arbitrary bytes as a robot, URDF or MJCF: an error that names the file, or a text that the reader of models takes.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "dynamics/model/read/value.hpp"
#include "dynamics/model/robots/robots.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace espalier;
  try {
    const auto robot =
        dynamics::model::robots::robot_as_model(std::string(reinterpret_cast<const char*>(data), size), "fuzz");
    static_cast<void>(dynamics::model::parse_toml(robot.text, "model"));
  } catch (const Error& error) {
    const std::string what = error.what();
    if (error.status().code != StatusCode::invalid_input || what.find("fuzz") == std::string::npos) std::abort();
  }
  return 0;
}
