#include "matrix/rutherford_boeing.hpp"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "matrix/fortran_format.hpp"
#include "matrix/helpers.hpp"
#include "matrix/read.hpp"

namespace espalier::matrix {
namespace rutherford_boeing_test {

// A Rutherford-Boeing file from its parts.
struct File {
  std::string type = "rua";
  int rows = 3, cols = 3, entries = 4;
  std::string pointer_format = "(4I4)", index_format = "(3I3)", value_format = "(2E12.4)";
  std::string pointers = "   1   3   4   5\n", indices = "  1  3  2\n  3\n";
  std::string values = "  1.0000E+00 -2.5000E+00\n  3.0000E-01  4.0000E+02\n";
  [[nodiscard]] std::string text() const {
    return fmt::format(
        "{:<72}{:<8}\n{:14d}{:14d}{:14d}{:14d}\n{:<14}{:14d}{:14d}{:14d}{:14d}\n{:<16}{:<16}{:<20}\n{}{}{}", "a title",
        "key", 5, 1, 2, 2, type, rows, cols, entries, 0, pointer_format, index_format, value_format, pointers, indices,
        values);
  }
  [[nodiscard]] SparseMatrix parse() const { return parse_rutherford_boeing(text(), "t.rb"); }
};

void expect_file_error(const File& file, const std::vector<std::string>& parts) {
  expect_error([&] { (void)file.parse(); }, parts);
}

// Truth: the matrix written in the text, by hand.
TEST(RutherfordBoeing, RealUnsymmetric) {
  Eigen::MatrixXd expected(3, 3);
  expected << 1, 0, 0, 0, 0.3, 0, -2.5, 0, 400;
  const auto a = File{}.parse();
  EXPECT_EQ(dense(a), expected);
  EXPECT_EQ(a.storage, Storage::general);
  EXPECT_TRUE(is_rutherford_boeing(File{}.text()));
}

TEST(RutherfordBoeing, SymmetricSkewPatternRectangular) {
  Eigen::MatrixXd symmetric(3, 3), skew(3, 3), pattern(4, 3);
  symmetric << 1, 0, -2.5, 0, 0.3, 0, -2.5, 0, 400;
  skew << 0, -1, -2.5, 1, 0, 0, 2.5, 0, 0;
  pattern << 1, 0, 0, 0, 1, 0, 1, 0, 1, 0, 0, 0;
  File file;
  file.type = "RSA";
  const auto s = file.parse();
  EXPECT_EQ(s.storage, Storage::symmetric_lower);
  File mixed;  // (1, 1), (3, 1) below, (2, 3) and (3, 3) above: one triangle, wherever an entry stands
  mixed.type = "rsa";
  mixed.pointers = "   1   3   3   5\n";
  Eigen::MatrixXd of_mixed(3, 3);
  of_mixed << 1, 0, -2.5, 0, 0, 0.3, -2.5, 0.3, 400;
  EXPECT_EQ(dense(mixed.parse()), of_mixed);
  EXPECT_EQ(dense(s), symmetric);
  File z;
  z.type = "rza";
  z.entries = 2;
  z.pointers = "   1   3   3   3\n";
  z.indices = "  2  3\n";
  z.values = "  1.0000E+00  2.5000E+00\n";
  EXPECT_EQ(dense(z.parse()), skew);
  File p;
  p.type = "pra";
  p.rows = 4;
  p.values = "";
  EXPECT_EQ(dense(p.parse()), pattern);
  ReadOptions keep;
  keep.keep_pattern = true;
  EXPECT_TRUE(parse_rutherford_boeing(p.text(), "p.rb", keep).values.empty());
}

TEST(RutherfordBoeing, FortranNumbers) {
  File file;
  file.type = "iua";
  file.value_format = "(4I5)";
  file.values = "    1   -2    3    4\n";
  EXPECT_EQ(file.parse().values, (std::vector<double>{1, -2, 3, 4}));
  file.type = "rua";
  file.value_format = "(1P,2D12.4)";
  file.values = "  1.0000D+00 -2.5000d-01\r\n  3.0000+101  4.0000D+02\n";
  EXPECT_EQ(file.parse().values, (std::vector<double>{1, -0.25, 3e101, 400}));
}

// Truth: Fortran 77's rules for edit descriptors (ANSI X3.9-1978, section 13.5.9).
TEST(FortranFormat, Parse) {
  const auto expect = [](const std::string& text, int per_line, int width, int decimals, int scale, bool real) {
    const auto f = parse_fortran_format(text);
    ASSERT_TRUE(f) << text;
    EXPECT_EQ(f->per_line, per_line) << text;
    EXPECT_EQ(f->width, width) << text;
    EXPECT_EQ(f->decimals, decimals) << text;
    EXPECT_EQ(f->scale, scale) << text;
    EXPECT_EQ(f->real, real) << text;
  };
  expect("(26I3)          ", 26, 3, 0, 0, false);
  expect("(I8)", 1, 8, 0, 0, false);
  expect("(1P,4D20.13)", 4, 20, 13, 1, true);
  expect("(1P5E16.8E3)", 5, 16, 8, 1, true);
  expect("(3(1PE25.16))", 3, 25, 16, 1, true);
  expect("(2(3E25.16))", 6, 25, 16, 0, true);
  expect("(10F8.2)", 10, 8, 2, 0, true);
  expect("(4ES23.15)", 4, 23, 15, 0, true);
  for (const char* bad : {"", "()", "(26)", "(3A4)", "(0I3)", "(3I0)", "(3I3,2I4)", "(99999999999I3)", "(3I3.1.1)"})
    EXPECT_FALSE(parse_fortran_format(bad)) << bad;
}

TEST(FortranFormat, Fields) {
  FortranFormat f{1, 10, 2, 0, true};
  double v = 0;
  EXPECT_EQ(scan_field("   12345  ", f, v), ScanError::none);
  EXPECT_DOUBLE_EQ(v, 123.45) << "implied decimal point";
  EXPECT_EQ(scan_field("  1.5", f, v), ScanError::none);
  EXPECT_EQ(v, 1.5);
  EXPECT_EQ(scan_field("   ", f, v), ScanError::none);
  EXPECT_EQ(v, 0);
  f.scale = 1;
  EXPECT_EQ(scan_field("15.0", f, v), ScanError::none);
  EXPECT_DOUBLE_EQ(v, 1.5) << "scale factor without exponent";
  EXPECT_EQ(scan_field("15.0e0", f, v), ScanError::none);
  EXPECT_EQ(v, 15.0);
  EXPECT_EQ(scan_field("1.0-3", f, v), ScanError::none);
  EXPECT_EQ(v, 1e-3) << "exponent without its letter";
  EXPECT_EQ(scan_field("nan", f, v), ScanError::not_finite);
  EXPECT_EQ(scan_field("1..2", f, v), ScanError::not_a_number);
  std::int64_t i = 0;
  EXPECT_EQ(scan_field(" 1 2 ", i), ScanError::none);
  EXPECT_EQ(i, 12) << "blanks within a field are ignored";
  EXPECT_EQ(scan_field("1.2", i), ScanError::not_a_number);
}

// Truth: the line that is wrong in the text.
TEST(RutherfordBoeing, ErrorsNameTheLine) {
  const auto with = [](const std::function<void(File&)>& change) {
    File file;
    change(file);
    return file;
  };
  expect_file_error(with([](File& f) { f.type = "cua"; }), {"t.rb:3:", "complex"});
  expect_file_error(with([](File& f) { f.type = "rue"; }), {"t.rb:3:", "elemental"});
  expect_file_error(with([](File& f) { f.type = "rha"; }), {"t.rb:3:", "hermitian"});
  expect_file_error(with([](File& f) { f.type = "xua"; }), {"t.rb:3:", "first letter"});
  expect_file_error(with([](File& f) { f.type = "rsa", f.rows = 4; }), {"t.rb:3:", "4 x 3"});
  expect_file_error(with([](File& f) { f.rows = -3; }), {"t.rb:3:", "negative"});
  expect_file_error(with([](File& f) { f.pointer_format = "(4X)"; }), {"t.rb:4:", "(4X)"});
  expect_file_error(with([](File& f) { f.index_format = "(4E12.4)"; }), {"t.rb:4:", "integers"});
  expect_file_error(with([](File& f) { f.pointers = "   1   3   2   5\n"; }), {"t.rb:5:", "'2'", "column pointer"});
  expect_file_error(with([](File& f) { f.pointers = "   2   3   4   5\n"; }), {"t.rb:5:", "'2'"});
  expect_file_error(with([](File& f) { f.pointers = "   1   3   4   4\n"; }), {"end at 3", "4 entries"});
  expect_file_error(with([](File& f) { f.indices = "  1  3  4\n  3\n"; }), {"t.rb:6:", "'4'", "1..3"});
  expect_file_error(with([](File& f) { f.indices = "  1  3  2\n  x\n"; }), {"t.rb:7:", "'x'"});
  expect_file_error(with([](File& f) { f.values = "  1.0000E+00 -2.5000E+00\n  3.0000E-01         NaN\n"; }),
                    {"t.rb:9:", "NaN"});
  expect_file_error(with([](File& f) { f.values = "  1.0000E+00 -2.5000E+00\n"; }), {"t.rb:9:", "truncated"});
  expect_file_error(with([](File& f) { f.values = ""; }), {"truncated"});
  expect_file_error(with([](File& f) { f.entries = 2000000000; }), {"t.rb:6:", "end at 4", "2000000000"});
  expect_file_error(with([](File& f) { f.rows = f.cols = 2000000000; }), {"t.rb:3:", "only 4 entries"});
  expect_error([] { (void)parse_rutherford_boeing("", "t.rb"); }, {"t.rb", "empty"});
  expect_error([] { (void)parse_rutherford_boeing("a\nb\n", "t.rb"); }, {"t.rb:3:", "truncated"});
}

// Truth: the header of a Harwell-Boeing file has a fifth line when right-hand sides follow.
TEST(RutherfordBoeing, HarwellBoeingWithRightHandSide) {
  File file;
  std::string text = file.text();
  const std::string counts = fmt::format("{:14d}{:14d}{:14d}{:14d}", 5, 1, 2, 2);
  text.replace(text.find(counts), counts.size(), counts + fmt::format("{:14d}", 1));
  const std::size_t pointers = text.find(file.pointers);
  text.insert(pointers, "F             1             0\n");
  text += "  1.0000E+00  1.0000E+00\n  1.0000E+00\n";
  EXPECT_EQ(dense(parse_rutherford_boeing(text, "t.rua")), dense(file.parse()));
}

TEST(ReadMatrix, RutherfordBoeingIsRecognised) {
  const std::string path = temporary("t.any");
  std::ofstream(path) << File{}.text();
  EXPECT_EQ(dense(read_matrix(path)), dense(File{}.parse()));
  std::filesystem::remove(path);
}

}  // namespace rutherford_boeing_test
}  // namespace espalier::matrix
