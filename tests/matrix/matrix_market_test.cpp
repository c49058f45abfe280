#include "matrix/matrix_market.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>

#include "matrix/file.hpp"
#include "matrix/helpers.hpp"
#include "matrix/read.hpp"
#include "matrix/transform.hpp"

namespace espalier::matrix {
namespace matrix_market_test {

SparseMatrix parse(const std::string& text, const ReadOptions& options = {}) {
  return parse_matrix_market(text, "t.mtx", options);
}

void expect_parse_error(const std::string& text, const std::vector<std::string>& parts) {
  expect_error([&] { (void)parse(text); }, parts);
}

// Truth: the matrices written in the texts, by hand.

TEST(MatrixMarket, CoordinateRealGeneral) {
  const auto a = parse(
      "%%MatrixMarket matrix coordinate real general\n% a comment\n\n 3 2 4 \n3 1 -1.5e0\n1 1 +2\n% inside\n\n"
      "2 2 1d2\r\n  1\t2 .25   ");
  EXPECT_EQ(a.storage, Storage::general);
  EXPECT_EQ(a.rows, 3);
  EXPECT_EQ(a.cols, 2);
  EXPECT_EQ(a.col_ptr, (std::vector<Offset>{0, 2, 4}));
  EXPECT_EQ(a.row_ind, (std::vector<Index>{0, 2, 0, 1}));
  EXPECT_EQ(a.values, (std::vector<double>{2, -1.5, 0.25, 100}));
}

// Files above 1 MiB are read in blocks; what comments and blank lines leave between them is closed.
TEST(MatrixMarket, CommentsInsideLargeFiles) {
  constexpr Index kRows = 400, kColumns = 300;
  std::string text = fmt::format("%%MatrixMarket matrix coordinate real general\n{} {} {}\n", kRows, kColumns,
                                 Offset{kRows} * kColumns);
  std::vector<double> expected;
  for (Index c = 0; c < kColumns; ++c)
    for (Index r = 0; r < kRows; ++r) {
      expected.push_back(1 + 0.25 * r + 100.0 * c);
      text += fmt::format("{} {} {:.2f}\n", r + 1, c + 1, expected.back());
      if ((r + c) % 5 == 0) text += "% between entries\n\n";
    }
  ASSERT_GT(text.size(), std::size_t{2} << 20);
  for (const int threads : {1, 3}) {
    base::ThreadPool pool(threads);
    ReadOptions options;
    options.pool = &pool;
    const SparseMatrix a = parse(text, options);
    EXPECT_EQ(a.values, expected);
    ASSERT_EQ(a.row_ind.size(), expected.size());
    for (std::size_t k = 0; k < a.row_ind.size(); ++k) ASSERT_EQ(a.row_ind[k], static_cast<Index>(k % kRows));
  }
}

TEST(MatrixMarket, BannerIsCaseInsensitive) {
  EXPECT_EQ(parse("%%matrixmarket MATRIX Coordinate INTEGER General\n1 1 1\n1 1 7\n").values, std::vector<double>{7});
}

TEST(MatrixMarket, DuplicatesAreSummedAndZerosStay) {
  const auto a = parse("%%MatrixMarket matrix coordinate integer general\n2 2 4\n1 1 2\n2 2 0\n1 1 3\n2 1 1\n");
  EXPECT_EQ(a.row_ind, (std::vector<Index>{0, 1, 1}));
  EXPECT_EQ(a.values, (std::vector<double>{5, 1, 0}));
}

TEST(MatrixMarket, PatternGivesOnesOrNothing) {
  const std::string text = "%%MatrixMarket matrix coordinate pattern general\n2 3 4\n1 1\n2 3\n1 1\n2 1\n";
  EXPECT_EQ(parse(text).values, (std::vector<double>{1, 1, 1}));
  ReadOptions options;
  options.keep_pattern = true;
  const auto pattern = parse(text, options);
  EXPECT_TRUE(pattern.values.empty());
  EXPECT_EQ(pattern.row_ind, (std::vector<Index>{0, 1, 1}));
}

TEST(MatrixMarket, SymmetricTakesEitherTriangle) {
  const std::string head = "%%MatrixMarket matrix coordinate real symmetric\n3 3 3\n";
  const auto lower = parse(head + "1 1 4\n3 1 5\n3 2 6\n");
  const auto upper = parse(head + "1 1 4\n1 3 5\n2 3 6\n");
  const auto mixed = parse(head + "1 1 4\n1 3 5\n3 2 6\n");
  EXPECT_EQ(lower.storage, Storage::symmetric_lower);
  EXPECT_EQ(lower.row_ind, (std::vector<Index>{0, 2, 2}));
  EXPECT_EQ(lower.values, (std::vector<double>{4, 5, 6}));
  EXPECT_EQ(dense(upper), dense(lower));
  EXPECT_EQ(dense(mixed), dense(lower));
}

TEST(MatrixMarket, BothTrianglesOfASymmetricFile) {
  const std::string head = "%%MatrixMarket matrix coordinate real symmetric\n2 2 3\n";
  const auto once = parse(head + "1 1 4\n2 1 5\n1 2 5\n");
  EXPECT_EQ(once.values, (std::vector<double>{4, 5}));
  // Only then anybody hears of it.
  std::vector<std::string> said;
  ReadOptions options;
  options.notice = [&](const std::string& text) { said.push_back(text); };
  (void)parse_matrix_market(head + "1 1 4\n2 1 5\n1 2 5\n", "t.mtx", options);
  ASSERT_EQ(said.size(), 1U);
  EXPECT_NE(said[0].find("both triangles"), std::string::npos);
  for (const char* entries : {"1 1 4\n2 1 5\n2 2 1\n", "1 1 4\n1 2 5\n2 2 1\n"})  // one triangle
    (void)parse_matrix_market(head + entries, "t.mtx", options);
  const std::string mixed = "%%MatrixMarket matrix coordinate real symmetric\n3 3 3\n1 1 4\n1 3 5\n3 2 6\n";
  (void)parse_matrix_market(mixed, "t.mtx", options);  // entries of both, none twice
  EXPECT_EQ(said.size(), 1U);
  expect_parse_error(head + "1 1 4\n2 1 5\n1 2 6\n", {"t.mtx:5:", "(1, 2) is 6", "(2, 1)", "is 5"});
}

TEST(MatrixMarket, SkewIsExpanded) {
  const std::string head = "%%MatrixMarket matrix coordinate real skew-symmetric\n";
  Eigen::MatrixXd expected(3, 3);
  expected << 0, -2, 0, 2, 0, 3, 0, -3, 0;
  EXPECT_EQ(dense(parse(head + "3 3 2\n2 1 2\n3 2 -3\n")), expected);
  EXPECT_EQ(dense(parse(head + "3 3 2\n1 2 -2\n2 3 3\n")), expected) << "upper triangle";
  EXPECT_EQ(dense(parse(head + "3 3 4\n1 2 -2\n2 3 3\n2 1 2\n1 1 0\n")), expected)
      << "both, and a zero on the diagonal";
  EXPECT_EQ(parse(head + "3 3 2\n2 1 2\n3 2 -3\n").storage, Storage::general);
  expect_parse_error(head + "2 2 1\n1 1 1\n", {"t.mtx:3:", "diagonal"});
  expect_parse_error(head + "2 2 2\n2 1 1\n1 2 1\n", {"t.mtx:4:", "skew"});
}

TEST(MatrixMarket, Arrays) {
  Eigen::MatrixXd general(2, 3), symmetric(2, 2), skew(2, 2);
  general << 1, 0, 5, 2, 4, 6;
  symmetric << 1, 2, 2, 3;
  skew << 0, -7, 7, 0;
  const auto a = parse("%%MatrixMarket matrix array real general\n2 3\n1\n2\n0\n4\n5 6\n");
  EXPECT_EQ(dense(a), general);
  EXPECT_EQ(a.nonzeros(), 5) << "exact zeros of an array are not entries";
  EXPECT_EQ(dense(parse("%%MatrixMarket matrix array real symmetric\n2 2\n1\n2\n3\n")), symmetric);
  EXPECT_EQ(dense(parse("%%MatrixMarket matrix array real skew-symmetric\n2 2\n7\n")), skew);
}

TEST(MatrixMarket, Vectors) {
  const auto read = [](const std::string& text) { return parse_matrix_market_vectors(text, "b.mtx"); };
  const auto array = read("%%MatrixMarket matrix array real general\n2 2\n1\n2\n3\n4\n");
  EXPECT_EQ(array.rows, 2);
  EXPECT_EQ(array.cols, 2);
  EXPECT_EQ(array.values, (std::vector<double>{1, 2, 3, 4}));
  const auto sparse = read("%%MatrixMarket matrix coordinate real general\n3 2 3\n3 1 5\n1 2 6\n1 2 1\n");
  EXPECT_EQ(sparse.values, (std::vector<double>{0, 0, 5, 7, 0, 0}));
  EXPECT_EQ(read("%%MatrixMarket matrix array real symmetric\n2 2\n1\n2\n3\n").values,
            (std::vector<double>{1, 2, 2, 3}));
  EXPECT_EQ(read("%%MatrixMarket matrix array real skew-symmetric\n2 2\n7\n").values,
            (std::vector<double>{0, 7, -7, 0}));
}

TEST(MatrixMarket, PatternsAreVectorsOfOnes) {
  ReadOptions options;
  options.keep_pattern = true;
  const std::string text = "%%MatrixMarket matrix coordinate pattern general\n3 2 2\n1 1\n3 2\n";
  EXPECT_EQ(parse_matrix_market_vectors(text, "t.mtx", options).values, (std::vector<double>{1, 0, 0, 0, 0, 1}));
}

TEST(MatrixMarket, EmptyAndTiny) {
  EXPECT_EQ(parse("%%MatrixMarket matrix coordinate real general\n0 0 0\n").rows, 0);
  EXPECT_EQ(parse("%%MatrixMarket matrix coordinate real general\n3 2 0").nonzeros(), 0);
  EXPECT_EQ(parse("%%MatrixMarket matrix coordinate real symmetric\n1 1 1\n1 1 2").values, std::vector<double>{2});
}

// Truth: the line that is wrong in the text.
TEST(MatrixMarket, ErrorsNameTheLine) {
  const std::string head = "%%MatrixMarket matrix coordinate real general\n% c\n2 2 2\n1 1 1\n";
  expect_parse_error("", {"t.mtx", "empty"});
  expect_parse_error("1 1 1\n", {"t.mtx:1:", "%%MatrixMarket"});
  expect_parse_error("%%MatrixMarket matrix coordinate complex general\n1 1 1\n1 1 1 1\n", {"t.mtx:1:", "complex"});
  expect_parse_error("%%MatrixMarket matrix coordinate real hermitian\n1 1 1\n1 1 1\n", {"t.mtx:1:", "hermitian"});
  expect_parse_error("%%MatrixMarket vector coordinate real general\n1 1 1\n", {"t.mtx:1:", "vector"});
  expect_parse_error("%%MatrixMarket matrix array pattern general\n1 1\n", {"t.mtx:1:", "pattern"});
  expect_parse_error("%%MatrixMarket matrix coordinate real general\n% only\n", {"t.mtx:3:", "size line"});
  expect_parse_error("%%MatrixMarket matrix coordinate real general\n2 2\n", {"t.mtx:2:", "3 integers"});
  expect_parse_error("%%MatrixMarket matrix coordinate real general\n2 2 1 1\n1 1 1\n", {"t.mtx:2:"});
  expect_parse_error("%%MatrixMarket matrix coordinate real symmetric\n2 3 1\n1 1 1\n", {"t.mtx:2:", "2 x 3"});
  expect_parse_error(head, {"t.mtx:3:", "promises 2", "1 lines"});
  expect_parse_error(head + "% not an entry\n", {"t.mtx:6:", "ends after 1 of the 2"});
  expect_parse_error(head + "2 2 1\n\n1 2 1\n", {"t.mtx:7:", "entry 3"});
  expect_parse_error(head + "3 1 1\n", {"t.mtx:5:", "row index 3", "1..2"});
  expect_parse_error(head + "1 0 1\n", {"t.mtx:5:", "column index 0", "begin at 1"});
  expect_parse_error(head + "1 -1 1\n", {"t.mtx:5:", "-1"});
  expect_parse_error(head + "99999999999999999999 1 1\n", {"t.mtx:5:", "row index"});
  expect_parse_error(head + "1 2\n", {"t.mtx:5:", "ends before the value"});
  expect_parse_error(head + "1\n", {"t.mtx:5:", "ends before the column"});
  expect_parse_error(head + "1 2 x\n", {"t.mtx:5:", "'x'"});
  expect_parse_error(head + "1 2 nan\n", {"t.mtx:5:", "'nan'", "not finite"});
  expect_parse_error(head + "1 2 -inf\n", {"t.mtx:5:", "not finite"});
  expect_parse_error(head + "1 2 1e999\n", {"t.mtx:5:", "too large"});
  expect_parse_error(head + "1 2 3 4\n", {"t.mtx:5:", "'4' follows"});
  expect_parse_error(head + "1.5 2 3\n", {"t.mtx:5:", "row index '1.5'"});
  expect_parse_error("%%MatrixMarket matrix array real general\n2 2\n1\n2\n3\n", {"t.mtx:2:", "4"});
  expect_parse_error("%%MatrixMarket matrix array real general\n2 2\n1.0\n2.0\n3.0\n", {"t.mtx:6:", "3 of the 4"});
  expect_parse_error("%%MatrixMarket matrix array real general\n1 1\n1\n2\n", {"more numbers than the 1"});
}

// Truth: the promise of the header, that nothing large is allocated for a lie.
TEST(MatrixMarket, LyingHeadersAllocateNothing) {
  const std::string head = "%%MatrixMarket matrix coordinate real general\n";
  expect_parse_error(head + "10 10 4000000000000000\n1 1 1\n", {"t.mtx:2:", "promises"});
  expect_parse_error(head + "2000000000 2000000000 1\n1 1 1\n", {"t.mtx:2:", "only 1 entries"});
  expect_parse_error(head + "3000000000 1 1\n1 1 1\n", {"t.mtx:2:", "at most"});
  expect_parse_error(head + "99999999999999999999 1 1\n1 1 1\n", {"t.mtx:2:"});
  expect_parse_error(head + "-1 1 1\n1 1 1\n", {"t.mtx:2:", "negative"});
  expect_parse_error("%%MatrixMarket matrix array real general\n2000000000 2000000000\n1\n", {"t.mtx:2:"});
  for (const char* sizes : {"0 1400000000\n", "1400000000 0\n"}) {  // an array without numbers
    const std::string text = std::string("%%MatrixMarket matrix array real general\n") + sizes;
    expect_parse_error(text, {"t.mtx:2:", "only 0 entries"});
    expect_error([&] { (void)parse_matrix_market_vectors(text, "b.mtx"); }, {"b.mtx:2:"});
  }
  expect_error(
      [] {
        (void)parse_matrix_market_vectors("%%MatrixMarket matrix coordinate real general\n4000000 4000000 1\n1 1 1\n",
                                          "b.mtx");
      },
      {"b.mtx", "right-hand side"});
}

// Truth: the compiler, on numbers that are hard to read.
TEST(MatrixMarket, NumbersAreReadAsTheCompilerReadsThem) {
  const std::pair<const char*, double> numbers[] = {
      {"1", 1},
      {"-0.0", -0.0},
      {"1e-400", 0},
      {"4.9e-324", 4.9e-324},
      {"2.2250738585072011e-308", 2.2250738585072011e-308},
      {"1.7976931348623157e308", 1.7976931348623157e308},
      {"1E5", 1e5},
      {"123456789012345678901234567890", 123456789012345678901234567890.0},
      {"0.1", 0.1},
      {".5", 0.5},
      {"5.", 5},
      {"+1.25e+2", 125},
      {"1e-5", 1e-5}};
  for (const auto& [word, number] : numbers) {
    const auto a = parse(fmt::format("%%MatrixMarket matrix coordinate real general\n1 1 1\n1 1 {}\n", word));
    EXPECT_EQ(a.values[0], number) << word;
  }
}

void expect_same(const SparseMatrix& a, const SparseMatrix& b) {
  EXPECT_EQ(a.col_ptr, b.col_ptr);
  EXPECT_EQ(a.row_ind, b.row_ind);
  EXPECT_EQ(a.values, b.values);
  EXPECT_EQ(a.storage, b.storage);
}

// Truth: the matrix that was written; identity of bits, in files of several blocks, with and without threads and gzip.
TEST(MatrixMarket, WrittenAndReadBackTheSameBits) {
  base::ThreadPool pool(3);
  ReadOptions threaded;
  threaded.pool = &pool;
  auto a = random_matrix(3000, 3000, 40, Storage::symmetric_lower, 7);
  std::mt19937_64 rng(3);
  for (auto& v : a.values) v = std::ldexp(static_cast<double>(rng() >> 11), static_cast<int>(rng() % 2000) - 1070);
  a = to_lower(a);
  for (const char* name : {"a.mtx", "a.mtx.gz"}) {
    const std::string path = temporary(name);
    write_matrix_market(path, a, "two\nlines", &pool);
    if (std::string(name) == "a.mtx") {
      EXPECT_GT(std::filesystem::file_size(path), std::size_t{2} << 20) << "the file has several blocks";
    }
    expect_same(read_matrix(path), a);
    expect_same(read_matrix(path, threaded), a);
    std::filesystem::remove(path);
  }
}

TEST(MatrixMarket, EveryStorageIsWritten) {
  const std::string path = temporary("s.mtx");
  for (const auto storage :
       {Storage::general, Storage::symmetric_lower, Storage::symmetric_upper, Storage::symmetric_both}) {
    auto a = random_matrix(9, 9, 3, storage == Storage::symmetric_both ? Storage::symmetric_lower : storage, 11);
    if (storage == Storage::symmetric_both) {
      a = to_general(a);
      a.storage = storage;
    }
    write_matrix_market(path, a);
    const auto b = read_matrix(path);
    EXPECT_EQ(dense(b), dense(a));
    EXPECT_EQ(b.symmetric(), a.symmetric());
    a.values.clear();
    write_matrix_market(path, a);
    EXPECT_EQ(dense(read_matrix(path)), dense(a).cwiseMin(1.0)) << "pattern";
  }
  std::filesystem::remove(path);
}

TEST(MatrixMarket, VectorsAreWrittenAndReadBack) {
  const std::string path = temporary("b.mtx.gz");
  const std::vector<double> b{1, -0.1, 1e-300, 1.0 / 3, 5, std::numeric_limits<double>::max()};
  write_matrix_market_vectors(path, 3, 2, b);
  const auto read = std::get<DenseVectors>(read_any_vectors(path));
  EXPECT_EQ(read.rows, 3);
  EXPECT_EQ(read.cols, 2);
  EXPECT_EQ(read.values, b);
  std::filesystem::remove(path);
  EXPECT_THROW(write_matrix_market_vectors(path, 2, 2, b), std::invalid_argument);
}

// Truth: the first wrong line, whatever thread finds a later one first.
TEST(MatrixMarket, TheFirstOfManyErrorsIsReported) {
  const int n = 400000;
  std::string text = fmt::format("%%MatrixMarket matrix coordinate real general\n{} {} {}\n", n, n, n);
  for (int i = 1; i <= n; ++i) text += fmt::format("{} {} {}\n", i, i, i % 100000 == 54321 ? "bad" : "1.5");
  base::ThreadPool pool(4);
  ReadOptions options;
  options.pool = &pool;
  expect_error([&] { (void)parse(text, options); }, {"t.mtx:54323:", "'bad'"});
}

TEST(ReadMatrix, FilesThatCannotBeRead) {
  expect_error([] { (void)read_matrix("/nonexistent/a.mtx"); }, {"/nonexistent/a.mtx", "No such file"});
  expect_error([] { (void)read_matrix(testing::TempDir()); }, {"directory"});
  const std::string path = temporary("x.mtx");
  const auto write = [&](const std::string& bytes) { std::ofstream(path, std::ios::binary) << bytes; };
  write("");
  expect_error([&] { (void)read_matrix(path); }, {path, "empty"});
  write("hello\nworld\n");
  expect_error([&] { (void)read_matrix(path); }, {path + ":1:", "neither"});
  write(std::string("\xff\xfe%\0%\0", 6));
  expect_error([&] { (void)read_matrix(path); }, {path, "UTF-16"});
  write(std::string("\xfe\xff\0%\0%", 6));
  expect_error([&] { (void)read_matrix(path); }, {path, "UTF-16"});
  write("\x1f\x8b nonsense that is not gzip");
  expect_error([&] { (void)read_matrix(path); }, {path, "gzip"});
  std::filesystem::remove(path);
  expect_error(
      [&] {
        write_matrix_market("/nonexistent/a.mtx", SparseMatrix{0, 0, {0}, {}, {}, Storage::general});
      },
      {"/nonexistent/a.mtx", "cannot be written"});
}

TEST(ReadMatrix, DevicesThatNeverEnd) {
  try {
    const FileBytes file("/dev/urandom", {}, Offset{3} << 20);
    FAIL() << "read " << file.bytes().size() << " bytes";
  } catch (const Error& error) {
    EXPECT_EQ(error.status().code, StatusCode::out_of_memory);
    EXPECT_NE(error.status().message.find("/dev/urandom: brings more than 3.00 MiB"), std::string::npos)
        << error.what();
  }
  const FileBytes zeros("/dev/zero", {}, Offset{3} << 20);
  EXPECT_LT(zeros.bytes().size(), std::size_t{2} << 20) << "no format begins so: the beginning says it";
}

TEST(ReadMatrix, TruncatedGzip) {
  const std::string path = temporary("t.mtx.gz");
  write_matrix_market(path, random_matrix(100, 100, 5, Storage::general, 1));
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  expect_error([&] { (void)read_matrix(path); }, {path, "truncated"});
  std::filesystem::remove(path);
}

// Truth: gzip's format, in which files may be joined.
TEST(ReadMatrix, GzipOfSeveralMembers) {
  const std::string path = temporary("m.mtx.gz");
  for (const char* part : {"%%MatrixMarket matrix coordinate real general\n", "1 1 1\n", "1 1 5\n"}) {
    gzFile file = gzopen(path.c_str(), "ab");
    gzputs(file, part);
    gzclose(file);
  }
  EXPECT_EQ(read_matrix(path).values, std::vector<double>{5});
  std::filesystem::remove(path);
}

}  // namespace matrix_market_test
}  // namespace espalier::matrix
