// Pencils made of a spectrum: M = B^T B, K = B^T L B, and what is left of L where rows of B are constraints or without
// mass. Truth: L itself, and a dense solver where rounding of K moves it. Clusters, zeros, negative and infinite
// eigenvalues, decades and scales in all combinations.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <functional>
#include <numeric>
#include <random>

#include "modes/modes_common.hpp"

namespace espalier {

using namespace test;

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Random = std::mt19937_64;

double uniform(Random& random) { return std::uniform_real_distribution<double>(0, 1)(random); }
Index whole(Random& random, Index least, Index most) {
  return std::uniform_int_distribution<Index>(least, most)(random);
}

struct Spectrum {
  const char* name;
  std::function<double(Index i, Index n, Random&)> value;
  bool close = false;  // eigenvalues are too close to be told apart
};

const std::vector<Spectrum>& spectra() {
  static const std::vector<Spectrum> all = {
      {"two clusters", [](Index i, Index n, Random&) { return i < n / 2 ? 0.0 : 2.0; }},
      {"three clusters",
       [](Index i, Index, Random&) {
         return std::array{0.0, 1.0, 1e3}[static_cast<std::size_t>(i) % 3];
       }},
      {"far clusters",
       [](Index i, Index, Random&) {
         return std::array{0.0, 1.0, 1e8}[static_cast<std::size_t>(i) % 3];
       }},
      {"one far below",
       [](Index i, Index, Random& r) { return i == 0 ? -3e12 : static_cast<double>(whole(r, -1, 5)); }},
      {"some far below", [](Index i, Index, Random& r) { return i < 4 ? -std::pow(10.0, 3 * i) : uniform(r); }},
      {"uniform", [](Index, Index, Random& r) { return uniform(r); }},
      {"both signs", [](Index, Index, Random& r) { return uniform(r) - 0.5; }},
      {"all equal", [](Index, Index, Random&) { return 3.0; }},
      {"all zero", [](Index, Index, Random&) { return 0.0; }},
      {"nearly equal", [](Index i, Index, Random&) { return 1 + 1e-10 * static_cast<double>(i % 7); }, true},
      {"rigid and elastic", [](Index i, Index, Random& r) { return i < 6 ? 0.0 : std::pow(10.0, -4 * uniform(r)); }},
      {"decades", [](Index, Index, Random& r) { return std::pow(10.0, 8 * uniform(r) - 4); }},
      {"negative clusters",
       [](Index i, Index, Random&) {
         return std::array{-2.0, -1.0, 0.0, 5.0}[static_cast<std::size_t>(i) % 4];
       }},
  };
  return all;
}

// Well conditioned, of four sorts.
MatrixXd basis(Index n, int sort, Random& random) {
  MatrixXd b = MatrixXd::Identity(n, n);
  if (sort == 0) return b;
  if (sort == 1) {  // masses over decades
    for (Index i = 0; i < n; ++i) b(i, i) = std::pow(10.0, 3 * uniform(random) - 1.5);
    return b;
  }
  if (sort == 2) {  // few entries
    for (Index i = 1; i < n; ++i) b(i, whole(random, 0, i - 1)) = uniform(random) - 0.5;
    return b;
  }
  for (Index j = 0; j < n; ++j)
    for (Index i = 0; i < n; ++i) b(i, j) = uniform(random) - 0.5;
  return b.householderQr().householderQ() * MatrixXd::Identity(n, n);
}

struct Pencil {
  MatrixXd k, m;
  std::vector<double> finite;  // rising
  double largest = 0;
};

// @param infinite  unknowns of y = B x without mass  @param held  others that constraints hold
Pencil pencil(const std::vector<double>& l, const MatrixXd& b, Index infinite, Index held, Random& random) {
  const auto n = static_cast<Index>(l.size());
  Pencil p;
  VectorXd mass = VectorXd::Ones(n), values(n);
  for (Index i = 0; i < n; ++i) values[i] = l[static_cast<std::size_t>(i)];
  std::vector<Index> order(static_cast<std::size_t>(n));
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), random);
  double scale = 0;
  for (Index i = 0; i < n; ++i) scale = std::max(scale, std::abs(values[i]));
  if (scale == 0) scale = 1;
  for (Index k = 0; k < infinite; ++k) {
    mass[order[static_cast<std::size_t>(k)]] = 0;
    values[order[static_cast<std::size_t>(k)]] = k % 2 == 0 ? scale : -scale;
  }
  for (auto k = static_cast<std::size_t>(infinite + held); k < order.size(); ++k) p.finite.push_back(values[order[k]]);
  std::sort(p.finite.begin(), p.finite.end());
  p.largest = scale;
  p.k = MatrixXd::Zero(n + held, n + held);
  p.m = MatrixXd::Zero(n + held, n + held);
  p.k.topLeftCorner(n, n) = b.transpose() * values.asDiagonal() * b;
  p.m.topLeftCorner(n, n) = b.transpose() * mass.asDiagonal() * b;
  for (Index k = 0; k < held; ++k) {
    const VectorXd row = b.row(order[static_cast<std::size_t>(infinite + k)]);
    p.k.row(n + k).head(n) = row.transpose();
    p.k.col(n + k).head(n) = row;
  }
  return p;
}

// What is wrong with the answer; empty: nothing.
std::string wrong(const ModesResult& r, const std::vector<double>& exact, std::size_t count, double error) {
  if (!r.status.ok()) return r.status.message;
  if (r.eigenvalues.size() != count) return fmt::format("{} of {} modes", r.eigenvalues.size(), count);
  for (std::size_t i = 0; i < count; ++i)
    if (!(std::abs(r.eigenvalues[i] - exact[i]) <= error))
      return fmt::format("mode {} is {:.17g} instead of {:.17g}", i, r.eigenvalues[i], exact[i]);
  return "";
}

}  // namespace

TEST(ModesSpectra, EverySpectrumIsFoundWhole) {
  constexpr int kSeeds = 6;
  int tried = 0, proven = 0;
  for (const Spectrum& spectrum : spectra())
    for (int seed = 0; seed < kSeeds; ++seed)
      for (int sort = 0; sort < 4; ++sort) {
        Random random(static_cast<std::uint64_t>(1000 * seed + sort));
        const Index n = whole(random, 7, 70);
        // The null space of M is known to rounding alone: beside 12 decades of K that is too little.
        Index infinite = seed % 3 == 1 ? whole(random, 0, n / 4) : 0;
        if (std::string(spectrum.name) == "one far below" && sort > 1) infinite = 0;
        const Index held = seed % 3 == 2 ? whole(random, 0, n / 4) : 0;
        std::vector<double> l;
        for (Index i = 0; i < n; ++i) l.push_back(spectrum.value(i, n, random));
        Pencil p = pencil(l, basis(n, sort, random), infinite, held, random);
        const double unit = std::array{1.0, 1e-12, 1e12}[static_cast<std::size_t>(seed) % 3];
        p.k.topLeftCorner(n, n) *= unit;
        for (double& x : p.finite) x *= unit;
        const auto all = static_cast<Index>(p.finite.size());
        const Index count = whole(random, 1, all);
        // Vectors with residuals of up to 1e-6 are taken, which moves eigenvalues by its square; what is nearer than
        // 1e-9 counts as equal.
        const double error = (spectrum.close ? 1e-8 : 1e-11) * p.largest * unit;
        SCOPED_TRACE(fmt::format("{}, n {}, seed {}, sort {}, {} infinite, {} held, unit {:g}, {} of {} wanted",
                                 spectrum.name, n, seed, sort, infinite, held, unit, count, all));
        const ModesResult r = find_modes(sparse(p.k), sparse(p.m), lowest(count));
        ++tried;
        proven += r.complete ? 1 : 0;
        EXPECT_EQ(wrong(r, p.finite, static_cast<std::size_t>(count), error), "");
      }
  EXPECT_GE(proven, tried * 9 / 10);
}

}  // namespace espalier
