// Result files are read back by an own small parser: XML nesting, offsets, bytes.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <regex>

#include "base/strtod.hpp"
#include "dynamics/output/csv.hpp"
#include "dynamics/output/vtu.hpp"

namespace espalier::dynamics::test {
namespace output_files_test {

namespace fs = std::filesystem;

std::string slurp(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Truth: every tag that opens is closed in order; attributes are quoted. `text` ends before raw data.
void expect_well_formed(const std::string& text) {
  std::vector<std::string> open;
  const std::regex tag(R"(<(/?)([A-Za-z]+)((?:\s+[A-Za-z_]+="[^"<>]*")*)\s*(/?)>)");
  std::string rest = text;
  const std::string head = "<?xml version=\"1.0\"?>";
  ASSERT_EQ(rest.rfind(head, 0), 0U);
  rest = rest.substr(head.size());
  std::size_t covered = 0;
  for (std::sregex_iterator it(rest.begin(), rest.end(), tag), end; it != end; ++it) {
    const std::string between = rest.substr(covered, static_cast<std::size_t>(it->position()) - covered);
    EXPECT_EQ(between.find_first_of("<>"), std::string::npos) << "stray bracket in '" << between << "'";
    covered = static_cast<std::size_t>(it->position() + it->length());
    if ((*it)[1] == "/") {
      ASSERT_FALSE(open.empty());
      EXPECT_EQ(open.back(), (*it)[2]);
      open.pop_back();
    } else if ((*it)[4] != "/") {
      open.push_back((*it)[2]);
    }
  }
  EXPECT_TRUE(open.empty());
}

struct Array {
  std::string type, name;
  int components;
  std::size_t offset;
};

class OutputFiles : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / fmt::format("espalier_output_{}_{}", ::getpid(),
                                                      testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

template <class T>
std::vector<T> bytes_of(const std::string& content, std::size_t start, const Array& array) {
  std::uint64_t size = 0;
  std::memcpy(&size, content.data() + start + array.offset, 8);
  std::vector<T> values(size / sizeof(T));
  EXPECT_EQ(values.size() * sizeof(T), size);
  EXPECT_LE(start + array.offset + 8 + size, content.size());
  std::memcpy(values.data(), content.data() + start + array.offset + 8, size);
  return values;
}

// Truth: what was written. All shapes are in it, with the VTK numbers of vtkCellType.h.
TEST_F(OutputFiles, VtuReadsBack) {
  VtuCells cells;
  std::vector<std::uint8_t> types;
  std::vector<std::int64_t> connectivity;
  const std::pair<ElementType, int> shapes[] = {
      {ElementType::point1, 1}, {ElementType::line2, 3},   {ElementType::tri3, 5},    {ElementType::quad4, 9},
      {ElementType::tet4, 10},  {ElementType::hex8, 12},   {ElementType::wedge6, 13}, {ElementType::pyramid5, 14},
      {ElementType::line3, 21}, {ElementType::tri6, 22},   {ElementType::quad8, 23},  {ElementType::tet10, 24},
      {ElementType::hex20, 25}, {ElementType::wedge15, 26}};
  for (const auto& [shape, vtk] : shapes) {
    std::vector<Index> nodes;
    for (int a = 0; a < shape_of(shape).nodes; ++a) nodes.push_back((7 * a + vtk) % 30);
    cells.add(shape, nodes);
    types.push_back(static_cast<std::uint8_t>(vtk));
    connectivity.insert(connectivity.end(), nodes.begin(), nodes.end());
  }
  std::vector<double> points(90), speed(90), label(types.size());
  for (std::size_t i = 0; i < 90; ++i) {
    points[i] = 0.1 * static_cast<double>(i);
    speed[i] = -1.5 * static_cast<double>(i);
  }
  for (std::size_t i = 0; i < label.size(); ++i) label[i] = static_cast<double>(i);
  const std::string path = (folder_ / "r.vtu").string();
  const OutputField point_field{"velocity <m/s> & more", 3, speed}, cell_field{"label", 1, label};
  write_vtu(path, points, cells, {&point_field, 1}, {&cell_field, 1});
  EXPECT_FALSE(fs::exists(path + ".part"));
  const std::string content = slurp(path);
  const std::size_t marker = content.find("<AppendedData encoding=\"raw\">\n_");
  ASSERT_NE(marker, std::string::npos);
  const std::size_t start = content.find('_', marker) + 1;
  const std::string tail = "\n  </AppendedData>\n</VTKFile>\n";
  ASSERT_EQ(content.substr(content.size() - tail.size()), tail);
  expect_well_formed(content.substr(0, start - 1) + tail);
  EXPECT_NE(content.find("NumberOfPoints=\"30\" NumberOfCells=\"14\""), std::string::npos);

  std::vector<Array> arrays;
  const std::regex declaration(
      "<DataArray type=\"([^\"]*)\" Name=\"([^\"]*)\" NumberOfComponents=\"([0-9]+)\" format=\"appended\" "
      "offset=\"([0-9]+)\"/>");
  for (std::sregex_iterator it(content.begin(), content.begin() + static_cast<std::ptrdiff_t>(start), declaration), end;
       it != end; ++it)
    arrays.push_back({(*it)[1], (*it)[2], std::stoi((*it)[3]), std::stoul((*it)[4])});
  ASSERT_EQ(arrays.size(), 6U);
  std::size_t expected = 0;  // arrays follow each other without gaps
  for (const Array& a : arrays) {
    EXPECT_EQ(a.offset, expected) << a.name;
    std::uint64_t size = 0;
    std::memcpy(&size, content.data() + start + a.offset, 8);
    expected += 8 + size;
  }
  EXPECT_EQ(start + expected + tail.size(), content.size());
  EXPECT_EQ(bytes_of<double>(content, start, arrays[0]), points);
  EXPECT_EQ(bytes_of<std::int64_t>(content, start, arrays[1]), connectivity);
  const auto offsets = bytes_of<std::int64_t>(content, start, arrays[2]);
  ASSERT_EQ(offsets.size(), types.size());
  EXPECT_EQ(offsets.back(), static_cast<std::int64_t>(connectivity.size()));
  EXPECT_EQ(bytes_of<std::uint8_t>(content, start, arrays[3]), types);
  EXPECT_EQ(arrays[4].name, "velocity &lt;m/s&gt; &amp; more");
  EXPECT_EQ(arrays[4].components, 3);
  EXPECT_EQ(bytes_of<double>(content, start, arrays[4]), speed);
  EXPECT_EQ(bytes_of<double>(content, start, arrays[5]), label);
}

TEST_F(OutputFiles, VtuRefusesWrongFields) {
  VtuCells cells;
  const std::vector<double> points(9), three(3);
  const OutputField wrong{"v", 3, three};
  EXPECT_THROW(write_vtu((folder_ / "a.vtu").string(), points, cells, {&wrong, 1}, {}), std::invalid_argument);
  EXPECT_THROW(write_vtu((folder_ / "no/such/folder/a.vtu").string(), points, cells, {}, {}), Error);
  EXPECT_THROW(cells.add(ElementType::hex8, std::vector<Index>{1, 2}), std::invalid_argument);
}

// Truth: the series lists every file once, with its time and part, after every step.
TEST_F(OutputFiles, PvdSeriesListsTheSteps) {
  const fs::path path = folder_ / "run.pvd";
  PvdSeries series(path.string());
  for (int step = 0; step < 3; ++step)
    for (int part = 0; part < 2; ++part) {
      const fs::path file = series.file_name(part);
      EXPECT_EQ(file.filename().string(), fmt::format("run_{}_{:06}.vtu", part, step));
      EXPECT_EQ(file.parent_path(), folder_);
      series.add(0.1 * step, part);
    }
  const std::string content = slurp(path);
  expect_well_formed(content);
  const std::regex entry("<DataSet timestep=\"([^\"]*)\" part=\"([0-9])\" file=\"([^\"]*)\"/>");
  std::vector<std::string> files;
  for (std::sregex_iterator it(content.begin(), content.end(), entry), end; it != end; ++it) {
    EXPECT_EQ(base::strtod((*it)[1].str().c_str()), 0.1 * static_cast<double>(files.size() / 2));
    files.push_back((*it)[3]);
  }
  ASSERT_EQ(files.size(), 6U);
  EXPECT_EQ(files[5], "run_1_000002.vtu");
}

// Truth: numbers read back to the same bits; names are quoted where they must be.
TEST_F(OutputFiles, CsvReadsBack) {
  const std::string path = (folder_ / "q.csv").string();
  const std::vector<double> q = {1.0 / 3, -2e-300};
  {
    CsvWriter csv(path, {{"x [m]", [](const StateView& s) { return s.q[0]; }},
                         {"a, \"b\"", [](const StateView& s) { return s.q[1]; }}});
    StateView state;
    state.q = q;
    for (const double t : {0.0, 0.1, 0.30000000000000004}) {
      state.t = t;
      csv.write(state);
    }
    EXPECT_EQ(csv.lines(), 3);
  }
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  EXPECT_EQ(line, "time,x [m],\"a, \"\"b\"\"\"");
  std::vector<double> times;
  while (std::getline(file, line)) {
    char* end = nullptr;
    const double t = base::strtod(line.c_str(), &end);
    ASSERT_EQ(*end, ',');
    const double x = base::strtod(end + 1, &end);
    ASSERT_EQ(*end, ',');
    const double y = base::strtod(end + 1, &end);
    ASSERT_EQ(*end, '\0');
    times.push_back(t);
    EXPECT_EQ(x, q[0]);
    EXPECT_EQ(y, q[1]);
  }
  EXPECT_EQ(times, (std::vector<double>{0.0, 0.1, 0.30000000000000004}));
  EXPECT_THROW(CsvWriter((folder_ / "no/such/q.csv").string(), {}), Error);
}

}  // namespace output_files_test
}  // namespace espalier::dynamics::test
