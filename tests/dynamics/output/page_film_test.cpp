// What the page holds of a run. Truth: numbers that are known, read back by a decoder of the test's own.
#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <regex>

#include "base/strtod.hpp"
#include "dynamics/model/model_common.hpp"
#include "dynamics/page/json_text.hpp"
#include "dynamics/page/packed.hpp"
#include "dynamics/page/rows.hpp"

namespace espalier::dynamics {
namespace page_film_test {

std::string from_letters(const std::string& text) {
  std::string out;
  unsigned bits = 0, count = 0;
  for (const char c : text) {
    if (c == '=') break;
    const auto digit = std::string_view("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/").find(c);
    bits = (bits << 6U) | static_cast<unsigned>(digit);
    if ((count += 6) >= 8) out += static_cast<char>((bits >> (count -= 8)) & 255U);
  }
  return out;
}

std::string unpacked(const std::string& bytes) {
  z_stream stream{};
  inflateInit2(&stream, 15 + 16);
  std::string out(1'000'000, '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  out.resize(stream.total_out);
  inflateEnd(&stream);
  return out;
}

std::string block_of(const std::string& page, const std::string& id) {
  const std::string mark = "id=\"" + id + "\">";
  const std::size_t from = page.find(mark);
  EXPECT_NE(from, std::string::npos) << id;
  return page.substr(from + mark.size(), page.find("</script>", from) - from - mark.size());
}

TEST(PagePacked, LettersAndGzipComeBack) {
  for (const std::size_t size : {0U, 1U, 2U, 3U, 4U, 1000U}) {
    std::string bytes;
    for (std::size_t k = 0; k < size; ++k) bytes += static_cast<char>(k * k + 251 * k);
    EXPECT_EQ(from_letters(page::base64(bytes)), bytes);
    EXPECT_EQ(unpacked(page::compressed(bytes)), bytes);
  }
}

TEST(PagePacked, NumbersAreOneStepExactAndNoNumberIsNone) {
  page::Quantized q;
  const std::vector<double> values = {-3, 5, std::nan(""), 0.123, HUGE_VAL, 5, -2.9999};
  q.add(values);
  ASSERT_EQ(q.ranges, (std::vector<double>{-3, 5}));
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (!std::isfinite(values[k])) {
      EXPECT_EQ(q.steps[k], 65535);
      continue;
    }
    EXPECT_NEAR(-3 + q.steps[k] * 8.0 / 65534, values[k], 0.51 * 8.0 / 65534);
  }
  q.add(std::vector<double>{7, 7});
  EXPECT_EQ(q.steps.back(), 0);
  EXPECT_EQ(q.ranges[2], 7);
  EXPECT_EQ(page::split_bytes(std::vector<std::uint16_t>{0x0102, 0x0304}), std::string("\x02\x04\x01\x03"));
}

TEST(PageText, HasNoMarkup) {
  EXPECT_EQ(page::json_text("</script>&'\"\\\n"), R"("\u003c/script\u003e\u0026\u0027\u0022\u005c\u000a")");
  EXPECT_EQ(page::json_text("\xC3\xA4\xE2\x80\xA8"), "\"\xC3\xA4\xE2\x80\xA8\"");
  for (const char* broken : {"\xC3", "\xFF", "\xC0\xAF", "\xED\xA0\x80", "\xF5\x80\x80\x80", "\xE2\x82"})
    EXPECT_NE(page::json_text(broken).find("\\ufffd"), std::string::npos);
  EXPECT_EQ(page::json_number(std::nan("")), "null");
  EXPECT_EQ(base::strtod(page::json_number(0.1).c_str()), 0.1);
}

TEST(PageRows, AreThinnedOutEvenlyAndKeepTheLast) {
  page::Rows rows;
  rows.begin({"a"});
  constexpr int kRows = 50'001;
  for (int k = 0; k <= kRows; ++k) rows.add(k, {2.0 * k});
  EXPECT_EQ(rows.stride(), 4);
  const std::vector<double> columns = rows.columns();
  const std::size_t count = columns.size() / 2;
  EXPECT_EQ(columns[count - 1], kRows);
  for (std::size_t k = 0; k < count; ++k) {
    if (k + 1 < count) {
      EXPECT_EQ(columns[k], 4.0 * static_cast<double>(k));
    }
    EXPECT_EQ(columns[count + k], 2 * columns[k]);
  }
  rows.restore(100);
  EXPECT_EQ(rows.columns()[rows.columns().size() / 2 - 1], 100);
}

// The pendulum's bob in the page is where the quantities say, at even times.
TEST(PageFilm, ShowsTheMotionAtEvenTimes) {
  SimulationOptions options;
  options.keep_page = options.keep_series = true;
  const Simulation simulation = simulated(kPendulum, options);
  const std::string text = simulation.page(), data = block_of(text, "data");
  std::vector<double> times;
  const std::regex frame(R"(\{"t":([-0-9.e+]+),"piece":(\d+),"place":(\d+),"ranges":\[([^\]]*)\])");
  std::size_t checked = 0;
  for (std::sregex_iterator it(data.begin(), data.end(), frame), end; it != end; ++it) {
    times.push_back(base::strtod((*it)[1].str().c_str()));
    std::vector<double> ranges;
    std::istringstream list((*it)[4]);
    for (std::string number; std::getline(list, number, ',');) ranges.push_back(base::strtod(number.c_str()));
    ASSERT_GE(ranges.size(), 14U);
    // The sections px, py, pz of one body: each range is the place itself. The hinge is the origin, the arm 1 long.
    EXPECT_NEAR(std::hypot(ranges[6], ranges[8], ranges[10]), 1, 1e-5);
    ++checked;
  }
  ASSERT_GE(times.size(), 200U);
  EXPECT_EQ(checked, times.size());
  const double interval = (times.back() - times.front()) / static_cast<double>(times.size() - 1);
  for (std::size_t k = 0; k < times.size(); ++k)
    EXPECT_NEAR(times[k], times[0] + interval * static_cast<double>(k), 1e-9);
  EXPECT_EQ(times.back(), simulation.end_time());
}

TEST(PageFilm, OfAModelThatHasNotRunHasOnePicture) {
  Simulation simulation;
  ASSERT_TRUE(simulation.load_text(kPendulum, "model.toml").ok());
  const std::string data = block_of(simulation.page(), "data");
  EXPECT_EQ(data.find("\"frames\":[{\"t\":0,"), data.rfind("\"frames\":["));
  EXPECT_EQ(data.find("},{\"t\":"), std::string::npos);
}

TEST(PageFilm, DropsWhatAnEarlierStateUndoes) {
  SimulationOptions options;
  options.keep_page = true;
  Simulation simulation(options);
  ASSERT_TRUE(simulation.load_text(kPendulum, "model.toml").ok());
  const double end = simulation.end_time();
  ASSERT_TRUE(simulation.step_to(0.5 * end).ok());
  const std::string state = simulation.save();
  ASSERT_TRUE(simulation.step_to(0.9 * end).ok());
  ASSERT_TRUE(simulation.restore(state).ok());
  ASSERT_TRUE(simulation.run().ok());
  const std::string data = block_of(simulation.page(), "data");
  double before = -1;
  std::size_t count = 0;
  const std::regex frame(R"(\{"t":([-0-9.e+]+),"piece")");
  for (std::sregex_iterator it(data.begin(), data.end(), frame), last; it != last; ++it, ++count) {
    EXPECT_GT(base::strtod((*it)[1].str().c_str()), before);
    before = base::strtod((*it)[1].str().c_str());
  }
  EXPECT_GE(count, 200U);
  EXPECT_EQ(before, end);
}

TEST(PageFilm, FolderHasItUnlessItIsNotWanted) {
  const ScratchFolder folder;
  SimulationOptions options;
  options.out = folder.path() + "/a";
  const Simulation with = simulated(kPendulum, options);
  EXPECT_EQ(with.summary().files.back(), options.out + "/index.html");
  EXPECT_TRUE(std::filesystem::exists(options.out + "/index.html"));
  options.out = folder.path() + "/b";
  options.page = false;
  simulated(kPendulum, options);
  EXPECT_FALSE(std::filesystem::exists(options.out + "/index.html"));
}

}  // namespace page_film_test
}  // namespace espalier::dynamics
