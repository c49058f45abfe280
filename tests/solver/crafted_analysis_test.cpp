// Saved analyses that were changed on purpose and given the right checksum again. Truths: a solution's backward error,
// computed here; the determinant of a dense L U and the signs of the eigenvalues (Eigen).
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>

#include "rounds.hpp"
#include "solver/solver_common.hpp"

namespace espalier {
namespace crafted_analysis_test {

using reference::Values;
using namespace test;
using Bytes = std::vector<unsigned char>;

// The file by its parts: 8 bytes each of magic and pattern, then kind, n, eight arrays, checksum.
struct File {
  Bytes head;  // magic, pattern, kind, n
  struct Array {
    std::size_t width;  // bytes of an element: 4 integers, 8 integers, 0 for doubles of 8
    Bytes data;
    [[nodiscard]] std::size_t each() const { return width == 4 ? 4 : 8; }
    [[nodiscard]] std::size_t size() const { return data.size() / each(); }
  };
  std::vector<Array> arrays;
};

constexpr std::size_t kWidths[] = {4, 4, 4, 8, 4, 0, 0, 4};  // order, first, parent, row_ptr, rows, scales, row_of_col
enum { kOrder, kFirst, kParent, kRowPtr, kRows, kRowScale, kColScale, kRowOfCol };

File read_file(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  const std::vector<char> all{std::istreambuf_iterator<char>(in), {}};
  File file;
  std::size_t at = 24;
  file.head.assign(all.begin(), all.begin() + 24);
  for (const std::size_t width : kWidths) {
    std::uint64_t size = 0;
    std::memcpy(&size, &all[at], sizeof size);
    at += sizeof size;
    File::Array array{width, {}};
    const std::size_t bytes = size * array.each();
    array.data.assign(all.begin() + static_cast<std::ptrdiff_t>(at),
                      all.begin() + static_cast<std::ptrdiff_t>(at + bytes));
    at += bytes;
    file.arrays.push_back(std::move(array));
  }
  EXPECT_EQ(at + 8, all.size()) << "the test does not know the format any more";
  return file;
}

void write_file(const std::string& path, const File& file) {
  Bytes all = file.head;
  const auto add = [&](std::uint64_t v) {
    for (int k = 0; k < 8; ++k) all.push_back(static_cast<unsigned char>(v >> (8 * k)));
  };
  for (const File::Array& a : file.arrays) {
    add(a.size());
    all.insert(all.end(), a.data.begin(), a.data.end());
  }
  std::uint64_t hash = 0xcbf29ce484222325ULL;  // FNV-1a
  for (const unsigned char c : all) hash = (hash ^ c) * 0x100000001b3ULL;
  add(hash);
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(all.data()), static_cast<std::streamsize>(all.size()));
}

class Attacker {
 public:
  explicit Attacker(std::uint64_t seed) : random_(seed) {}

  // One to three changes of the kinds that a format of arrays allows.
  File change(const File& good) {
    File bad = good;
    for (std::uint64_t k = 1 + pick(3); k > 0; --k) change_once(bad);
    return bad;
  }

 private:
  std::uint64_t pick(std::uint64_t n) { return random_() % n; }

  void change_once(File& f) {
    File::Array& a = f.arrays[pick(f.arrays.size())];
    switch (pick(9)) {
      case 0:
        f.head[16] = static_cast<unsigned char>(pick(5));  // kind
        return;
      case 1:
        return resize(a);
      case 2:
        return exchange(a, pick(a.size() + 1), pick(a.size() + 1));
      case 3:
        return copy(a);
      case 4:  // the same wrong factor for row and column, as a symmetric scaling has it
        if (const std::size_t i = pick(f.arrays[kRowScale].size() + 1); i < f.arrays[kRowScale].size()) {
          set_scale(f.arrays[kRowScale], i);
          f.arrays[kColScale] = f.arrays[kRowScale];
        }
        return;
      case 5:  // a matching and scales where there were none
        if (f.arrays[kRowOfCol].size() == 0) f.arrays[kRowOfCol].data = f.arrays[kOrder].data;
        return;
      case 6:
        return shift_positions(f);
      default:
        return set(a, pick(a.size() + 1));
    }
  }

  void resize(File::Array& a) {
    const std::size_t size = pick(3) == 0 ? 0 : a.size() + pick(5);
    a.data.resize(std::max<std::size_t>(2, size) * a.each() - 2 * a.each(), 1);
  }
  void exchange(File::Array& a, std::size_t i, std::size_t j) {
    if (i >= a.size() || j >= a.size()) return;
    for (std::size_t k = 0; k < a.each(); ++k) std::swap(a.data[i * a.each() + k], a.data[j * a.each() + k]);
  }
  void copy(File::Array& a) {
    if (a.size() < 2) return;
    const std::size_t from = pick(a.size()), to = pick(a.size());
    for (std::size_t k = 0; k < a.each(); ++k) a.data[to * a.each() + k] = a.data[from * a.each() + k];
  }
  // Two neighbouring fronts give or take a pivot.
  void shift_positions(File& f) {
    File::Array& first = f.arrays[kFirst];
    if (first.size() < 3) return;
    const std::size_t i = 1 + pick(first.size() - 2);
    store_value<std::int32_t>(first, i, get<std::int32_t>(first, i) + (pick(2) == 0 ? 1 : -1));
  }
  void set_scale(File::Array& a, std::size_t i) {
    const double extremes[] = {0, -1, 5e-324, 1e-310, 1e-200, 1e200, 1.7e308, INFINITY, NAN};
    const double old = get<double>(a, i);
    store_value<double>(a, i, pick(2) == 0 ? extremes[pick(9)] : std::ldexp(old, static_cast<int>(pick(200)) - 100));
  }
  void set(File::Array& a, std::size_t i) {
    if (i >= a.size()) return;
    if (a.width == 0) return set_scale(a, i);
    const std::int64_t wild[] = {
        -1,        0,        INT32_MAX, INT32_MIN, -2, 89, 90, 91, std::int64_t{1} << 32, -(std::int64_t{1} << 32),
        INT64_MAX, INT64_MIN};
    const auto near = static_cast<std::int64_t>(pick(5)) - 2;
    if (a.width == 4) {
      const std::int64_t old = get<std::int32_t>(a, i);
      store_value<std::int32_t>(a, i, static_cast<std::int32_t>(pick(2) == 0 ? wild[pick(12)] : old + near));
    } else {
      const auto old = static_cast<std::uint64_t>(get<std::int64_t>(a, i));
      const auto step = static_cast<std::uint64_t>(pick(2) == 0 ? wild[pick(12)] : near);
      store_value<std::int64_t>(a, i, static_cast<std::int64_t>(old + step));
    }
  }
  template <class T>
  T get(const File::Array& a, std::size_t i) const {
    T v{};
    std::memcpy(&v, &a.data[i * sizeof(T)], sizeof v);
    return v;
  }
  template <class T>
  void store_value(File::Array& a, std::size_t i, T v) {
    std::memcpy(&a.data[i * sizeof(T)], &v, sizeof v);
  }

  std::mt19937_64 random_;
};

struct Truth {
  SparseMatrix a;
  File file;
  reference::Determinant determinant;
  reference::Signs signs;
};

// What a changed file may lead to: a refusal, or the right answer. Returns whether it was refused.
bool refused_or_right(const std::string& path, const Truth& truth) {
  Options o;
  o.threads = 1;
  Solver s(o);
  const AnalysisResult loaded = s.load_analysis(path, truth.a);
  if (!loaded.status.ok()) {
    EXPECT_EQ(loaded.status.code, StatusCode::invalid_input) << loaded.status.message;
    EXPECT_NE(loaded.status.message.find(path), std::string::npos) << loaded.status.message;
    return true;
  }
  const FactorResult f = s.factorize(truth.a);
  if (!f.status.ok()) return true;  // a scaling may be as bad as it likes: then the factorization says so
  EXPECT_EQ(f.determinant_sign, truth.determinant.sign);
  EXPECT_NEAR(f.determinant_log, truth.determinant.log, 1e-9);
  if (s.analysis().kind != Kind::lu) {
    EXPECT_EQ(f.inertia.positive, truth.signs.positive);
    EXPECT_EQ(f.inertia.negative, truth.signs.negative);
  }
  const std::vector<double> b = reference::random_vector(truth.a.rows, 7);
  std::vector<double> x(b.size());
  if (s.solve(b, x).status.ok()) {
    EXPECT_LE(reference::backward_error(truth.a, b, x, 1, false), 1e-10);
  }
  return false;
}

TEST(CraftedAnalysis, IsRefusedOrGivesTheRightAnswer) {
  const std::string path =
      (std::filesystem::temp_directory_path() / ("espalier_crafted_" + std::to_string(::getpid()))).string();
  for (const Values values : {Values::positive, Values::indefinite, Values::general}) {
    Truth truth{reference::random_system(90, 5, values, 41), {}, {}, {}};
    truth.determinant = reference::determinant(truth.a);
    if (values != Values::general) truth.signs = reference::signs(truth.a, 1e-13);
    Solver s(two_threads());
    ASSERT_TRUE(s.analyze(truth.a).status.ok());
    ASSERT_TRUE(s.save_analysis(path).ok());
    truth.file = read_file(path);
    write_file(path, truth.file);
    EXPECT_FALSE(refused_or_right(path, truth)) << "the file itself";
    int refused = 0;
    constexpr int kCases = espalier::test::rounds(500, 80);
    for (int k = 0; k < kCases && !::testing::Test::HasFailure(); ++k) {
      SCOPED_TRACE("values " + std::to_string(static_cast<int>(values)) + ", seed " + std::to_string(k));
      write_file(path, Attacker(static_cast<std::uint64_t>(k)).change(truth.file));
      refused += refused_or_right(path, truth) ? 1 : 0;
    }
    EXPECT_GT(refused, kCases / 4);
    EXPECT_LT(refused, kCases);
  }
  std::filesystem::remove(path);
}

}  // namespace crafted_analysis_test
}  // namespace espalier
