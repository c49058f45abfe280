#include "solver/analysis/analysis_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <limits>
#include <type_traits>
#include <utility>

#include "base/output_file.hpp"

namespace espalier::solver {

namespace {

constexpr char kMagic[8] = {'E', 'S', 'P', 'A', 'N', 'A', 'L', '2'};

class Fnv {
 public:
  void add(const void* data, std::size_t bytes) {
    const auto* p = static_cast<const unsigned char*>(data);
    for (std::size_t k = 0; k < bytes; ++k) hash_ = (hash_ ^ p[k]) * 0x100000001b3ULL;
  }
  template <class T>
  void add_words(std::span<const T> v) {  // eight bytes at a time: a pattern has many
    for (const T x : v) {
      hash_ = (hash_ ^ static_cast<std::uint64_t>(x)) * 0x100000001b3ULL;
      hash_ ^= hash_ >> 29;
    }
  }
  [[nodiscard]] std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325ULL;
};

class Writer {
 public:
  explicit Writer(const std::string& path) : out_(path) {}
  void bytes(const void* p, std::size_t n) {
    out_.write({static_cast<const char*>(p), n});
    hash_.add(p, n);
  }
  template <class T>
  void value(const T& v) {
    bytes(&v, sizeof v);
  }
  template <class List>
  void array(const List& v) {
    value(static_cast<std::uint64_t>(v.size()));
    bytes(v.data(), v.size() * sizeof(typename List::value_type));
  }
  void finish() {
    const std::uint64_t h = hash_.value();
    out_.write({reinterpret_cast<const char*>(&h), sizeof h});
    out_.commit();
  }

 private:
  base::OutputFile out_;
  Fnv hash_;
};

class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path), in_(path, std::ios::binary) {
    base::check_path(path);
    if (!in_) fail("cannot be opened");
    in_.seekg(0, std::ios::end);
    const std::streamoff size = in_.tellg();
    if (size < 0) fail("the file cannot be read");
    left_ = static_cast<std::uint64_t>(size);
    in_.seekg(0);
  }
  [[noreturn]] void fail(const std::string& why) const {
    throw Error(StatusCode::invalid_input,
                fmt::format("{}: {}; analyze the matrix and save the analysis again", path_, why));
  }
  void bytes(void* p, std::size_t n) {
    if (n > left_) fail("the file ends too early");
    in_.read(static_cast<char*>(p), static_cast<std::streamsize>(n));
    if (!in_) fail("the file cannot be read");
    left_ -= n;
    hash_.add(p, n);
  }
  template <class T>
  T value() {
    T v{};
    bytes(&v, sizeof v);
    return v;
  }
  template <class List>
  void array(List& v) {
    using T = typename List::value_type;
    const auto size = value<std::uint64_t>();
    if (size > left_ / sizeof(T)) fail("the file ends too early");
    v.resize(static_cast<std::size_t>(size));
    bytes(v.data(), v.size() * sizeof(T));
  }
  void finish() {
    const std::uint64_t expected = hash_.value();
    std::uint64_t h = 0;
    if (left_ != sizeof h) fail("the file has a wrong length");
    in_.read(reinterpret_cast<char*>(&h), sizeof h);
    if (h != expected) fail("the checksum does not match: the file is damaged");
  }

 private:
  std::string path_;
  std::ifstream in_;
  std::uint64_t left_ = 0;
  Fnv hash_;
};

// Whether p holds each of 0 .. n-1 once; an empty p stands for the identity.
bool is_permutation(const std::vector<Index>& p, std::size_t n) {
  if (p.empty()) return true;
  std::vector<char> seen(n, 0);
  for (const Index i : p)
    if (i < 0 || static_cast<std::size_t>(i) >= n || std::exchange(seen[static_cast<std::size_t>(i)], 1) != 0)
      return false;
  return p.size() == n;
}

/// Hashes of ranges, hashed in their turn: the same for any number of threads.
template <class T>
void add_ranges(Fnv& h, std::span<const T> words, base::ThreadPool& pool) {
  constexpr std::size_t kWords = 1 << 16;
  std::vector<std::uint64_t> ranges((words.size() + kWords - 1) / kWords);
  pool.for_each(static_cast<std::int64_t>(ranges.size()), [&](std::int64_t p) {
    const std::size_t first = static_cast<std::size_t>(p) * kWords;
    Fnv range;
    range.add_words(words.subspan(first, std::min(kWords, words.size() - first)));
    ranges[static_cast<std::size_t>(p)] = range.value();
  });
  h.add_words(std::span<const std::uint64_t>(ranges));
}

}  // namespace

// The file passed its checksum; this guards against files made by something else. The tree is checked beside the
// matrix, by analysis::verify_tree().
std::string wrong_with(const SavedAnalysis& s) {
  const auto n = static_cast<std::size_t>(std::max<Index>(s.tree.n, 0));
  if (s.tree.n < 0 || s.tree.parent.size() > n) return "its sizes do not fit each other";
  const auto positive = [](double x) { return x > 0 && x < std::numeric_limits<double>::infinity(); };
  for (const auto* scale : {&s.row_scale, &s.col_scale})
    if (!(scale->empty() || scale->size() == n) || !std::all_of(scale->begin(), scale->end(), positive))
      return "the scaling is not n positive numbers";
  if (!is_permutation(s.row_of_col, n)) return "the matching is no permutation of the rows";
  if (s.row_scale.size() != s.col_scale.size()) return "rows are scaled, columns are not, or the other way round";
  if (s.kind != Kind::lu && !(s.row_of_col.empty() && s.row_scale == s.col_scale))
    return "rows and columns of a symmetric factorization must go together";
  return {};
}

std::uint64_t pattern_hash(const MatrixView& a, base::ThreadPool& pool) {
  Fnv h;
  const std::int64_t head[] = {a.rows, a.cols, static_cast<std::int64_t>(a.storage)};
  h.add(head, sizeof head);
  add_ranges(h, a.col_ptr, pool);
  add_ranges(h, a.row_ind, pool);
  return h.value();
}

void write_analysis(const std::string& path, const SavedAnalysis& s, std::uint64_t hash) {
  Writer w(path);
  w.bytes(kMagic, sizeof kMagic);
  w.value(hash);
  w.value(static_cast<std::int32_t>(s.kind));
  w.value(s.tree.n);
  each_array(s, [&](const auto& list) { w.array(list); });
  w.finish();
}

SavedAnalysis read_analysis(const std::string& path, std::uint64_t hash) {
  Reader r(path);
  char magic[sizeof kMagic];
  r.bytes(magic, sizeof magic);
  if (std::memcmp(magic, kMagic, sizeof magic) != 0) r.fail("the file is not a saved analysis (or of another version)");
  if (r.value<std::uint64_t>() != hash) r.fail("the analysis belongs to a matrix with another pattern");
  SavedAnalysis s;
  const auto kind = r.value<std::int32_t>();
  if (kind < static_cast<std::int32_t>(Kind::llt) || kind > static_cast<std::int32_t>(Kind::lu))
    r.fail("the file is not a valid analysis");
  s.kind = static_cast<Kind>(kind);
  s.tree.n = r.value<Index>();
  each_array(s, [&](auto& list) { r.array(list); });
  r.finish();
  if (const std::string wrong = wrong_with(s); !wrong.empty()) r.fail("the file is not a valid analysis: " + wrong);
  return s;
}

}  // namespace espalier::solver
