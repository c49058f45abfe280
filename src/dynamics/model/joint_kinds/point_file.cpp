#include "dynamics/model/joint_kinds/point_file.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <string_view>

#include "base/checksum.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics::model {
namespace {

constexpr std::string_view kBetween = " \t\r,;";

/// How many of the three numbers a line begins with; four: it has more than three things.
std::size_t read_numbers(std::string_view line, Vec3& out) {
  std::size_t count = 0;
  for (;;) {
    const std::size_t begin = line.find_first_not_of(kBetween);
    if (begin == std::string_view::npos) return count;
    if (count == 3) return 4;
    line.remove_prefix(begin + (line[begin] == '+' ? 1 : 0));
    const std::size_t length = std::min(line.find_first_of(kBetween), line.size());
    double number = 0;
    const auto [end, error] = std::from_chars(line.data(), line.data() + length, number);
    if (error != std::errc() || end != line.data() + length) return count;
    out[static_cast<Eigen::Index>(count++)] = number;
    line.remove_prefix(length);
  }
}

}  // namespace

std::vector<Vec3> read_point_file(const std::string& path) {
  const std::string text = read_whole_file(path);
  std::vector<Vec3> points;
  std::size_t from = 0;
  bool first = true;
  for (int number = 1; from < text.size(); ++number) {
    const std::size_t to = std::min(text.find('\n', from), text.size());
    const std::string_view line = std::string_view(text).substr(from, to - from);
    from = to + 1;
    if (line.find_first_not_of(kBetween) == std::string_view::npos || line.front() == '#') continue;
    Vec3 point = Vec3::Zero();
    const std::size_t count = read_numbers(line, point);
    if (count == 3) points.push_back(point);
    if (count != 3 && (!first || count > 0))
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}:{}: must be a point of the curve, three numbers: x, y, z", path, number));
    first = false;
  }
  return points;
}

std::string points_digest(const std::vector<Vec3>& points) {
  base::Checksum sum;
  for (const Vec3& x : points) sum.add_list<double>(std::array{x[0], x[1], x[2]});
  return fmt::format("{:016x}", sum.value());
}

}  // namespace espalier::dynamics::model
