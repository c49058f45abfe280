// Matrices of substructures from files: every encoding gives the same numbers, and broken files say where.
#include "dynamics/substructure/matrix_file.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "dynamics/model/model_common.hpp"

namespace espalier::dynamics {
namespace matrix_file_test {

std::string stored(const char* name) {
  return (espalier::test::source_folder() / "tests/dynamics/output4" / name).string();
}

double entry(const FileMatrix& m, Index i, Index j) {
  double value = 0;
  for (const FileMatrix::Entry& e : m.entries)
    if (e.row == i && e.column == j) value = e.value;
  return value;
}

std::string message(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.status().code, StatusCode::invalid_input);
    return error.what();
  }
  return "no error";
}

void expect_in(const std::string& part, const std::string& text) {
  EXPECT_NE(text.find(part), std::string::npos) << text;
}

// The files were written by pyyeti 1.4.7 (OUTPUT4 in text and binary, both byte orders, dense, strings, BIGMAT) from
// a(i, j) = (i+1)/(j+2) (-1)^(i+j) 10^(i-j), zero where 3 divides i j - 1, and diag((i+1)/3).
TEST(MatrixFile, EveryOutput4GivesTheSameNumbers) {
  for (const char* name : {"text_dense.op4", "text_bigmat.op4", "text_strings.op4", "little_dense.op4", "big_dense.op4",
                           "little_bigmat.op4", "big_strings.op4"}) {
    SCOPED_TRACE(name);
    const std::vector<FileMatrix> all = read_file_matrices(stored(name));
    ASSERT_EQ(all.size(), 2U);
    EXPECT_EQ(all[0].name, "KAA");
    EXPECT_EQ(all[1].name, "MAA");
    EXPECT_TRUE(all[0].unknowns.empty());
    for (Index i = 0; i < 7; ++i)
      for (Index j = 0; j < 7; ++j) {
        const double a = (i * j) % 3 == 1 ? 0 : (i + 1.0) / (j + 2.0) * ((i + j) % 2 ? -1 : 1) * std::pow(10.0, i - j);
        EXPECT_NEAR(entry(all[0], i, j), a, 1e-15 * std::abs(a)) << i << ' ' << j;
        EXPECT_NEAR(entry(all[1], i, j), i == j ? (i + 1) / 3.0 : 0.0, 1e-15) << i << ' ' << j;
      }
  }
  EXPECT_EQ(read_file_matrix(stored("text_dense.op4"), "maa").name, "MAA");
  expect_in("say which matrix by 'name'; the file has 'KAA', 'MAA'",
            message([] { (void)read_file_matrix(stored("text_dense.op4"), ""); }));
  expect_in("has no matrix 'X'; it has 'KAA', 'MAA'",
            message([] { (void)read_file_matrix(stored("text_dense.op4"), "X"); }));
}

// Integers of 8 bytes: every word is one.
TEST(MatrixFile, LongIntegersOfBinaryFiles) {
  std::string content;
  const auto append = [&](auto value) { content.append(reinterpret_cast<const char*>(&value), sizeof(value)); };
  const auto record = [&](const std::vector<std::int64_t>& integers, const std::string& tail) {
    const auto length = static_cast<std::int32_t>(8 * integers.size() + tail.size());
    append(length);
    for (const std::int64_t k : integers) append(k);
    content += tail;
    append(length);
  };
  const double values[2] = {1.5, -2.5};
  std::string raw(sizeof(values), ' ');
  std::memcpy(raw.data(), values, sizeof(values));
  record({2, 2, 2, 2}, "KAAX            ");
  record({1, 1, 2}, raw);
  record({3, 1, 1}, raw.substr(0, 8));
  const std::vector<FileMatrix> all = parse_output4(content, "long.op4");
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(all[0].name, "KAAX");
  EXPECT_EQ(entry(all[0], 0, 0), 1.5);
  EXPECT_EQ(entry(all[0], 1, 0), -2.5);
}

TEST(MatrixFile, BrokenOutput4SaysWhere) {
  const auto parsed = [](std::string content) {
    return message([&] { (void)parse_output4(std::move(content), "k.op4"); });
  };
  const std::string text = content_of(stored("text_dense.op4")), binary = content_of(stored("little_dense.op4"));
  // Cut anywhere: an error, or the first matrix whole; never a crash and never half of a matrix.
  for (const std::string& whole : {text, binary, content_of(stored("little_bigmat.op4"))})
    for (std::size_t size = 1; size < whole.size(); size += 7) {
      try {
        const std::vector<FileMatrix> all = parse_output4(whole.substr(0, size), "cut.op4");
        for (const FileMatrix& m : all) EXPECT_EQ(m.entries.size(), m.name == "KAA" ? 41U : 7U) << size;
      } catch (const Error&) {
      }
    }
  // Any byte changed: the same.
  for (const std::string& whole : {text, binary, content_of(stored("big_strings.op4"))})
    for (std::size_t k = 0; k < whole.size(); k += 3)
      for (const char c : {'\0', '\xff', '9', '-'}) {
        std::string changed = whole;
        changed[k] = c;
        try {
          (void)parse_output4(std::move(changed), "changed.op4");
        } catch (const Error&) {
        }
      }
  const std::string head = "       2       2       2       2K       1P,3E23.16\n";
  expect_in("k.op4:1: the file ends within a matrix", parsed(head));
  expect_in("is complex", parsed("       2       2       2       4K       1P,3E23.16\n"));
  expect_in("column 1: 3 values from row 1 on do not fit 2 rows", parsed(head + "       1       1       3\n"));
  expect_in("k.op4:3: '1.0x' is not a number", parsed(head + "       1       1       1\n 1.0x\n"));
  expect_in("is not finite", parsed(head + "       1       1       1\n nan\n"));
  expect_in("at most 5000", parsed("  999999  999999       2       2K       1P,3E23.16\n"));
}

// Fields of 8 and 16 columns, between commas, Nastran's short exponents, one triangle, a scalar point.
TEST(MatrixFile, DmigCards) {
  const std::string text =
      "DMIG    KAAX           0       6       2       0                       3\n"
      "DMIG    KAAX          11       1              11       1   4.0+3\n"
      "              12       1  -4.0+3              50       0     1.5\n"
      "DMIG*   KAAX                          12               1\n"
      "*                     12               1 4.000000000D+03\n"
      "DMIG,KAAX,50,0,,50,,2.5\n"
      "DMIG,MAAX,0,1,2,0\n"
      "DMIG,MAAX,11,1,,11,1,3.0\n"
      "ENDDATA\n";
  const std::vector<FileMatrix> all = parse_dmig(text, "k.pch");
  ASSERT_EQ(all.size(), 2U);
  const std::vector<NodalUnknown> expected = {{11, 1}, {12, 1}, {50, 0}};
  EXPECT_EQ(all[0].unknowns, expected);
  EXPECT_EQ(entry(all[0], 0, 0), 4000);
  EXPECT_EQ(entry(all[0], 1, 0), -4000);
  EXPECT_EQ(entry(all[0], 2, 0), 1.5);
  EXPECT_EQ(entry(all[0], 1, 1), 4000);
  EXPECT_EQ(entry(all[0], 2, 2), 2.5);
  EXPECT_EQ(entry(all[1], 0, 0), 3);
  const auto parsed = [](const std::string& cards) { return message([&] { (void)parse_dmig(cards, "k.pch"); }); };
  expect_in("k.pch:1: DMIG: matrix 'K' is complex", parsed("DMIG,K,0,6,4,0\n"));
  expect_in("has the form 9", parsed("DMIG,K,0,9,2,0\n"));
  expect_in("before the card that begins it", parsed("DMIG,K,1,1,,1,1,2.0\n"));
  expect_in("field 8 (value): 'x' is not a number", parsed("DMIG,K,0,6,2,0\nDMIG,K,1,1,,1,1,x\n"));
}

TEST(MatrixFile, NodalEntries) {
  const std::vector<FileMatrix> all = parse_nodal_entries("** stiffness\n1,1, 1,1, 2.5\n2 3 1 1 -1e-3\n", "k.mtx");
  ASSERT_EQ(all.size(), 1U);
  const std::vector<NodalUnknown> expected = {{1, 1}, {2, 3}};
  EXPECT_EQ(all[0].unknowns, expected);
  EXPECT_EQ(entry(all[0], 0, 0), 2.5);
  EXPECT_EQ(entry(all[0], 1, 0), -1e-3);
  const auto parsed = [](const char* text) { return message([&] { (void)parse_nodal_entries(text, "k.mtx"); }); };
  expect_in("k.mtx:1", parsed("1,1,1,1\n"));
  expect_in("k.mtx:1: more than node", parsed("1,1,1,1,2,3\n"));
}

TEST(MatrixFile, ContentSaysWhatItIs) {
  const ScratchFolder folder;
  const auto read = [&](const std::string& text) {
    std::ofstream(folder.path() + "/a") << text;
    return read_file_matrices(folder.path() + "/a");
  };
  EXPECT_EQ(read("%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 4\n2 1 -1\n")[0].entries.size(), 2U);
  EXPECT_EQ(read("** K\n1,1,1,1,3.0\n")[0].unknowns.size(), 1U);
  EXPECT_EQ(read(content_of(stored("text_dense.op4"))).size(), 2U);
  EXPECT_EQ(read("$ punched\nDMIG,K,0,6,2,0\nDMIG,K,1,1,,1,1,2.0\n")[0].name, "K");
  expect_in("no matrix found", message([&] { (void)read("hello\n"); }));
  expect_in("no matrix found", message([&] { (void)read(""); }));
  std::ofstream(folder.path() + "/g") << "GRID,7,,1.0,2.0,3.0\nGRID,5,,0.5\n";
  const std::vector<GridPoint> points = read_grid_points(folder.path() + "/g");
  ASSERT_EQ(points.size(), 2U);
  EXPECT_EQ(points[0].label, 7);
  EXPECT_EQ(points[1].position, (Point{0.5, 0, 0}));
  std::ofstream(folder.path() + "/g") << "GRID,7,3,1.0,2.0,3.0\n";
  expect_in("basic one", message([&] { (void)read_grid_points(folder.path() + "/g"); }));
}

}  // namespace matrix_file_test
}  // namespace espalier::dynamics
